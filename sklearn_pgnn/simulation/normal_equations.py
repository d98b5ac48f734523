"""The normal equations of a fit to windows, initial states eliminated."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit, types

from sklearn_pgnn.simulation.eigenvalues import diagonalise
from sklearn_pgnn.simulation.stepping import APART, INNER, OPTIONS

if TYPE_CHECKING:
    from sklearn_pgnn.simulation.window_fit import WindowFit

#: relative rounding of a sum of products
SUM_ROUNDING = 1e-14
#: curvature of a window's initial state, which few samples determine, relative to the sharpest,
#: below which a direction is as good as flat
FLAT_START = 1e-12
#: pivot of a matrix with a unit diagonal from which on its inverse needs no eigenvalues: these take
#: many times as long
SOUND_PIVOT = 1e-6

_F1, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]


class Normal(NamedTuple):
    """Normal equations of the parameters with the initial states projected out, per window."""

    hessian: np.ndarray
    gradient: np.ndarray
    to_state: np.ndarray
    state_step: np.ndarray


@njit(**INNER)
def _length(square):
    """Return the norm of a column, one for one that is zero."""
    return math.sqrt(square) if square > 0.0 else 1.0


@njit(**APART)
def _scale(products, n_p, weight, damping, scaled, size):
    """Fill the products of the state's columns, scaled to length one, and their lengths."""
    for i in range(size.size):
        size[i] = _length(products[n_p + i, n_p + i] + weight[i])
    for i in range(size.size):
        for j in range(size.size):
            prior = weight[i] if i == j else 0.0
            scaled[i, j] = (products[n_p + i, n_p + j] + prior) / (size[i] * size[j])
        scaled[i, i] += damping


