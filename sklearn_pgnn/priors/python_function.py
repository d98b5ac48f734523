"""A Python function as a model: it is called once with symbols, which yield its equations.

If it cannot be traced, the model calls it.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError, ModelWarning, OptionError
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.external import line_of
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.called_function import NEAR, by_name, called_function
from sklearn_pgnn.priors.traced import Quantities, Traced, expression_of
from sklearn_pgnn.readings import reading
from sklearn_pgnn.user_line import warn_user

_REMEDY = "Remedy: use arithmetic and NumPy functions on the elements of x, u and p."
#: points at which the equations are compared with the function
POINTS = 8
#: longest evaluation time of a written equation, in order of magnitude [s]
WRITTEN = 1e-7


def from_function(
    rates: Callable,
    states: Mapping[str, str],
    *,
    inputs: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    outputs: Callable | Mapping | None = None,
    trace: str | bool = "auto",
    **more: Any,
) -> PhysicsModel:
    r"""Return a model whose equations a Python function computes.

    .. math:: \dot x = f(t, x, u, p), \qquad y = g(t, x, u, p)

    The functions are called once, with symbols in place of numbers, and the model has the equations
    that they compute: it is compiled, extended and exported like any other. The equations are
    checked against the functions at some points.

    A function that branches on a value, interpolates or calls code that cannot be traced becomes a
    model that calls it at every step, compiled by numba if numba can compile it, else in Python.
    Such a model is simulated, fitted and diagnosed like any other, effects included. It is slower
    by a small factor if compiled, else by a factor of hundreds; derivatives are difference
    quotients (`sklearn_pgnn.physics.external`); a jump in the function is stepped over, so that dry
    friction in it does not stick, and it cannot be exported or written to a model file. The
    arguments that each rate depends on are determined at 256 points.

    Parameters
    ----------
    rates : callable
        ``f(t, x, u, p)``, the rates in the order of the states, or by name; arithmetic and
        NumPy functions, including ``np.where``. ``x``, ``u`` and ``p`` are arrays whose elements
        can also be accessed by name: ``p["mass"]``.
    states : mapping of str to str
        State names and their units, in order.
    inputs : mapping of str to str, optional
        Input names and their units.
    parameters : mapping of str to Parameter, dict or float, optional
        The constants, as `PhysicsModel` takes them.
    outputs : callable or mapping, optional
        ``g(t, x, u, p)``, which returns a dict of values by output name, or texts as `PhysicsModel`
        takes them; by default every state under its own name.
    trace : {"auto", True, False}, default="auto"
        Whether the functions are traced: ``"auto"`` traces them if possible, else calls them with
        a `ModelWarning`; True raises an error if they cannot be traced; False never traces them.
    **more
        Further parameters of `PhysicsModel`: ``name``, ``inertia``, ``simulation`` and so on.

    Returns
    -------
    PhysicsModel
        The model.

    Raises
    ------
    ModelError
        If a function fails, gives different results in repeated calls, or, with ``trace=True``,
        branches on a value or calls code that cannot be traced (``math.sin``, an interpolation, a
        solver); the message gives the line.
    OptionError
        If `trace` has an invalid value.

    Examples
    --------
    >>> def pendulum(t, x, u, p):
    ...     phi, omega = x
    ...     return [omega, (u["torque"] - p["d"] * omega) / p["J"] - 9.81 * np.sin(phi)]
    >>> model = from_function(pendulum, {"phi": "rad", "omega": "rad/s"},
    ...     inputs={"torque": "N m"}, parameters={"J": 0.1, "d": 0.02})
    >>> print(model.to_text())
    phi' = omega
    omega' = -9.81*sin(phi) + (-d*omega + torque)/J

    >>> table = [0.0, 1.0, 10.0], [0.0, 2.0, 5.0]
    >>> def spring(t, x, u, p):
    ...     return [x[1], -np.interp(x[0], *table) / p["m"]]
    >>> model = from_function(spring, {"x": "m", "v": "m/s"}, parameters={"m": 2.0}, trace=False)
    >>> print(model.to_text())
    x' = v
    v' = spring[v](x; m)
    """
    if trace not in ("auto", True, False):
        raise OptionError(f"trace: expected 'auto', True or False, got {trace!r}.")
    inputs, parameters = dict(inputs or {}), parameters or {}
    named = PhysicsModel(states, dict.fromkeys(states, 0), parameters, inputs)
    equations = _equations(rates, "rates", named, list(states), trace)
    seen: Mapping = {}
    if callable(outputs):
        seen = _equations(outputs, "outputs", named, None, trace)
    elif outputs is not None:
        seen = outputs
    return PhysicsModel(states, equations, parameters, inputs, seen, **more)


def _equations(function: Callable, what: str, named: PhysicsModel, names, trace):
    """Return the equations that a function computes, or those that call it."""
    if trace is False:
        return called_function(function, what, named, names).equations
    try:
        equations = _trace(function, what, named, names)
        _check(function, what, named, equations)
        return equations
    except ModelError as error:
        if trace is True:
            raise
        called = called_function(function, what, named, names)
        warn_user(
            f"{error} Until then the model calls the function, "
            f"{reading('how_called')(called.function)}. In Python a call takes "
            f"{1e6 * called.seconds:.2g} us, where an equation takes about {1e6 * WRITTEN:.1g} us. "
            f"Set trace=False to accept this.",
            ModelWarning,
        )
        return called.equations


def _trace(function: Callable, what: str, named: PhysicsModel, names) -> dict[str, sympy.Expr]:
    quantities = (Quantities.traced(list(part)) for part in _parts(named))
    try:
        found = by_name(function(Traced(TIME), *quantities), names)
        return {name: expression_of(value) for name, value in found.items()}
    except Exception as error:
        remedy = "" if isinstance(error, ModelError) else f" {_REMEDY}"
        said = " ".join(str(error).split()) or type(error).__name__
        raise ModelError(f"{what}{line_of(function, error)}: {said}{remedy}", (what,)) from error


def _parts(named: PhysicsModel) -> tuple[Mapping[str, Any], ...]:
    return named.states, named.inputs, named.parameters


def _check(function: Callable, what: str, named: PhysicsModel, equations: Mapping) -> None:
    """Raise `ModelError` if the results of the function differ from its equations."""
    rng = np.random.default_rng(0)
    for point in range(POINTS):
        t, numbers = float(rng.uniform()), _numbers(named, rng, positive=point % 2 == 0)
        with np.errstate(all="ignore"):
            found = by_name(function(t, *numbers), list(equations))
        names = [name for part in numbers for name in part.names]
        values = {symbol(n): sympy.Float(v) for n, v in zip(names, np.hstack(numbers), strict=True)}
        for name, value in found.items():
            written = _number(equations[name].xreplace(values | {TIME: sympy.Float(t)}))
            apart = abs(written - float(value))
            if math.isfinite(apart) and apart > NEAR * max(1.0, abs(written)):
                raise ModelError(
                    f"{what}: expected a function that returns the same values in every call, but "
                    f"{name!r} is {float(value):.9g}, and {written:.9g} by the traced equation, "
                    f"{equations[name]}. Remedy: no memory, no random numbers, and nothing that "
                    f"depends on the type of a number.",
                    (what,),
                )


def _numbers(named: PhysicsModel, rng, positive: bool) -> list[Quantities]:
    """Return random states and inputs, and the parameters."""
    x, u = (rng.normal(size=len(part)) for part in (named.states, named.inputs))
    if positive:
        x, u = np.abs(x), np.abs(u)
    p = [parameter.value for parameter in named.parameters.values()]
    return [Quantities.of(list(n), v) for n, v in zip(_parts(named), (x, u, p), strict=True)]


def _number(expression: sympy.Expr) -> float:
    try:
        return float(expression.evalf())
    except TypeError:  # no real number
        return math.nan
