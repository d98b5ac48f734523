"""How long residuals remember themselves."""

import numpy as np

from sklearn_pgnn.estimation.budgets import FORGOTTEN


def autocorrelation_times(residual: np.ndarray, segment: np.ndarray) -> np.ndarray:
    r"""Return the integrated autocorrelation time of residuals, in samples.

    .. math:: \tau = 1 + 2 \sum_{k=1}^{K} \rho_k, \qquad K \ge 5 \tau,

    over pairs of samples of the same segment; never below 1.

    Parameters
    ----------
    residual : ndarray of shape (n_samples, n_outputs)
        Residuals; NaN where there is none.
    segment : ndarray of shape (n_samples,)
        Number of every sample's window or record; segments lie end to end.

    Returns
    -------
    ndarray of shape (n_outputs,)
        The times.

    References
    ----------
    .. [1] A. D. Sokal, "Monte Carlo methods in statistical mechanics", in Functional Integration,
       1997, :doi:`10.1007/978-1-4899-0319-8_6`.

    Examples
    --------
    >>> noise = np.random.default_rng(0).normal(size=(5000, 1))
    >>> bool(autocorrelation_times(noise, np.zeros(5000))[0] < 1.3)
    True
    """
    return np.array([_autocorrelation_time(column, segment) for column in residual.T])


def _autocorrelation_time(values: np.ndarray, segment: np.ndarray) -> float:
    known = np.isfinite(values).astype(float)
    values = np.where(known > 0, values, 0.0)
    with np.errstate(over="ignore"):
        power = float(values @ values) / max(known.sum(), 1.0)
    if not 0.0 < power < np.inf:
        return 1.0
    time = 1.0
    for lag in range(1, values.size):
        same = segment[lag:] == segment[:-lag]
        pairs = float((known[lag:] * known[:-lag]) @ same)
        if pairs == 0.0:
            break
        time += 2.0 * float((values[lag:] * values[:-lag]) @ same) / pairs / power
        if lag >= FORGOTTEN * time:  # Sokal's window
            break
    return max(time, 1.0)
