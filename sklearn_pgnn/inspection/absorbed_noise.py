"""Autocorrelation of white noise of which fitted initial states of windows absorbed a part."""

import numpy as np

from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords, FittedWindows
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.led_states import lead
from sklearn_pgnn.simulation.simulate import simulate_acting
from sklearn_pgnn.simulation.windows import ShootingWindows

#: windows that are looked at; more would say the same
MOST = 100


def expected_autocorrelation(
    records: DiagnosisRecords, fit: FittedWindows, lags: int
) -> np.ndarray:
    """Return the expected autocorrelation of a model's residuals over windows in white noise."""
    spread = records.problem.states.estimate(fit.model).spread
    return absorbed_autocorrelation(records.windows, fit.model, fit.x0, spread, lags)


def absorbed_autocorrelation(
    windows: ShootingWindows, model: PhysicsModel, x0, spread, lags: int
) -> np.ndarray:
    r"""Return the autocorrelation of white noise of which fitted initial states took a part.

    .. math:: \rho_k = -\frac{\sum_{w,t} H_w[t, t + k]}{\sum_{w,t} (1 - H_w[t, t])}, \qquad
        H_w = S_w (S_w^T S_w + \Lambda)^{-1} S_w^T

    with the slopes :math:`S_w` of the outputs by the initial state, in units of the noise, and the
    inverse variances :math:`\Lambda` of what is expected of it.

    `x0` are fitted initial states, of led ones that of the record, see
    `sklearn_pgnn.simulation.led_states`; `spread` is how far each may be off what is expected. The
    result, of shape (lags, n_outputs), is by lag [samples], from 1 on.
    """
    acting, led, parts = windows.acting_inputs(model), lead(model, windows, (), x0), []
    begun = x0 if led is None else led.initial_states(x0)
    for w in np.unique(np.linspace(0, len(windows) - 1, MOST).astype(int)):
        rows = slice(windows.starts[w], windows.starts[w] + windows.lengths[w])
        run = simulate_acting(
            model,
            windows.t[rows],
            acting[rows],
            begun[w],
            wrt=(),
            **windows.options_in(int(windows.record[w])),
        )
        known = np.isfinite(windows.y[rows]) & np.isfinite(run.y)
        slopes = np.asarray(run.sensitivities) / windows.scale[:, None]
        slopes = slopes if led is None else led.by_record(slopes, int(w))
        parts.append(_sums(slopes, known, spread, lags))
    sums = np.sum(parts, axis=0)
    return -sums[1:] / sums[0]


def _sums(slopes, known, spread, lags: int) -> np.ndarray:
    """Return, by output, how many samples a window leaves free, and the sums of the lags."""
    S = np.where(known[:, :, None], slopes, 0.0)
    columns = S.reshape(-1, S.shape[2])
    inverse = np.linalg.pinv(columns.T @ columns + np.diag(spread**-2.0), hermitian=True)
    taken = np.einsum("toi,ij,toj->o", S, inverse, S)
    sums = [known.sum(axis=0) - taken]
    for lag in range(1, lags + 1):
        earlier, later = S[: max(len(S) - lag, 0)], S[lag:]
        sums.append(np.einsum("toi,ij,toj->o", earlier, inverse, later))
    return np.array(sums)
