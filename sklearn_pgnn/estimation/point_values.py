"""Expressions at a few points, all points at once; SymPy is used where floating point fails."""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce

import numpy as np
import sympy

from sklearn_pgnn.physics.external import External

Value = float | np.ndarray | None


def values_at(
    expressions: Sequence[sympy.Expr], points: Mapping[sympy.Symbol, np.ndarray | float], count: int
) -> np.ndarray:
    """Evaluate expressions at points."""
    at = {s: np.broadcast_to(np.asarray(v, dtype=float), (count,)) for s, v in points.items()}
    known, values = dict(at), np.full((len(expressions), count), np.nan)
    for row, expression in zip(values, expressions, strict=True):
        with np.errstate(all="ignore"):
            found = _evaluate(expression, known)
        row[:] = np.nan if found is None else found
        for place in np.flatnonzero(~np.isfinite(row)):
            point = {s: sympy.Float(float(v[place])) for s, v in at.items()}
            row[place] = number_at(expression, point)
    return values


def number_at(expression: sympy.Expr, point: Mapping[sympy.Symbol, sympy.Float]) -> float:
    """Evaluate an expression at a point by SymPy; NaN where it is undefined."""
    try:
        return float(expression.xreplace(point))
    except (TypeError, ValueError):  # not real there, or compared so, or a derivative of a jump
        return np.nan


def _evaluate(expression: sympy.Basic, known: dict[sympy.Basic, Value]) -> Value:
    """Evaluate an expression of functions in the table or outside, once; None for any other."""
    if expression in known:
        return known[expression]
    if not expression.args:
        return float(expression) if expression.is_Number or expression.is_NumberSymbol else None
    values, kind = [_evaluate(part, known) for part in expression.args], type(expression)
    function = kind._imp_ if issubclass(kind, External) else _FUNCTIONS.get(kind)
    are_known = all(value is not None for value in values)
    known[expression] = function(*values) if function is not None and are_known else None
    return known[expression]


def _chain(of: Callable) -> Callable:
    return lambda *values: reduce(of, values)


def _beside_zero(value: Callable) -> Callable:
    """Return a function for all numbers but zero, at which SymPy is used."""
    return lambda z, *_: np.where(z == 0, np.nan, value(z))


_FUNCTIONS: dict[type, Callable] = {
    sympy.Add: _chain(np.add),
    sympy.Mul: _chain(np.multiply),
    sympy.Pow: np.power,
    sympy.Max: _chain(np.maximum),
    sympy.Min: _chain(np.minimum),
    sympy.Abs: np.abs,
    sympy.sign: np.sign,
    sympy.exp: np.exp,
    sympy.log: np.log,
    sympy.sin: np.sin,
    sympy.cos: np.cos,
    sympy.tan: np.tan,
    sympy.sinh: np.sinh,
    sympy.cosh: np.cosh,
    sympy.tanh: np.tanh,
    sympy.atan: np.arctan,
    sympy.floor: np.floor,
    sympy.ceiling: np.ceil,
    sympy.DiracDelta: _beside_zero(np.zeros_like),
    sympy.Heaviside: _beside_zero(lambda z: 1.0 * (z > 0)),
}
