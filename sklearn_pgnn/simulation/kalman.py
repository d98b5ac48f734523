r"""The smoother's time loop: an extended Kalman filter forward, Rauch, Tung and Striebel back."""

import math

import numpy as np
from numba import boolean, njit, types

from sklearn_pgnn.simulation.compiled import FUNCTION
from sklearn_pgnn.simulation.stepping import _observe, _to_next_sample, workspace

_F1, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_B1 = boolean[::1]
_OPTIONS = {"cache": True, "error_model": "numpy", "nogil": True}
#: largest squared innovation, in its own variances, that the filter believes
OUTLIER = 25.0


@njit(
    types.float64(
        FUNCTION, _F1, _F2, boolean, _F2, _F1, _F1, _F2, _F1, _F1, _B1, types.int64, _F1, _F1,
        types.int64, _F2, _F3, _F2, _F3, _F3,
    ),
    **_OPTIONS,
)  # fmt: skip
def run_filter(
    function, t, u, linear_hold, y, p, x0, P0, diffusion, variance, dry, substeps, nodes, weights,
    size, X, P, Xp, Pp, F,
):  # fmt: skip
    """Filter one record into X and P, predictions into Xp and Pp, transitions into F.

    Gives the log-likelihood of the outputs; minus infinity where the filter diverged. Outputs are
    taken in one after the other, their noise being independent.
    """
    nx, ny = x0.size, y.shape[1]
    work, old = workspace(nx, nx, u.shape[1], size)
    x, S, C = x0.copy(), np.eye(nx), P0.copy()
    s, stuck = np.zeros(nx), np.zeros(nx, dtype=np.bool_)
    y_model, H = np.zeros(ny), np.zeros((ny, nx))
    u_start, u_end = np.zeros(u.shape[1]), np.zeros(u.shape[1])
    total = 0.0
    for k in range(t.size):
        for i in range(nx):
            if not math.isfinite(x[i]):
                return -np.inf
            if dry[i] and not stuck[i]:
                s[i] = 1.0 if x[i] > 0.0 else (-1.0 if x[i] < 0.0 else 0.0)
        Xp[k], Pp[k] = x, C
        for j in range(ny):
            if math.isnan(y[k, j]):
                continue
            S[:, :] = np.eye(nx)
            _observe(function, t[k], x, S, u[k], p, s, work[7], y_model, H)
            gain = C @ H[j]
            spread = H[j] @ gain + variance[j]
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
            if moved:
                stuck[:] = False
        X[k], P[k] = x, C
        if k + 1 < t.size:
            S[:, :] = np.eye(nx)
            _to_next_sample(
                function, t, u, linear_hold, k, x, S, p, s, stuck, dry, substeps, nodes, weights,
                work, old, u_start, u_end,
            )  # fmt: skip
            F[k] = S
            C = S @ C @ S.T
            for i in range(nx):
                C[i, i] += diffusion[i] * (t[k + 1] - t[k])
            C = 0.5 * (C + C.T)
    return total


@njit(types.void(_F2, _F3, _F2, _F3, _F3), **_OPTIONS)
def run_smoother(X, P, Xp, Pp, F):
    """Smooth filtered states and covariances in place, from the last sample back."""
    nx = X.shape[1]
    for k in range(X.shape[0] - 2, -1, -1):
        scale = np.sqrt(np.maximum(np.diag(Pp[k + 1]), 1e-300))
        scaled = Pp[k + 1] / np.outer(scale, scale) + 1e-12 * np.eye(nx)
        back = np.linalg.solve(scaled, (F[k] @ P[k]) / scale.reshape(-1, 1)) / scale.reshape(-1, 1)
        gain = np.ascontiguousarray(back.T)
        X[k] += gain @ (X[k + 1] - Xp[k + 1])
        P[k] += gain @ (P[k + 1] - Pp[k + 1]) @ gain.T
