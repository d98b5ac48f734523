"""The state behind an output that shows it enlarged, or shifted."""

from functools import lru_cache

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import numpy_function


def gain_and_offset(model: PhysicsModel, output: str, state: str) -> tuple[float, float]:
    r"""Return how an output shows a state, or its magnitude, one and zero where it is no line.

    .. math:: y = a x + b, \qquad y = a |x| + b

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


def magnitude_in(output: sympy.Expr, state: str) -> sympy.Expr:
    """Return what an output shows of a state: the magnitude of it or of what holds it, or itself.

    Parameters
    ----------
    output : sympy.Expr
        An output's equation.
    state : str
        A state.

    Returns
    -------
    sympy.Expr
        The magnitude through which alone the state enters; where there is none, the state.

    Examples
    --------
    >>> from sklearn_pgnn.physics.expressions import parse_expression
    >>> magnitude_in(parse_expression("2*abs(x) + 1", "x"), "x")
    Abs(x)
    """
    inside = [each for each in output.atoms(sympy.Abs) if symbol(state) in each.free_symbols]
    for magnitude in inside:
        if symbol(state) not in output.xreplace({magnitude: sympy.Dummy()}).free_symbols:
            return magnitude
    return symbol(state)


@lru_cache(maxsize=256)
def _line(output: sympy.Expr, state: str, parameters: tuple[str, ...]):
    """Return gain and offset as functions of the parameters; None where the output is no line."""
    shown, seen = magnitude_in(output, state), symbol(state)
    if isinstance(shown, sympy.Abs):
        output = output.xreplace({shown: shown.args[0]})
    gain = sympy.diff(output, seen)
    allowed = {symbol(name) for name in parameters}
    if not (gain.free_symbols <= allowed and output.free_symbols <= allowed | {seen}):
        return None
    return tuple(numpy_function(parameters, each) for each in (gain, output.subs(seen, 0)))
