"""The normal equations of a fit to windows: initial states eliminated, and solved within bounds."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import lsq_linear

if TYPE_CHECKING:
    from sklearn_pgnn.simulation.window_fit import WindowFit

#: relative rounding of a sum of products, and the curvature, relative to the sharpest, below which
#: a direction is as good as flat
SUM_ROUNDING, FLAT = 1e-14, 1e-14
#: the same for a window's initial state, which few samples determine
FLAT_START = 1e-12


@dataclass(frozen=True)
class Normal:
    """Normal equations of the parameters with the initial states projected out, per window."""

    hessian: np.ndarray
    gradient: np.ndarray
    to_state: np.ndarray
    state_step: np.ndarray


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

    Parameters
    ----------
    gram : ndarray of shape (n_windows, q + 1, q + 1)
        Products of the columns ``[dy/dp, dy/dx0, residual]``.
    n_p : int
        Number of parameters.
    weight : ndarray of shape (n_states,)
        Inverse variances of the initial states.
    offset : ndarray of shape (n_windows, n_states)
        Initial states minus their expectation.
    damping : float or ndarray of shape (n_windows,), default=0
        Levenberg-Marquardt damping of the initial states.

    Returns
    -------
    Normal
        Hessian and gradient per window, and how the initial states follow the parameters.
    """
    p, x = slice(0, n_p), slice(n_p, gram.shape[1] - 1)
    state_hessian = gram[:, x, x] + np.diag(weight)
    state_gradient = gram[:, x, -1] - weight * offset
    size = _length(np.einsum("wii->wi", state_hessian))
    scaled = state_hessian / (size[:, :, None] * size[:, None, :])
    scaled = scaled + np.asarray(damping)[..., None, None] * np.eye(size.shape[1])
    inverse = _inverse(scaled) / (size[:, :, None] * size[:, None, :])
    to_state = inverse @ gram[:, x, p]
    state_step = np.einsum("wij,wj->wi", inverse, state_gradient)
    hessian = gram[:, p, p] - gram[:, p, x] @ to_state
    gradient = gram[:, p, -1] - np.einsum("wpx,wx->wp", gram[:, p, x], state_step)
    squares = np.einsum("wii->wi", gram[:, p, p])
    answer = np.abs(to_state * size[:, :, None]).sum(axis=1) / _length(squares)
    seen = np.einsum("wii->wi", hessian) > SUM_ROUNDING * (1.0 + answer) ** 2 * squares
    hessian = hessian * (seen[:, :, None] & seen[:, None, :])
    return Normal(hessian, gradient * seen, to_state, state_step)


def _inverse(matrices: np.ndarray) -> np.ndarray:
    """Return the pseudoinverses of symmetric matrices without negative eigenvalues."""
    values, vectors = np.linalg.eigh(matrices)
    values, vectors = values[:, ::-1], np.ascontiguousarray(vectors[..., ::-1])
    seen = values > FLAT_START * values[:, :1]
    inverted = np.divide(1.0, values, out=np.zeros_like(values), where=seen)
    return vectors @ (inverted[..., None] * np.swapaxes(vectors, 1, 2))


def _length(squares) -> np.ndarray:
    """Return the norms of columns, one for those that are zero."""
    return np.sqrt(np.where(squares > 0, squares, 1.0))


def normal_equations(fit: "WindowFit", expected: np.ndarray, spread: np.ndarray) -> Normal:
    """Return the normal equations of a fit's parameters, initial states projected out.

    Parameters
    ----------
    fit : WindowFit
        The fit.
    expected : ndarray of shape (n_windows, n_states)
        Expected initial states.
    spread : ndarray of shape (n_states,)
        Their uncertainty.

    Returns
    -------
    Normal
        See `project`; the Hessian of a window is its information on the parameters.
    """
    return project(fit.evaluation.gram, len(fit.freedoms), 1.0 / spread**2, fit.x0 - expected)


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
    step, seen = np.zeros_like(gradient), np.diag(hessian) > 0
    if not seen.any() or np.isinf(damping):
        return step
    size = np.sqrt(np.diag(hessian)[seen])
    scaled = hessian[np.ix_(seen, seen)] / np.outer(size, size) + damping * np.eye(size.size)
    values, vectors = np.linalg.eigh(scaled)
    root = np.sqrt(np.maximum(values, FLAT * values[-1]))
    target = (vectors.T @ (gradient[seen] / size)) / root
    lower, upper = np.minimum(low[seen] * size, -1e-15), np.maximum(high[seen] * size, 1e-15)
    free = vectors @ (target / root)
    if not np.all((lower <= free) & (free <= upper)):
        free = _solve_within(root[:, None] * vectors.T, target, lower, upper, free)
    step[seen] = free / size
    return step


def _solve_within(matrix, target, lower, upper, free) -> np.ndarray:
    """Return the least-squares solution within bounds, from the one without.

    The set of values at their bounds is improved until it satisfies the conditions of optimality.
    This takes few solutions, but may cycle; then a slower algorithm, which cannot, solves it.
    """
    low, high = free < lower, free > upper
    for _ in range(free.size):
        inside = ~(low | high)
        x = np.where(low, lower, np.where(high, upper, 0.0))
        x[inside] = np.linalg.lstsq(matrix[:, inside], target - matrix @ x, rcond=None)[0]
        slope = matrix.T @ (target - matrix @ x)
        is_low, is_high = (
            np.where(low, slope <= 0, x < lower),
            np.where(high, slope >= 0, x > upper),
        )
        if np.array_equal(is_low, low) and np.array_equal(is_high, high):
            return x
        low, high = is_low, is_high
    return lsq_linear(matrix, target, bounds=(lower, upper), method="bvls").x
