"""A Python function that cannot be traced, as one that a model's equations call."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.external import (
    UNUSED,
    External,
    ExternalFunction,
    external,
    external_function,
    line_of,
    said_by,
)
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.traced import Quantities

#: points at which the dependences of a function are probed, from small numbers to large ones
POINTS, SMALLEST, LARGEST = 256, 1e-2, 1e3
#: how often a function is called again at a point, and the tolerance for its results
AGAIN, NEAR = 64, 1e-8
#: points at which a compiled function is compared with itself in Python
COMPARED = 32


@dataclass(frozen=True)
class NumericFunction:
    """A function of ``(t, x, u, p)`` as one of a tuple of numbers, finite at `points`."""

    function: Callable
    parts: tuple[tuple[str, ...], ...]
    names: tuple[str, ...] | None
    points: tuple[tuple[float, ...], ...] = ()

    def __call__(self, point: tuple[float, ...]) -> list[float]:
        """Return the function's results in order."""
        return [float(value) for value in self.found(point).values()]

    def found(self, point: tuple[float, ...]) -> dict:
        """Return the function's results by name."""
        return by_name(self.raw(point), self.names)

    def raw(self, point: tuple[float, ...]):
        """Return the function's return value."""
        n_x, n_u = (len(part) for part in self.parts[:2])
        states, inputs, parameters = self.parts
        return self.function(
            point[0],
            _quantities(states, point[1 : 1 + n_x]),
            _quantities(inputs, point[1 + n_x : 1 + n_x + n_u]),
            _quantities(parameters, point[1 + n_x + n_u :]),
        )


def _quantities(names, values) -> Quantities:
    """Return numbers with names; doing more would take half of a call's time."""
    found = np.array(values, dtype=float).view(Quantities)
    found.names = names
    return found


def by_name(found, names: Sequence[str] | None) -> dict:
    """Return a function's results by name; without `names` the function must name them.

    >>> by_name([1.0, 2.0], ["x", "v"])
    {'x': 1.0, 'v': 2.0}
    """
    if isinstance(found, Mapping):
        if names is not None and set(found) != set(names):
            raise ModelError(f"expected {', '.join(names)}, got {', '.join(map(str, found))}.")
        return {name: found[name] for name in names or found}
    if names is None:
        raise ModelError(f"expected a dict of outputs by name, got {type(found).__name__}.")
    if isinstance(found, list | tuple) and len(found) == len(names):
        return dict(zip(names, found, strict=True))
    values = np.ravel(np.asarray(found, dtype=object))
    if len(values) != len(names):
        raise ModelError(
            f"expected {len(names)} rates, of {', '.join(names)}, got {len(values)} values."
        )
    return dict(zip(names, values, strict=True))


@dataclass(frozen=True)
class Called:
    """The equations, by result, that call a function, and how long a call takes [s]."""

    equations: dict[str, sympy.Expr]
    seconds: float
    function: ExternalFunction


def called_function(
    function: Callable, what: str, named: PhysicsModel, names: Sequence[str] | None
) -> Called:
    """Return equations that call a function with what each result depends on at random points."""
    parts = (tuple(named.states), tuple(named.inputs), tuple(named.parameters))
    call = NumericFunction(function, parts, None if names is None else tuple(names))
    points = _points(named)
    results = tuple(_first(call, points, what))
    call = NumericFunction(function, parts, results)
    finite = (point for point in points if _values(call, point) is not None)
    call = replace(call, points=tuple(islice(finite, COMPARED)))
    return calling(call, what, named, results, points, _name(function))


def calling(
    call: Callable, what: str, named: PhysicsModel, results: Sequence[str], points, name: str
) -> Called:
    """Return equations that call a function of a tuple: t, states, inputs, parameters."""
    before = time.perf_counter()
    known = [(point, found) for point in points if (found := _values(call, point)) is not None]
    seconds = (time.perf_counter() - before) / len(points)
    if not known:
        raise _nothing(call, points[-1], what)
    _check_again(call, known, what, results)
    parameters = tuple(named.parameters)
    arguments = ("t", *named.states, *named.inputs, *parameters)
    outside = external_function(call, name, arguments, results, len(parameters))
    depends = dependences(call, known, len(arguments), len(results))
    equations = {
        result: _written(outside, place, depends[place], known, len(named.states))
        for place, result in enumerate(results)
    }
    return Called(equations, seconds, outside)


