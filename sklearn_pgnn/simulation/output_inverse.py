"""The state behind an output that shows it on another scale: scaled, shifted, or nonlinear."""

from functools import lru_cache

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import numpy_function

#: largest number of Newton steps
ITERATIONS = 50
#: last step, as a share of the largest reading, and of readings that are all zero
ACCURACY, TINY = 1e-12, 1e-300
#: error of the reading of a state that counts as found, in last steps: slopes are below it
SLACK = 1e3


def state_behind(
    model: PhysicsModel, output: str, state: str, shown: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    r"""Return the state, or its magnitude, behind what an output shows, by Newton's method.

    .. math:: y = g(x), \qquad y = g(|x|)

    with a polynomial :math:`g`, whose limits are ignored: a reading at a limit is taken as if the
    scale went on.

    >>> from sklearn_pgnn.physics.effects import SensorGain
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> cart = cart_on_spring() + SensorGain("position", error=0.25)
    >>> state_behind(cart, "position", "x", np.array([1.0, 2.0]))
    (array([0.8, 1.6]), array([0.8, 0.8]))
    """
    scale = _scale(model.outputs[output], state, tuple(model.parameters))
    if scale is None:
        return None
    numbers = [parameter.value for parameter in model.parameters.values()]
    x, least = shown.copy(), ACCURACY * max(float(np.abs(shown).max(initial=0.0)), TINY)
    with np.errstate(all="ignore"):
        for _ in range(ITERATIONS):
            value, slope = scale(*numbers, x)
            step = (value - shown) / slope
            x -= step
            if np.abs(step).max(initial=0.0) <= least:
                break
        value, slope = np.broadcast_arrays(*scale(*numbers, x))
        found = (np.abs(value - shown) <= SLACK * least) & (slope != 0)
        return np.where(found, x, shown), np.where(found, 1 / slope, 1.0)


def has_scale(model: PhysicsModel, output: str, state: str) -> bool:
    """Return whether an output shows a state on a scale of its own, see `state_behind`."""
    return _scale(model.outputs[output], state, tuple(model.parameters)) is not None


def magnitude_in(output: sympy.Expr, state: str) -> sympy.Expr:
    """Return what an output shows of a state: the magnitude of it or of what holds it, or itself.

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
def _scale(output: sympy.Expr, state: str, parameters: tuple[str, ...]):
    """Return reading and slope as a function of parameters and state; None where there is none."""
    shown, seen = magnitude_in(output, state), symbol(state)
    if isinstance(shown, sympy.Abs):
        output = output.xreplace({shown: shown.args[0]})
    output = _without_limits(output, seen)
    allowed = {symbol(name) for name in parameters} | {seen}
    if output == seen or not output.free_symbols <= allowed or not output.is_polynomial(seen):
        return None
    return numpy_function((*parameters, state), [output, sympy.diff(output, seen)])


def _without_limits(output: sympy.Expr, seen: sympy.Symbol) -> sympy.Expr:
    """Return an output without the limits between which it shows the state."""
    if isinstance(output, (sympy.Max, sympy.Min)):
        inside = [each for each in output.args if seen in each.free_symbols]
        if len(inside) == 1:
            return _without_limits(inside[0], seen)
    if output.args and seen in output.free_symbols:
        return output.func(*(_without_limits(each, seen) for each in output.args))
    return output
