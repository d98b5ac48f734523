"""A model's straight-line source as syntax trees, for targets that write it in another language.

The exported code is the code that the simulation compiles, operation by operation: nothing is
simplified or reordered, so that the same processor arithmetic gives the same numbers.
"""

import ast
from collections.abc import Iterable
from dataclasses import dataclass

from sklearn_pgnn.physics.external import require_equations
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.source import write_source


@dataclass(frozen=True)
class Assignments:
    """Results of a straight-line function, what they share in order, and names' places."""

    places: dict[str, tuple[str, int]]
    shared: dict[str, ast.expr]
    results: tuple[ast.expr, ...]

    @property
    def uses_time(self) -> bool:
        """Whether any expression contains the time."""
        return "t" in _names([*self.shared.values(), *self.results])

    @property
    def arrays(self) -> frozenset[str]:
        """The arguments that are read, among ``x``, ``u``, ``p`` and ``s``."""
        return frozenset(array for array, _ in self.places.values())


def rates_of(model: PhysicsModel) -> Assignments:
    """Return the assignments for a model's rates.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> ast.unparse(rates_of(lag).results[0])
    '(u0 - x0) / p0'
    """
    return _wanted(model, range(len(model.states)))


def outputs_of(model: PhysicsModel) -> Assignments:
    """Return the assignments for a model's outputs."""
    first = len(model.states)
    return _wanted(model, range(first, first + len(model.outputs)))


def rates_by_signs_of(model: PhysicsModel) -> Assignments:
    """Return the assignments for how the rates change with the signs of dry friction."""
    return _wanted(model, write_source(model).rates_by_signs)


def _wanted(model: PhysicsModel, which: range) -> Assignments:
    """Return the part of a model's function that some of its entries need."""
    require_equations(model, "export")
    places, shared, results = {}, {}, {}
    for line in ast.parse(write_source(model).text).body:
        (target,), value = line.targets, line.value  # type: ignore[attr-defined]
        if isinstance(target, ast.Subscript):
            results[target.slice.value] = value  # type: ignore[attr-defined]
        elif isinstance(value, ast.Subscript):
            places[target.id] = (value.value.id, value.slice.value)  # type: ignore[attr-defined]
        else:
            shared[target.id] = value
    kept = tuple(results[i] for i in which)
    needed = _names(kept)
    for name in reversed(shared):
        needed |= _names([shared[name]]) if name in needed else set()
    return Assignments(
        {name: place for name, place in places.items() if name in needed},
        {name: value for name, value in shared.items() if name in needed},
        kept,
    )


def _names(expressions: Iterable[ast.expr]) -> set[str]:
    """Return the names in expressions."""
    nodes = (node for expression in expressions for node in ast.walk(expression))
    return {node.id for node in nodes if isinstance(node, ast.Name)}
