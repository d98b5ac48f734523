"""The terms from which a formula for a missing part may be built."""

from collections.abc import Iterable
from itertools import combinations

import sympy

from sklearn_pgnn.physics.effects.rates import is_velocity
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel


def term_library(model: PhysicsModel, quantities: Iterable[str]) -> list[sympy.Expr]:
    """Return functions of one quantity, and products of functions of two.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y"})
    >>> term_library(lag, ["y"])
    [1, y, Abs(y), y**2, y*Abs(y), y**3]
    """
    single = [_functions(model, name) for name in quantities]
    found = [sympy.Integer(1), *(term for functions in single for term in functions)]
    for one, other in combinations(single, 2):
        found += [a * b for a in one for b in other]
    return list(dict.fromkeys(found))


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