def equation_of(function: ExternalFunction, result: int, places: Sequence[int]) -> External:
    """Return the call of one result, with the quantities that it depends on."""
    quantities = [TIME, *map(symbol, function.arguments[1:])]
    return external(function, result, tuple(places))(*(quantities[place] for place in places))


def dependences(call, known, n_arguments: int, n_results: int) -> list[list[int]]:
    """Return for every result the arguments that it depends on.

    `known` are points with the results there. The arguments are those whose omission, or a change
    of whose value, changes the result at one of the points at least.

    >>> known = [((1.0, 2.0), [1.0]), ((2.0, 3.0), [2.0])]
    >>> dependences(lambda point: [point[0]], known, 2, 1)
    [[0]]
    """
    found: list[list[int]] = [[] for _ in range(n_results)]
    for place in range(n_arguments):
        open_ = set(range(n_results))
        for k, (point, values) in enumerate(known):
            for value in (UNUSED, known[k - 1][0][place]):
                other = _values(call, (*point[:place], value, *point[place + 1 :]), finite=False)
                open_ -= {r for r in open_ if other is None or other[r] != values[r]}
            if not open_:
                break
        for result in set(range(n_results)) - open_:
            found[result].append(place)
    return found


def _points(named: PhysicsModel) -> list[tuple[float, ...]]:
    """Return random points, every other one positive, with parameters near their own values."""
    rng = np.random.default_rng(0)
    n = len(named.states) + len(named.inputs)
    values = np.array([parameter.value for parameter in named.parameters.values()])
    points = []
    for k in range(POINTS):
        sizes = np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST), n))
        moved = sizes * rng.normal(size=n)
        near = np.where(values == 0, rng.normal(size=values.size), values)
        near = near * np.exp(0.3 * rng.normal(size=values.size)) if k % 4 >= 2 else values
        t = float(rng.uniform(0.0, 10.0))
        points.append((t, *(np.abs(moved) if k % 2 else moved).tolist(), *near.tolist()))
    return points


def _first(call: NumericFunction, points, what: str) -> dict[str, Any]:
    """Return the function's results at the first point at which there are any."""
    failed: Exception = ValueError()
    for point in points:
        try:
            found = call.found(point)
            for value in found.values():
                float(value)
            return found
        except ModelError as error:
            failed = error
            break
        except Exception as error:
            failed = error
    said = str(failed) if isinstance(failed, ModelError) else f"{said_by(failed)}."
    raise ModelError(f"{what}{line_of(call, failed)}: {said}", (what,)) from failed


def _nothing(call, point, what: str) -> ModelError:
    """Return the reason why a function computes no finite numbers anywhere."""
    try:
        failed = ""
        list(call(point))
    except Exception as error:
        failed = f" {said_by(error)}"
    return ModelError(
        f"{what}: expected finite numbers at one of {POINTS} points at least, got none.{failed}",
        (what,),
    )


def _values(call, point, finite: bool = True) -> list[float] | None:
    """Return the results at a point; None if there are none."""
    try:
        with np.errstate(all="ignore"):
            found = list(call(point))
    except Exception:
        return None
    return found if not finite or all(map(math.isfinite, found)) else None


def _check_again(call, known, what: str, results) -> None:
    """Raise `ModelError` if a second call at a point gives something else."""
    for point, values in reversed(known[:AGAIN]):  # behind another point than before
        again = _values(call, point) or [math.nan] * len(results)
        for name, one, other in zip(results, values, again, strict=True):
            if not abs(one - other) <= NEAR * max(1.0, abs(one)):
                raise ModelError(
                    f"{what}: expected a function that returns the same values in every call, but "
                    f"{name!r} is {one:.9g}, and {other:.9g} in a second call. Remedy: no memory "
                    f"and no random numbers.",
                    (what,),
                )


def _written(outside, place, depends, known, n_states):
    """Return the equation of a result: a state or a number, or else a call."""
    for state in range(1, 1 + n_states):
        if all(values[place] == point[state] for point, values in known):
            return symbol(outside.arguments[state])
    if not depends:
        return sympy.Float(known[0][1][place])
    return equation_of(outside, place, depends)


def _name(function) -> str:
    """Return the name of a function in an equation."""
    name = getattr(function, "__name__", type(function).__name__)
    return name if name.isidentifier() else "f"
