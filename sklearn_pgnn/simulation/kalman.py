r"""The smoother's time loop: an extended Kalman filter forward, Rauch, Tung and Striebel back."""

import math

import numpy as np
from numba import boolean, njit, types

from sklearn_pgnn.simulation.compiled import FUNCTION
from sklearn_pgnn.simulation.stepping import (
    INNER,
    OPTIONS,
    copy_rows,
    keep,
    observe,
    settle,
    signs_of,
    to_next_sample,
    workspace,
)

_F1, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
#: largest squared innovation, in its own variances, that the filter believes
OUTLIER = 25.0


@njit(**INNER)
def multiply(A, B, into):
    """Fill an array with the product of two matrices, rows being added; a zero costs nothing."""
    for i in range(into.shape[0]):
        for j in range(into.shape[1]):
            into[i, j] = 0.0
        for m in range(A.shape[1]):
            factor = A[i, m]
            if factor == 0.0:
                continue
            for j in range(into.shape[1]):
                into[i, j] += factor * B[m, j]


@njit(**INNER)
def set_unit(S):
    """Make a matrix the unit matrix."""
    for i in range(S.shape[0]):
        for j in range(S.shape[1]):
            S[i, j] = 1.0 if i == j else 0.0


@njit(**INNER)
def _predict_covariance(S, C, noise, half):
    """Replace C by S C S' plus a diagonal, in place."""
    multiply(S, C, half)
    nx = C.shape[0]
    for i in range(nx):
        for j in range(i):
            half[i, j], half[j, i] = half[j, i], half[i, j]
    for i in range(nx):
        for j in range(i + 1):
            C[i, j] = 0.0
        for m in range(nx):
            factor = S[i, m]
            if factor == 0.0:
                continue
            for j in range(i + 1):
                C[i, j] += factor * half[m, j]
        for j in range(i):
            C[j, i] = C[i, j]
        C[i, i] += noise[i]


@njit(
    types.float64(
        FUNCTION, _F1, _F2, boolean, _F2, types.float64, _F1, _F1, _F2, _F1, _F1, _F2,
        types.int64, types.int64, _F2, _F3, _F2, _F3, _F3,
    ),
    **OPTIONS,
)  # fmt: skip
def run_filter(
    function, t, u, linear_hold, y, usual, p, x0, P0, diffusion, variance, dry, substeps,
    size, X, P, Xp, Pp, F,
):  # fmt: skip
    """Filter one record in place; the likelihood is minus infinity where the filter diverged."""
    nx, ny = x0.size, y.shape[1]
    out, old = workspace(dry, nx, u.shape[1], size)
    x, S, C, half = x0.copy(), np.zeros((nx, nx)), P0.copy(), np.zeros((nx, nx))
    gain, noise = np.zeros(nx), np.zeros(nx)
    s, stuck = signs_of(dry)
    y_model, H = np.zeros(ny), np.zeros((ny, nx))
    u_start, u_end = np.zeros(u.shape[1]), np.zeros(u.shape[1])
    total = 0.0
    for k in range(t.size):
        for i in range(nx):
            if not math.isfinite(x[i]):
                return -np.inf
        if s.size:
            settle(function, t[k], x, S, u[k], p, s, stuck, dry, -1, out, old)
        keep(x, C, Xp[k], Pp[k])
        for j in range(ny):
            if math.isnan(y[k, j]):
                continue
            set_unit(S)
            observe(function, t[k], x, S, u[k], p, s, stuck, out, y_model, H)
            spread = variance[j]
            for a in range(nx):
                gain[a] = 0.0
                for b in range(nx):
                    gain[a] += C[a, b] * H[j, b]
                spread += H[j, a] * gain[a]
            surprise = y[k, j] - y_model[j]
            total -= 0.5 * (math.log(spread) + surprise**2 / spread)
            if surprise**2 > OUTLIER * spread:
                surprise *= math.sqrt(OUTLIER * spread) / abs(surprise)
            moved = False
            for i in range(nx):
                step = gain[i] * surprise / spread
                moved = moved or step != 0.0
                x[i] += step
            for a in range(nx):
                for b in range(nx):
                    C[a, b] -= gain[a] * gain[b] / spread
            for i in range(stuck.size):
                stuck[i] = stuck[i] and not moved
        keep(x, C, X[k], P[k])
        if k + 1 < t.size:
            set_unit(S)
            to_next_sample(
                function, t, u, linear_hold, k, x, S, p, s, stuck, dry, False, substeps,
                out, old, u_start, u_end, usual,
            )  # fmt: skip
            for i in range(nx):
                noise[i] = diffusion[i] * (t[k + 1] - t[k])
            copy_rows(S, F[k])
            _predict_covariance(S, C, noise, half)
    return total


def filter_samples(compiled, windows, rows: slice, u, y, usual, p, start, noise, into) -> float:
    """Filter some samples of windows; return the log-likelihood.

    `start` are mean and covariance of the first state, `noise` the diffusion of the states and the
    variance of the outputs, `into` the arrays that are filled, see `run_filter`.
    """
    function, source = compiled
    u, y = np.ascontiguousarray(u[rows]), np.ascontiguousarray(y[rows])
    given = function.argument, windows.t[rows], u, windows.hold == "foh", y, usual, p
    steps = source.dry, windows.substeps, source.size
    return run_filter(*given, *start, *noise, *steps, *into)


def run_smoother(X, P, Xp, Pp, F):
    """Smooth filtered states and covariances in place, from the last sample back."""
    scale = np.sqrt(np.maximum(np.diagonal(Pp[1:], axis1=1, axis2=2), 1e-300))
    scaled = Pp[1:] / (scale[:, :, None] * scale[:, None]) + 1e-12 * np.eye(X.shape[1])
    back = np.linalg.solve(scaled, F[:-1] @ P[:-1] / scale[:, :, None]) / scale[:, :, None]
    _run_back(X, P, Xp, Pp, np.ascontiguousarray(back.transpose(0, 2, 1)))


@njit(types.void(_F2, _F3, _F2, _F3, _F3), **OPTIONS)
def _run_back(X, P, Xp, Pp, gains):
    """Correct every sample by what the next one has learned."""
    nx = X.shape[1]
    half, change = np.zeros((nx, nx)), np.zeros((nx, nx))
    for k in range(X.shape[0] - 2, -1, -1):
        gain = gains[k]
        for i in range(nx):
            for j in range(nx):
                X[k, i] += gain[i, j] * (X[k + 1, j] - Xp[k + 1, j])
                change[i, j] = P[k + 1, i, j] - Pp[k + 1, i, j]
        multiply(gain, change, half)
        for i in range(nx):
            for j in range(nx):
                for m in range(nx):
                    P[k, i, j] += half[i, m] * gain[j, m]
