"""Units of expressions in a model's quantities."""

from collections import Counter
from collections.abc import Callable

import sympy


def unit_of(expression: sympy.Expr | None, unit: Callable[[str], str]) -> str:
    """Return the common unit of all quantities in a sum, a bound or a magnitude.

    Parameters
    ----------
    expression : sympy.Expr or None
        An expression of quantities.
    unit : callable
        Returns the unit of a quantity.

    Returns
    -------
    str
        Its unit; empty if it has none or the unit is unknown.

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


def unit_of_product(expression: sympy.Expr, unit: Callable[[str], str]) -> str:
    """Return the unit of a product of quantities and their powers.

    Parameters
    ----------
    expression : sympy.Expr
        An expression of quantities.
    unit : callable
        Returns the unit of a quantity.

    Returns
    -------
    str
        Its unit; empty if it is not such a product, if a power is not a positive integer, or if a
        unit is unknown or compound.

    Examples
    --------
    >>> m, l = sympy.symbols("m l")
    >>> units = {"m": "kg", "l": "m"}
    >>> unit_of_product(m * l**2, units.get), unit_of_product(2 * m, units.get)
    ('kg m^2', '')
    """
    powers: Counter[str] = Counter()
    for base, power in expression.as_powers_dict().items():
        known = unit(str(base)) if isinstance(base, sympy.Symbol) else ""
        if not (known and known.isalpha() and power.is_Integer and power > 0):
            return ""
        powers[known] += int(power)
    order = sorted(powers, key=lambda name: (powers[name], name))
    return " ".join(name if powers[name] == 1 else f"{name}^{powers[name]}" for name in order)


def _has_no_unit(factor: sympy.Expr) -> bool:
    """Return whether a factor is a sum with a number."""
    return isinstance(factor, sympy.Add) and any(part.is_number for part in factor.args)
