"""Fast construction of the largest and the smallest of several expressions."""

from collections.abc import Iterable

import sympy


def maximum(*values: sympy.Expr | float) -> sympy.Expr:
    """Return the largest of some values, without letting SymPy compare them.

    SymPy compares every pair by factoring their difference, which takes most of the time of
    a large equation. Here only equal values, and numbers, are merged.
    """
    return extreme(sympy.Max, values)


def minimum(*values: sympy.Expr | float) -> sympy.Expr:
    """Return the smallest of some values, see `maximum`."""
    return extreme(sympy.Min, values)


def bounded(value: sympy.Expr | float, limit: sympy.Expr | float) -> sympy.Expr:
    """Return a value, kept between minus a limit of at least 0 and the limit.

    >>> bounded(sympy.Symbol("x"), 1)
    Max(-1, Min(1, x))
    """
    return maximum(minimum(value, limit), -limit)


def extreme(kind: type[sympy.Max | sympy.Min], values: Iterable[sympy.Expr | float]) -> sympy.Expr:
    """Return the largest or the smallest of some values."""
    flat = [
        part
        for value in map(sympy.sympify, values)
        for part in (value.args if isinstance(value, kind) else (value,))
    ]
    numbers = [part for part in flat if part.is_comparable]
    others = [part for part in flat if not part.is_comparable]
    if numbers:
        others.append(kind(*numbers))
    return kind(*others, evaluate=False)
