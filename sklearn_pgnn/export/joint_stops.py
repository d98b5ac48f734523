"""The ends of a joint's travel that its equations say, read off the terms of its effort."""

from collections.abc import Mapping

import sympy

#: an end of the travel beyond which there is none
NOWHERE = 1e9
_ENDS = {sympy.Max: "upper", sympy.Min: "lower"}


def stop_in(factor: sympy.Expr, q: sympy.Symbol) -> tuple[str, float] | None:
    r"""Return which end :math:`\max(q - q_+, 0)` or :math:`\min(q - q_-, 0)` is of, and where.

    Examples
    --------
    >>> q = sympy.Symbol("q", real=True)
    >>> stop_in(sympy.Max(q - 0.5, 0), q), stop_in(sympy.Min(q + 2, 0), q), stop_in(q, q)
    (('upper', 0.5), ('lower', -2.0), None)
    """
    end = _ENDS.get(factor.func)
    others = [arg for arg in factor.args if arg != 0]
    if end is None or len(others) != 1 or len(factor.args) != 2:
        return None
    place = q - others[0]
    return (end, float(place)) if place.is_number else None


def ends_of(stops: Mapping[str, float], known: tuple[float, float] | None):
    """Return both ends of a travel, where the file gives one of them if need be; else None."""
    low, high = (None, None) if known is None else known
    ends = stops.get("lower", low), stops.get("upper", high)
    return None if None in ends else ends
