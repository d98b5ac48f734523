r"""How fast a model is: the eigenvalues of its Jacobian along a course of its states."""

import numpy as np
from numba import int64, njit, types

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.callbacks import report_calls
from sklearn_pgnn.simulation.compiled import FUNCTION, compile_model
from sklearn_pgnn.simulation.model_function import RATES
from sklearn_pgnn.simulation.stepping import (
    OPTIONS,
    counts_between,
    evaluate,
    flow_of,
    signs_of,
    workspace,
)

#: most samples at which eigenvalues are taken
SOME = 128
#: the step of a difference, as a share of a state; a wide one, and how much they may differ
SHARE, WIDE, ALIKE = 1e-6, 1e-4, 3.0

_F1, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]


@njit(types.void(FUNCTION, _F1, _F2, _F1, _F2, _F1, _F2, int64, _F3), **OPTIONS)
def _fill_jacobians(function, t, u, p, X, widths, dry, size, J):
    """Fill the derivatives of the rates by the states, by differences."""
    nx = X.shape[1]
    out, _ = workspace(dry, 0, u.shape[1], size)
    x, before, S = np.zeros(nx), np.zeros(nx), np.zeros((nx, 0))
    s, stuck = signs_of(dry)
    for k in range(t.size):
        for i in range(nx):
            x[i] = X[k, i]
        for i in range(s.size):
            flow = flow_of(dry[i], x)[0]
            s[i] = 1.0 if flow > 0.0 else (-1.0 if flow < 0.0 else 0.0)
        evaluate(function, RATES, t[k], x, S, u[k], p, s, stuck, out)
        for i in range(nx):
            before[i] = out[i]
        for j in range(nx):
            x[j] = X[k, j] + widths[j]
            evaluate(function, RATES, t[k], x, S, u[k], p, s, stuck, out)
            for i in range(nx):
                J[k, i, j] = (out[i] - before[i]) / (x[j] - X[k, j])
            x[j] = X[k, j]


def fastest(model: PhysicsModel, t, acting, X, usual: float, enough: float = 0.0) -> float:
    r"""Return the largest :math:`|\lambda| h` along a trajectory, in one step for a usual interval.

    A growth is no reason for stable steps, and does not count. Where ``enough`` is given, all
    count, and a bound is returned where that is not above it.
    """
    count = t.size - 1
    rows = np.linspace(0, count - 1, min(count, SOME)).astype(int)
    if np.isfinite(usual):
        widths = np.diff(t) / counts_between(t, usual)
        rows = np.append(rows, np.argmax(widths))
    else:
        widths = np.diff(t)
    rows = rows[np.isfinite(X[rows]).all(axis=1)]
    if not (rows.size and X.shape[1]):
        return 0.0
    J = _jacobians(model, t[rows], acting[rows], np.ascontiguousarray(X[rows]))
    return _largest(J, widths[rows], enough)


def _jacobians(model: PhysicsModel, t, acting, X) -> np.ndarray:
    """Return the derivatives of the rates by the states at some samples; NaN where there are none.

    Where a difference's quotient depends on its step, as for a root at zero, no linear model holds.
    """
    fine, wide = (_differences(model, t, acting, X, share) for share in (SHARE, WIDE))
    size, other = (np.abs(J).max(axis=(1, 2)) for J in (fine, wide))
    fine[size > ALIKE * other] = np.nan
    return fine


def _differences(model: PhysicsModel, t, acting, X, share: float) -> np.ndarray:
    """Return difference quotients, with a step that is a share of each state's size."""
    function, source = compile_model(model)
    p = np.array([parameter.value for parameter in model.parameters.values()], dtype=float)
    size = np.max(np.abs(X), axis=0)
    J = np.empty((t.size, X.shape[1], X.shape[1]))
    _fill_jacobians(
        function.argument, t, np.ascontiguousarray(acting), p, X,
        share * np.where(size > 0, size, 1.0), source.dry, source.size, J,
    )  # fmt: skip
    report_calls()
    return J


def _largest(J: np.ndarray, widths: np.ndarray, enough: float) -> float:
    """Return the largest magnitude of an eigenvalue times its interval, or a bound of it."""
    seen = np.isfinite(J).all(axis=(1, 2))
    if not seen.any():
        return 0.0
    bound = float(np.max(np.abs(J[seen]).sum(axis=2).max(axis=1) * widths[seen]))
    if bound <= enough:
        return bound
    values = np.linalg.eigvals(J[seen])
    counts = (values.real <= np.abs(values.imag)) | (enough > 0)
    return float(np.max(np.where(counts, np.abs(values), 0.0).max(axis=1) * widths[seen]))
