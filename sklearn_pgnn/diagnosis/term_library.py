"""The terms from which a formula for a missing part may be built."""

from collections.abc import Container, Iterable, Mapping
from itertools import combinations

import numpy as np
import sympy

from sklearn_pgnn.estimation.budgets import MOST_QUANTITIES, SAMPLES
from sklearn_pgnn.physics.effects.rates import is_velocity
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import evaluate_samples


def term_library(
    model: PhysicsModel, quantities: Iterable[str], leading: Container[str] | None = None
) -> list[sympy.Expr]:
    """Return functions of one quantity, and products of functions of two, of the leading ones.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y"})
    >>> term_library(lag, ["y"])
    [1, y, Abs(y), y**2, y*Abs(y), y**3]
    """
    single = {name: _functions(model, name) for name in quantities}
    found = [sympy.Integer(1), *(term for functions in single.values() for term in functions)]
    joined = (of for name, of in single.items() if leading is None or name in leading)
    for one, other in combinations(joined, 2):
        found += [a * b for a in one for b in other]
    return list(dict.fromkeys(found))


def leading_quantities(
    model: PhysicsModel, table: Mapping[str, np.ndarray], hidden: np.ndarray
) -> list[str]:
    """Return the quantities whose own functions explain most of a hidden input.

    Products of all pairs of many quantities are more than records of any length can tell apart.
    """
    if len(table) <= MOST_QUANTITIES:
        return list(table)
    some = slice(None, None, max(1, hidden.size // SAMPLES))
    sought = hidden[some] - hidden[some].mean()

    def left(name: str) -> float:
        known = {name: table[name][some]}
        terms = [sympy.Integer(1), *_functions(model, name)]
        columns = np.column_stack([evaluate_samples(e, known, sought.size) for e in terms])
        columns = columns / np.maximum(np.abs(columns).max(axis=0), np.finfo(float).tiny)
        rest = sought - columns @ np.linalg.lstsq(columns, sought)[0]
        return float(rest @ rest)

    return sorted(table, key=left)[:MOST_QUANTITIES]


def _functions(model, name) -> list[sympy.Expr]:
    """Return functions of one quantity."""
    if name == "t":
        return [TIME]
    q = symbol(name)
    found = [q, sympy.Abs(q), q**2, q * sympy.Abs(q), q**3]
    if name in model.states and is_velocity(model, name):
        found.append(sympy.sign(q))
    if model.unit(name) == "rad":
        found += [sympy.sin(q), sympy.cos(q), sympy.sin(2 * q), sympy.cos(2 * q)]
    return found
