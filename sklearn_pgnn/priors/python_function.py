"""A function in Python as a model: it is called once with symbols, which write its equations."""

import math
import traceback
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.traced import Quantities, Traced, expression_of

_REMEDY = "Remedy: arithmetic and functions of numpy on the elements of x, u and p."
#: points at which the equations are held against the function, and how near they must be
POINTS, NEAR = 8, 1e-8


def from_function(
    rates: Callable,
    states: Mapping[str, str],
    *,
    inputs: Mapping[str, str] | None = None,
    parameters=None,
    outputs: Callable | Mapping | None = None,
    **more,
) -> PhysicsModel:
    r"""Return a model whose equations a function in Python computes.

    .. math:: \dot x = f(t, x, u, p), \qquad y = g(t, x, u, p)

    The functions are called once, with symbols in place of numbers, and the model has the equations
    that they compute: it is compiled, extended and exported like any other. At some points the
    equations are held against the functions.

    Parameters
    ----------
    rates : callable
        ``f(t, x, u, p)``, the rates in the order of the states, or by name; arithmetic and
        functions of numpy, ``np.where`` among them. ``x``, ``u`` and ``p`` are arrays, whose
        elements have names, too: ``p["mass"]``.
    states : mapping of str to str
        State names and their units, in order.
    inputs : mapping of str to str, optional
        Input names and their units.
    parameters : mapping of str to Parameter, dict or float, optional
        The constants, as `PhysicsModel` takes them.
    outputs : callable or mapping, optional
        ``g(t, x, u, p)``, which returns a dict of values by output name, or texts as `PhysicsModel`
        takes them; by default every state under its own name.
    **more
        What else `PhysicsModel` takes: ``name``, ``inertia``, ``simulation`` and so on.

    Returns
    -------
    PhysicsModel
        The model.

    Raises
    ------
    ModelError
        If a function branches on a value, calls what cannot be followed (``math.sin``, an
        interpolation, a solver), or does not compute the same each time; with the line.

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
    """
    inputs, parameters = dict(inputs or {}), parameters or {}
    named = PhysicsModel(states, dict.fromkeys(states, 0), parameters, inputs)
    equations = _trace(rates, "rates", named, list(states))
    _check(rates, "rates", named, equations)
    seen: Mapping = {}
    if callable(outputs):
        seen = _trace(outputs, "outputs", named, None)
        _check(outputs, "outputs", named, seen)
    elif outputs is not None:
        seen = outputs
    return PhysicsModel(states, equations, parameters, inputs, seen, **more)


def _trace(function: Callable, what: str, named: PhysicsModel, names) -> dict[str, sympy.Expr]:
    quantities = (Quantities.traced(list(part)) for part in _parts(named))
    try:
        found = _by_name(function(Traced(TIME), *quantities), names)
        return {name: expression_of(value) for name, value in found.items()}
    except Exception as error:
        remedy = "" if isinstance(error, ModelError) else f" {_REMEDY}"
        said = " ".join(str(error).split()) or type(error).__name__
        raise ModelError(f"{what}{_line(function, error)}: {said}{remedy}", (what,)) from error


def _line(function: Callable, error: Exception) -> str:
    """Return the line of the function's file in which an error came up."""
    code = getattr(function, "__code__", None)
    frames = traceback.extract_tb(error.__traceback__)
    lines = [f.lineno for f in frames if code is not None and f.filename == code.co_filename]
    return f", line {lines[-1]}" if lines else ""


def _parts(named: PhysicsModel) -> tuple[Mapping[str, Any], ...]:
    return named.states, named.inputs, named.parameters


def _by_name(found, names) -> dict:
    """Return what a function computes by name; without names it must say them itself."""
    if isinstance(found, Mapping):
        if names is not None and set(found) != set(names):
            raise ModelError(f"expected {', '.join(names)}, got {', '.join(map(str, found))}.")
        return {name: found[name] for name in names or found}
    if names is None:
        raise ModelError(f"expected a dict of outputs by name, got {type(found).__name__}.")
    values = np.ravel(np.asarray(found, dtype=object))
    if len(values) != len(names):
        raise ModelError(
            f"expected {len(names)} rates, of {', '.join(names)}, got {len(values)} values."
        )
    return dict(zip(names, values, strict=True))


def _check(function: Callable, what: str, named: PhysicsModel, equations: Mapping) -> None:
    """Raise `ModelError` if the function gives other numbers than its equations."""
    rng = np.random.default_rng(0)
    for point in range(POINTS):
        t, numbers = float(rng.uniform()), _numbers(named, rng, positive=point % 2 == 0)
        with np.errstate(all="ignore"):
            found = _by_name(function(t, *numbers), list(equations))
        names = [name for part in numbers for name in part.names]
        values = {symbol(n): sympy.Float(v) for n, v in zip(names, np.hstack(numbers), strict=True)}
        for name, value in found.items():
            written = _number(equations[name].xreplace(values | {TIME: sympy.Float(t)}))
            apart = abs(written - float(value))
            if math.isfinite(apart) and apart > NEAR * max(1.0, abs(written)):
                raise ModelError(
                    f"{what}: expected a function that computes the same at every call, but "
                    f"{name!r} is {float(value):.9g}, and {written:.9g} by the equation that it "
                    f"wrote, {equations[name]}. Remedy: no memory, no random numbers, and nothing "
                    f"that depends on the type of a number.",
                    (what,),
                )


def _numbers(named: PhysicsModel, rng, positive: bool) -> list[Quantities]:
    """Return states and inputs by chance, and the parameters."""
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
