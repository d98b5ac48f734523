"""Inverse mass matrices as expressions: their signs, and those of a kinetic energy."""

from collections.abc import Collection, Mapping
from functools import lru_cache

import numpy as np
import sympy

#: states and parameters are drawn anew so often to tell a sign
DRAWS = 24
#: range of states: every angle, and a bit of everything else
RANGE = np.pi
#: parameters are drawn within this share of their values
NEAR = 0.1
#: most velocities, and most operations in a mass matrix, for which it is inverted
MOST_VELOCITIES, MOST_OPERATIONS = 4, 400


def always_positive(
    expression: sympy.Expr,
    parameters: Mapping[sympy.Symbol, float],
    states: Collection[sympy.Symbol],
) -> bool:
    """Return whether an expression is positive at all states that are drawn.

    Examples
    --------
    >>> m, q = sympy.symbols("m q", real=True)
    >>> [always_positive(each, {m: 2.0}, {q}) for each in (1 / (m + sympy.sin(q)), sympy.cos(q))]
    [True, False]
    """
    rng = np.random.default_rng(0)
    signs = [_sign(expression, parameters, states, rng) for _ in range(DRAWS)]
    known = [sign for sign in signs if np.isfinite(sign)]
    return 2 * len(known) >= DRAWS and min(known) > 0


def _sign(expression, parameters, states, rng: np.random.Generator) -> float:
    point = {p: value * (1 + NEAR * rng.uniform(-1, 1)) for p, value in parameters.items()}
    point |= {s: RANGE * rng.uniform(-1, 1) for s in sorted(states, key=str)}
    values = {s: sympy.Float(point.get(s, 1.0)) for s in expression.free_symbols}
    try:
        return float(np.sign(float(expression.xreplace(values))))
    except (TypeError, ValueError):  # not real there
        return np.nan


@lru_cache(maxsize=64)
def inverse_masses(
    energy: sympy.Expr, velocities: tuple[sympy.Symbol, ...]
) -> dict[sympy.Symbol, dict[sympy.Symbol, sympy.Expr]]:
    r"""Return the columns of the inverse of :math:`\partial^2 E/\partial v_i \partial v_j`.

    There is none where the energy is not quadratic in the velocities, or too long.
    """
    moving = tuple(v for v in velocities if energy.has(v))
    if not 0 < len(moving) <= MOST_VELOCITIES or energy.count_ops() > MOST_OPERATIONS:
        return {}
    mass = sympy.hessian(energy, moving).applyfunc(sympy.expand)
    if mass.free_symbols & set(moving) or sum(each.count_ops() for each in mass) > MOST_OPERATIONS:
        return {}
    size = sympy.factor_terms(mass.det())
    if size == 0:
        return {}
    inverse = mass.adjugate().applyfunc(lambda above: sympy.factor_terms(above) / size)
    return {v: dict(zip(moving, inverse[:, i], strict=True)) for i, v in enumerate(moving)}
