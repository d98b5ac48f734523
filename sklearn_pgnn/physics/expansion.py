"""Expressions multiplied out, where that does not take a lot of memory and time."""

from math import comb, prod

import sympy

#: most terms that an expression may have when it is multiplied out
MAX_TERMS = 2000


def expanded(expression: sympy.Expr, **hints: bool) -> sympy.Expr:
    """Return `sympy.expand` of an expression; the expression itself beyond `MAX_TERMS` terms."""
    return sympy.expand(expression, **hints) if _work(expression) <= MAX_TERMS else expression


def _work(expression: sympy.Expr) -> int:
    """Return a bound of all terms that are written when an expression is multiplied out."""
    inside = sum(_work(each) for each in expression.args if not each.is_Atom)
    return max(_terms(expression), inside)


def _terms(expression: sympy.Expr) -> int:
    r"""Return a bound of the terms: :math:`\binom{n + k - 1}{n}` of the n-th power of k terms."""
    if expression.is_Add:
        return sum(map(_terms, expression.args))
    if expression.is_Mul:
        return prod(map(_terms, expression.args))
    if expression.is_Pow and expression.exp.is_number:
        power, terms = int(abs(expression.exp)), _terms(expression.base)
        return comb(power + terms - 1, power) if terms <= MAX_TERMS else terms
    return 1