@njit(**APART)
def _is_factorised(scaled, factor):
    """Fill the inverse of Cholesky's factor; return whether every pivot is far from zero."""
    n = scaled.shape[0]
    for i in range(n):
        for j in range(i):
            total = scaled[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = total * factor[j, j]
        pivot = scaled[i, i]
        for k in range(i):
            pivot -= factor[i, k] ** 2
        if not pivot > SOUND_PIVOT:
            return False
        factor[i, i] = 1.0 / math.sqrt(pivot)
    for j in range(n):
        for i in range(j + 1, n):
            total = 0.0
            for k in range(j, i):
                total -= factor[i, k] * factor[k, j]
            factor[i, j] = total * factor[i, i]
    return True


@njit(**APART)
def _multiply_out(factor, size, inverse):
    """Fill the inverse of a matrix from that of Cholesky's factor, the scale taken off."""
    n = size.size
    for i in range(n):
        for j in range(n):
            inverse[i, j] = 0.0
    for k in range(n):
        for i in range(k + 1):
            for j in range(k + 1):
                inverse[i, j] += factor[k, i] * factor[k, j]
    for i in range(n):
        for j in range(n):
            inverse[i, j] /= size[i] * size[j]


@njit(**APART)
def _invert(scaled, size, vectors, inverse):
    """Fill the pseudoinverse of a matrix that is given scaled, and is overwritten."""
    if _is_factorised(scaled, vectors):
        _multiply_out(vectors, size, inverse)
        return
    largest = diagonalise(scaled, vectors)
    for i in range(size.size):
        for j in range(size.size):
            inverse[i, j] = 0.0
            for k in range(size.size):
                if scaled[k, k] > FLAT_START * largest:
                    inverse[i, j] += vectors[i, k] * vectors[j, k] / scaled[k, k]
            inverse[i, j] /= size[i] * size[j]


@njit(**APART)
def _answer(products, inverse, weight, offset, to_state, state_step):
    """Fill what the state answers to the columns of the parameters and to the residual."""
    n_x, n_p = to_state.shape
    for i in range(n_x):
        state_step[i] = 0.0
        for a in range(n_p):
            to_state[i, a] = 0.0
        for j in range(n_x):
            state_step[i] += inverse[i, j] * (products[n_p + j, -1] - weight[j] * offset[j])
            for a in range(n_p):
                to_state[i, a] += inverse[i, j] * products[n_p + j, a]


@njit(**APART)
def _eliminate(products, size, to_state, state_step, hessian, gradient):
    """Fill a window's normal equations without its state; what is mere rounding becomes zero."""
    n_x, n_p = to_state.shape
    for a in range(n_p):
        gradient[a] = products[a, -1]
        for b in range(n_p):
            hessian[a, b] = products[a, b]
        for i in range(n_x):
            gradient[a] -= products[a, n_p + i] * state_step[i]
            for b in range(n_p):
                hessian[a, b] -= products[a, n_p + i] * to_state[i, b]
    for a in range(n_p):
        answer = 1.0
        for i in range(n_x):
            answer += abs(to_state[i, a]) * size[i] / _length(products[a, a])
        if not hessian[a, a] > SUM_ROUNDING * answer**2 * products[a, a]:
            gradient[a] = 0.0
            for b in range(n_p):
                hessian[a, b] = hessian[b, a] = 0.0


@njit(types.void(_F3, _F1, _F2, _F1, _F3, _F2, _F3, _F2), **OPTIONS)
def _project(gram, weight, offset, damping, hessian, gradient, to_state, state_step):
    """Fill the normal equations of every window, see `project`."""
    n_p, n_x = gradient.shape[1], weight.size
    scaled, vectors = np.empty((n_x, n_x)), np.empty((n_x, n_x))
    inverse, size = np.empty((n_x, n_x)), np.empty(n_x)
    for w in range(gram.shape[0]):
        _scale(gram[w], n_p, weight, damping[w], scaled, size)
        _invert(scaled, size, vectors, inverse)
        _answer(gram[w], inverse, weight, offset[w], to_state[w], state_step[w])
        _eliminate(gram[w], size, to_state[w], state_step[w], hessian[w], gradient[w])


def project(
    gram: np.ndarray,
    n_p: int,
    weight: np.ndarray,
    offset: np.ndarray,
    damping: np.ndarray | float = 0.0,
) -> Normal:
    r"""Eliminate every window's initial state from its normal equations.

    With all columns scaled to length one, the part of a parameter's column that the initial state
    does not explain has the square :math:`1 - c^T W`, where :math:`c` are its products with the
    columns of the state and :math:`W` the state's answer. It carries a rounding of
    :math:`\rho (1 + \sum_i |W_i|)^2` if the products carry one of :math:`\rho`. A square not larger
    than that counts as zero: such a window does not depend on the parameter.
    """
    n, n_x = len(gram), weight.size
    damped = np.full(n, damping, dtype=float)
    normal = Normal(
        np.empty((n, n_p, n_p)), np.empty((n, n_p)), np.empty((n, n_x, n_p)), np.empty((n, n_x))
    )
    _project(gram, weight, offset, damped, *normal)
    return normal


@njit(types.void(_F3, _F1, _F2, _F3, _F2, _F1, _F2, _F1), **OPTIONS)
def _follow(gram, weight, offset, to_state, state_step, by_p, by_x, decrease):
    """Fill the changes of the initial states and the decrease of every window, see `follow`."""
    n_p, n_x = by_p.size, weight.size
    by = np.empty(n_p + n_x)
    for a in range(n_p):
        by[a] = by_p[a]
    for w in range(gram.shape[0]):
        decrease[w] = 0.0
        for i in range(n_x):
            change = state_step[w, i]
            for a in range(n_p):
                change -= to_state[w, i, a] * by_p[a]
            by[n_p + i] = by_x[w, i] = change
            decrease[w] -= weight[i] * change * (2.0 * offset[w, i] + change)
        for i in range(by.size):
            slope = 2.0 * gram[w, i, -1]
            for j in range(by.size):
                slope -= gram[w, i, j] * by[j]
            decrease[w] += by[i] * slope


def follow(
    gram: np.ndarray, normal: Normal, weight: np.ndarray, offset: np.ndarray, by_p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how initial states follow the parameters, and what a linear model gains by that."""
    by_x, decrease = np.empty_like(offset), np.empty(len(gram))
    _follow(gram, weight, offset, normal.to_state, normal.state_step, by_p, by_x, decrease)
    return by_x, decrease


def normal_equations(fit: "WindowFit", expected: np.ndarray, spread: np.ndarray) -> Normal:
    """Return the normal equations of a fit's parameters, initial states projected out."""
    return project(fit.evaluation.gram, len(fit.freedoms), 1.0 / spread**2, fit.x0 - expected)
