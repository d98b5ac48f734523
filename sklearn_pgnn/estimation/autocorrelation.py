"""Integrated autocorrelation time of residuals."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from sklearn_pgnn.estimation.budgets import FORGOTTEN


def autocorrelation_times(residual: np.ndarray, segment: np.ndarray) -> np.ndarray:
    r"""Return the integrated autocorrelation time of residuals, in samples.

    .. math:: \tau = 1 + \frac{2}{\sum_t r_t^2} \sum_{k=1}^{K} \sum_t r_t\, r_{t+k},
              \qquad K \ge 5 \tau,

    over pairs of known samples of the same segment, the lag counted in known samples; at least 1,
    and equal to the length of a segment for residuals that are constant throughout it.

    Parameters
    ----------
    residual : ndarray of shape (n_samples, n_outputs)
        Residuals; NaN where nothing was measured.
    segment : ndarray of shape (n_samples,)
        Number of every sample's window or record; segments lie end to end.

    Returns
    -------
    ndarray of shape (n_outputs,)
        The autocorrelation times.

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
    known = np.isfinite(values)
    values, segment = values[known], segment[known]
    with np.errstate(over="ignore"):
        power = float(values @ values) / max(values.size, 1)
    if not 0.0 < power < np.inf:
        return 1.0
    products = _sum_over_lags(values, segment)
    times = 1.0 + 2.0 * np.cumsum(products[1:]) / (values.size * power)
    enough = np.flatnonzero(np.arange(1, products.size) >= FORGOTTEN * times)  # Sokal's window
    last = times[enough[:1]] if enough.size else times[-1:]
    return float(np.max(last, initial=1.0))


def _sum_over_lags(values: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Return the sum of the products of all values of a segment that are a given lag apart."""
    edges = np.flatnonzero(np.diff(segment, prepend=np.nan, append=np.nan))
    lengths = np.diff(edges)
    found = np.zeros(lengths.max())
    for length in np.unique(lengths):
        first = edges[:-1][lengths == length]
        padded = next_fast_len(2 * int(length), real=True)
        spectrum = rfft(values[first[:, None] + np.arange(length)], padded, axis=1)
        found[:length] += irfft((np.abs(spectrum) ** 2).sum(axis=0), padded)[:length]
    return found


def white_power(residual: np.ndarray, starts: np.ndarray) -> np.ndarray:
    r"""Return the power of the white part of residuals, from the differences of neighbours.

    .. math:: \tfrac12\, \mathrm{mean}\,(r_{k+1} - r_k)^2,

    over neighbours among the known samples of a window: an output may be measured less often than
    others.
    """
    return np.array([_white_power(column, starts) for column in residual.T])


def _white_power(values: np.ndarray, starts: np.ndarray) -> float:
    known = np.flatnonzero(np.isfinite(values))
    window = np.searchsorted(starts, known, side="right")
    steps = np.diff(values[known])[np.diff(window) == 0]
    return float(np.mean(steps**2)) / 2.0 if steps.size else 0.0
