"""An expression with a sign, a dead zone or a limit, case by case."""

import sympy

from sklearn_pgnn.physics.expansion import expanded


def cases_of(expression: sympy.Expr, moving) -> list[tuple[sympy.Expr, sympy.Expr]]:
    """Return what an expression is in each case, where it has cases of one kind.

    `moving` are states, inputs and the time; all else are numbers. Return values and conditions,
    the last condition being true where it is all other cases; nothing where the expression has no
    cases, or of several kinds.
    """
    return _by_sign(expression) or _by_dead_zone(expression) or _by_limits(expression, set(moving))


def _by_sign(expression):
    """Return the cases of a direction of motion."""
    about = {part.args[0] for part in expression.atoms(sympy.sign)}
    if len(about) != 1 or expression.has(sympy.Max, sympy.Min):
        return []
    (of,) = about
    cases = []
    for sign, condition in ((1, of > 0), (-1, of < 0)):
        value = expression.subs({sympy.sign(of): sign, sympy.Abs(of): sign * of})
        cases.append((expanded(value), condition))
    return cases


def _by_dead_zone(expression):
    """Return the cases of what acts above one end and below another."""
    above = [part for part in expression.atoms(sympy.Max) if sympy.S.Zero in part.args]
    below = [part for part in expression.atoms(sympy.Min) if sympy.S.Zero in part.args]
    if len(above) != 1 or len(below) != 1 or len(expression.atoms(sympy.Max, sympy.Min)) != 2:
        return []
    (top,), (bottom,) = above, below
    over, under = _other(top, sympy.S.Zero), _other(bottom, sympy.S.Zero)
    return [
        (expression.xreplace({top: over, bottom: sympy.S.Zero}), over > 0),
        (expression.xreplace({top: sympy.S.Zero, bottom: under}), under < 0),
        (expression.xreplace({top: sympy.S.Zero, bottom: sympy.S.Zero}), sympy.true),
    ]


def _by_limits(expression, moving):
    """Return the cases of what stays between two ends."""
    parts = expression.atoms(sympy.Max, sympy.Min)
    outer = [part for part in parts if _inner(part) is not None]
    if len(outer) != 1 or len(parts) != 2:
        return []
    (whole,), inner = outer, _inner(outer[0])
    end = _other(whole, inner)
    free = [arg for arg in inner.args if arg.free_symbols & moving]
    if len(free) != 1:
        return []
    (value,), other = free, _other(inner, free[0])
    low, high = (end, other) if isinstance(whole, sympy.Max) else (other, end)
    return [
        (expression.xreplace({whole: high}), value > high),
        (expression.xreplace({whole: low}), value < low),
        (expression.xreplace({whole: value}), sympy.true),
    ]


def _other(part, one):
    """Return the other argument of two."""
    return next(arg for arg in part.args if arg != one)


def _inner(part):
    """Return the limit inside a limit of the other kind; None where there is none."""
    kind = sympy.Min if isinstance(part, sympy.Max) else sympy.Max
    found = [arg for arg in part.args if isinstance(arg, kind)]
    return found[0] if len(found) == 1 and len(part.args) == 2 == len(found[0].args) else None
