"""A step to the minimum of a quadratic within bounds."""

import math

import numpy as np
from numba import boolean, njit, types
from scipy.optimize import lsq_linear

from sklearn_pgnn.simulation.small_matrices import diagonalise, solve_least_squares
from sklearn_pgnn.simulation.stepping import APART, OPTIONS

#: curvature, relative to the sharpest, below which a direction is as good as flat
FLAT = 1e-14
#: least distance of a scaled bound: a step may always be none, rounding aside
ROOM = 1e-15

_F, _F1, _F2 = types.float64, types.float64[::1], types.float64[:, ::1]
_I1 = types.intp[::1]


def bounded_step(hessian, gradient, damping, low, high) -> np.ndarray:
    """Solve damped normal equations within bounds; parameters that nothing depends on stay.

    Parameters
    ----------
    hessian : ndarray of shape (n, n)
        Half the second derivatives of what is minimised.
    gradient : ndarray of shape (n,)
        Half its decrease by every parameter.
    damping : float
        Levenberg-Marquardt damping; infinite if nothing is to move.
    low, high : ndarray of shape (n,)
        Bounds of the step.

    Returns
    -------
    ndarray of shape (n,)
        The step.

    Examples
    --------
    >>> far = np.full(2, np.inf)
    >>> bounded_step(np.eye(2), np.array([1.0, 3.0]), 0.0, -far, np.array([np.inf, 2.0]))
    array([1., 2.])
    """
    step, squares = np.zeros_like(gradient), hessian.diagonal()
    seen = np.flatnonzero(squares > 0)
    if not seen.size or np.isinf(damping):
        return step
    size = np.sqrt(squares[seen])
    matrix, target, found = np.empty((size.size, size.size)), np.empty_like(size), size.copy()
    _to_least_squares(hessian, gradient, seen, size, damping, matrix, target)
    lower, upper = np.minimum(low[seen] * size, -ROOM), np.maximum(high[seen] * size, ROOM)
    if not _solve_within(matrix, target, lower, upper, found):  # slower, but it cannot cycle
        found = lsq_linear(matrix, target, bounds=(lower, upper), method="bvls").x
    step[seen] = found / size
    return step


@njit(types.void(_F2, _F1, _I1, _F1, _F, _F2, _F1), **OPTIONS)
def _to_least_squares(hessian, gradient, seen, size, damping, matrix, target):
    """Fill the least-squares problem of damped normal equations, some columns scaled.

    No direction counts as flatter than FLAT.
    """
    n, largest = size.size, 0.0
    scaled, vectors = np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            scaled[i, j] = hessian[seen[i], seen[j]] / (size[i] * size[j])
        scaled[i, i] += damping
    diagonalise(scaled, vectors)
    for k in range(n):
        largest = max(largest, scaled[k, k])
    for k in range(n):
        root = math.sqrt(max(scaled[k, k], FLAT * largest))
        target[k] = 0.0
        for i in range(n):
            target[k] += vectors[i, k] * gradient[seen[i]] / size[i] / root
            matrix[k, i] = root * vectors[i, k]


@njit(**APART)
def _left(matrix, target, x, left):
    """Fill what a solution leaves of the target."""
    for i in range(x.size):
        left[i] = target[i]
        for j in range(x.size):
            left[i] -= matrix[i, j] * x[j]


@njit(**APART)
def _set_inside(matrix, target, lower, upper, bound, columns, left, inside, x):
    """Fill the solution of which some values are at their bounds."""
    count = 0
    for j in range(x.size):
        x[j] = lower[j] if bound[j] < 0 else (upper[j] if bound[j] > 0 else 0.0)
        if bound[j] == 0:
            for i in range(x.size):
                columns[i, count] = matrix[i, j]
            count += 1
    _left(matrix, target, x, left)
    solve_least_squares(columns, left, inside, count)
    for j in range(x.size - 1, -1, -1):
        if bound[j] == 0:
            count -= 1
            x[j] = inside[count]


@njit(**APART)
def _change_bounds(matrix, left, lower, upper, x, bound):
    """Free values that are held back, hold those beyond a bound; return whether any changed."""
    changed = False
    for j in range(x.size):
        slope, before = 0.0, bound[j]
        for i in range(x.size):
            slope += matrix[i, j] * left[i]
        if before == 0:
            bound[j] = -1 if x[j] < lower[j] else (1 if x[j] > upper[j] else 0)
        elif before * slope < 0.0:
            bound[j] = 0
        changed = changed or bound[j] != before
    return changed


@njit(boolean(_F2, _F1, _F1, _F1, _F1), **OPTIONS)
def _solve_within(matrix, target, lower, upper, x):
    """Fill the least-squares solution within bounds, and return whether it was found.

    The set of values at their bounds is improved until it satisfies the conditions of optimality.
    This takes few solutions, but may cycle.
    """
    n = x.size
    bound, left = np.zeros(n, np.int64), np.empty(n)  # at which bound: -1, 1; inside: 0
    columns, inside = np.empty((n, n)), np.empty(n)
    for _ in range(n + 1):
        _set_inside(matrix, target, lower, upper, bound, columns, left, inside, x)
        _left(matrix, target, x, left)
        if not _change_bounds(matrix, left, lower, upper, x, bound):
            return True
    return False
