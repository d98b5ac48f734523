"""Units of expressions of a model's quantities."""

from collections.abc import Callable

import sympy


def unit_of(expression: sympy.Expr | None, unit: Callable[[str], str]) -> str:
    """Return the unit that all quantities in a sum, a bound or a magnitude have.

    Parameters
    ----------
    expression : sympy.Expr or None
        An expression of quantities.
    unit : callable
        Returns the unit of a quantity.

    Returns
    -------
    str
        Its unit; empty where it has none, or none is known.

    Examples
    --------
    >>> x, y = sympy.symbols("x y")
    >>> units = {"x": "m", "y": "m"}
    >>> unit_of(x + y, units.get), unit_of(x * y, units.get)
    ('m', '')
    """
    if isinstance(expression, sympy.Symbol):
        return unit(str(expression))
    if isinstance(expression, sympy.Mul):
        factors = [part for part in expression.args if not _has_no_unit(part)]
        return unit_of(factors[0], unit) if len(factors) == 1 else ""
    if not isinstance(expression, sympy.Add | sympy.Max | sympy.Min | sympy.Abs):
        return ""
    units = {unit_of(part, unit) for part in expression.args if not part.is_number}
    return units.pop() if len(units) == 1 else ""


def _has_no_unit(factor: sympy.Expr) -> bool:
    """Return whether a factor is a sum with a number."""
    return isinstance(factor, sympy.Add) and any(part.is_number for part in factor.args)
