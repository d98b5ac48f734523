"""A step to the minimum of a quadratic within bounds."""

import numpy as np
from numba import boolean, njit, types
from scipy.optimize import lsq_linear

from sklearn_pgnn.simulation.eigenvalues import diagonalise
from sklearn_pgnn.simulation.stepping import OPTIONS

#: curvature, relative to the sharpest, below which a direction is as good as flat
FLAT = 1e-14
#: least distance of a scaled bound: a step may always be none, rounding aside
ROOM = 1e-15

_F, _F1, _F2 = types.float64, types.float64[::1], types.float64[:, ::1]
_I1 = types.intp[::1]


def bounded_step(hessian, gradient, damping, low, high) -> np.ndarray:
    """Solve damped normal equations within bounds; parameters that nothing depends on stay.

    The Hessian is half the second derivatives of what is minimised, the gradient half its decrease
    by every parameter; `low` and `high` bound the step. With an infinite Levenberg-Marquardt
    damping nothing moves. Equations that are not finite raise `numpy.linalg.LinAlgError`.
    """
    step, squares = np.zeros_like(gradient), hessian.diagonal()
    seen = np.flatnonzero(squares > 0)
    if not seen.size or np.isinf(damping):
        return step
    size = np.sqrt(squares[seen])
    curvature, slope, found = np.empty((size.size, size.size)), gradient[seen] / size, size.copy()
    _scale(hessian, seen, size, damping, curvature)
    lower, upper = np.minimum(low[seen] * size, -ROOM), np.maximum(high[seen] * size, ROOM)
    if not _solve_within(curvature, slope, lower, upper, found):
        found = _solve_patiently(curvature, slope, lower, upper)
    if not np.isfinite(found).all():
        raise np.linalg.LinAlgError("the normal equations of a step are not finite")
    step[seen] = found / size
    return step


def _solve_patiently(curvature, slope, lower, upper) -> np.ndarray:
    """Return the solution within bounds by an algorithm that is slower, but cannot cycle."""
    values, vectors = np.linalg.eigh(curvature)
    root = np.sqrt(np.maximum(values, FLAT * values[-1]))
    matrix, target = root[:, None] * vectors.T, vectors.T @ slope / root
    return lsq_linear(matrix, target, bounds=(lower, upper), method="bvls").x


@njit(types.void(_F2, _I1, _F1, _F, _F2), **OPTIONS)
def _scale(hessian, seen, size, damping, curvature):
    """Fill the damped second derivatives by scaled columns; no direction is flatter than FLAT."""
    n = size.size
    scaled, vectors = np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            scaled[i, j] = hessian[seen[i], seen[j]] / (size[i] * size[j])
        scaled[i, i] += damping
    largest = diagonalise(scaled, vectors)
    for i in range(n):
        for j in range(n):
            curvature[i, j] = 0.0
            for k in range(n):
                value = max(scaled[k, k], FLAT * largest)
                curvature[i, j] += value * vectors[i, k] * vectors[j, k]


@njit(**OPTIONS)
def _solve_inside(curvature, slope, lower, upper, bound, x):
    """Fill the solution with some values at their bounds."""
    place = np.flatnonzero(bound == 0)
    inside, vectors = np.empty((place.size, place.size)), np.empty((place.size, place.size))
    right = np.empty(place.size)
    for j in range(x.size):
        x[j] = lower[j] if bound[j] < 0 else (upper[j] if bound[j] > 0 else 0.0)
    for i in range(place.size):
        right[i] = slope[place[i]]
        for j in range(x.size):
            right[i] -= curvature[place[i], j] * x[j]
        for k in range(place.size):
            inside[i, k] = curvature[place[i], place[k]]
    diagonalise(inside, vectors)
    for k in range(place.size):
        share = 0.0
        for i in range(place.size):
            share += vectors[i, k] * right[i] / inside[k, k]
        for i in range(place.size):
            x[place[i]] += share * vectors[i, k]


@njit(boolean(_F2, _F1, _F1, _F1, _F1), **OPTIONS)
def _solve_within(curvature, slope, lower, upper, x):
    """Fill the solution within bounds, and return whether it was found.

    The set of values at their bounds is improved until it satisfies the conditions of optimality.
    This takes few solutions, but may cycle.
    """
    n = x.size
    bound = np.zeros(n, np.int64)  # at which a value is: -1 or 1; inside: 0
    for _ in range(n + 1):
        _solve_inside(curvature, slope, lower, upper, bound, x)
        changed = False
        for j in range(n):
            left, before = slope[j], bound[j]
            for k in range(n):
                left -= curvature[j, k] * x[k]
            if before == 0:
                bound[j] = -1 if x[j] < lower[j] else (1 if x[j] > upper[j] else 0)
            elif before * left < 0.0:
                bound[j] = 0
            changed = changed or bound[j] != before
        if not changed:
            return True
    return False
