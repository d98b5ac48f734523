"""The state behind an output that shows it enlarged, or shifted."""

from functools import lru_cache

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import numpy_function


def gain_and_offset(model: PhysicsModel, output: str, state: str) -> tuple[float, float]:
    """Return how an output shows a state, one and zero where it is no line.

    .. math:: y = a x + b

    Parameters
    ----------
    model : PhysicsModel
        The model, at its present parameters.
    output, state : str
        One of its outputs, and one of its states.

    Returns
    -------
    gain, offset : float
        The slope :math:`a` [output/state] and the offset :math:`b` [output].

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import SensorGain
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> gain_and_offset(cart_on_spring() + SensorGain("position", error=0.25), "position", "x")
    (1.25, 0.0)
    """
    line = _line(model.outputs[output], state, tuple(model.parameters))
    if line is None:
        return 1.0, 0.0
    numbers = [parameter.value for parameter in model.parameters.values()]
    gain, offset = (float(each(*numbers)) for each in line)
    return (gain, offset) if np.isfinite([gain, offset]).all() and gain else (1.0, 0.0)


@lru_cache(maxsize=256)
def _line(output: sympy.Expr, state: str, parameters: tuple[str, ...]):
    """Return gain and offset as functions of the parameters; None where the output is no line."""
    gain = sympy.diff(output, symbol(state))
    allowed = {symbol(name) for name in parameters}
    if not (gain.free_symbols <= allowed and output.free_symbols <= allowed | {symbol(state)}):
        return None
    return tuple(numpy_function(parameters, each) for each in (gain, output.subs(symbol(state), 0)))
