"""Noise of a measured quantity, estimated from the record alone."""

from math import comb
from operator import itemgetter

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.stats import norm

from sklearn_pgnn.trajectories.triangle import blocks, triangle

#: orders of differences: higher ones pass less of a signal, but more near two samples per period
ORDERS = (3, 4, 6, 8, 12, 16, 24, 32)
#: length of the filter that is fitted to the record, and the rows of the record used for it
TAPS, ROWS = 32, 4096
#: least number of rows per coefficient of that filter
ROWS_A_TAP = 4
#: rows whose weights are held in memory at a time
CHUNK = 10_000
#: median size of a normal value of unit strength; sizes that count; the strength of what they keep
MEDIAN, REACH = norm.ppf(0.75), 3.0
INSIDE = np.sqrt(1 - 2 * REACH * norm.pdf(REACH) / (norm.cdf(REACH) - norm.cdf(-REACH)))
#: relative scatter of the steps up to which a clock counts as even
EVEN = 1e-6


def noise_level(y: np.ndarray, t: np.ndarray | None = None) -> float:
    r"""Estimate the standard deviation of white noise on a signal.

    A filter of unit norm, :math:`\sum_k h_k^2 = 1`, keeps the variance of white noise. Its
    output is thus the noise plus the part of the signal that it passes: the filter with the
    smallest output is the best estimate. The candidates are divided differences, which remove every
    polynomial below their order, and, for an even clock, the filter with the smallest output on one
    half of the record (the eigenvector of the least eigenvalue of its covariance [1]_), applied to
    the other half. Medians exclude jumps and corners.

    .. [1] V. F. Pisarenko, "The retrieval of harmonics from a covariance function", Geophysical
       Journal International 33(3), 1973, :doi:`10.1111/j.1365-246X.1973.tb03424.x`.
    """
    y = np.asarray(y, dtype=float)
    clocks = _clocks(y, t)
    third = _divided_differences(y, clocks[0], ORDERS[0])
    if third.size == 0:
        return 0.0
    if np.median(np.abs(third)) == 0:  # most of the time nothing moves
        return float(np.std(third))
    strengths = [_finest(y, clock)[1] for clock in clocks]
    return min(*strengths, _strength(_least_passed(y)))


def rough_noise_level(y: np.ndarray, t: np.ndarray | None = None) -> float:
    """Return a quick upper estimate of the noise: the residue of the third differences.

    >>> y = np.sin(2 * np.pi * np.arange(2000) / 8)
    >>> bool(rough_noise_level(y) > noise_level(y))
    True
    """
    third = _divided_differences(np.asarray(y, dtype=float), _clocks(y, t)[0], ORDERS[0])
    return float(np.sqrt(np.sum(third**2) / max(third.size, 1)))


def finest_differences(y: np.ndarray, t: np.ndarray | None = None) -> tuple[np.ndarray, int]:
    """Return the divided differences with the smallest residue of a record, and their order."""
    clocks = _clocks(y, t)
    found, _ = min((_finest(y, clock) for clock in clocks), key=itemgetter(1))
    return found, int(np.isfinite(y).sum()) - found.size


def relative_error(size: int, order: int = ORDERS[0]) -> float:
    r"""Return the relative standard error of the noise, estimated from differences.

    The squares of differences of order :math:`m` count as :math:`1/\sqrt{\pi m/2}` as many
    independent ones.
    """
    return float(np.sqrt(0.5 * np.sqrt(np.pi * order / 2) / max(size, 1)))


def _finest(y: np.ndarray, clock: np.ndarray) -> tuple[np.ndarray, float]:
    """Raise the order of the differences while the residue, also returned, falls significantly."""
    best = _divided_differences(y, clock, ORDERS[0])
    least = _strength(best)
    for order in ORDERS[1:]:
        found = _divided_differences(y, clock, order)
        chance, strength = relative_error(found.size, order), _strength(found)
        if found.size < ROWS_A_TAP * order or strength > (1 - chance) * least:
            break
        best, least = found, strength
    return best, least


def _strength(differences: np.ndarray) -> float:
    """Return the standard deviation of normal values with a few outliers; inf for none.

    Jumps and corners of a signal are few: values beyond some multiple of the median are left out.
    """
    if not differences.size:
        return np.inf
    size = np.abs(differences)
    near = size[size <= REACH * np.median(size) / MEDIAN]
    return float(np.sqrt(np.mean(near**2)) / INSIDE)


def _clocks(y: np.ndarray, t: np.ndarray | None) -> list[np.ndarray]:
    """Return the indices of the known samples, and their times if the clock is uneven."""
    known = np.flatnonzero(np.isfinite(y))
    if t is None or known.size < 2:
        return [known]
    steps = np.diff(t[known]) / np.diff(known)
    return [known] if np.ptp(steps) < EVEN * steps.mean() else [known, t[known]]


def _divided_differences(y: np.ndarray, clock: np.ndarray, order: int) -> np.ndarray:
    """Return the divided differences of the known samples, their weights scaled to norm one."""
    known = y[np.isfinite(y)]
    if known.size <= order:
        return np.zeros(0)
    if np.ptp(np.diff(clock)) <= EVEN * np.mean(np.diff(clock)):
        return np.diff(known, order) / np.sqrt(comb(2 * order, order))
    clock = (clock - clock[0]) * (clock.size - 1) / (clock[-1] - clock[0])
    rows = sliding_window_view(known, order + 1)
    starts = range(0, len(rows), CHUNK)
    weights = (_weights(clock[a : a + CHUNK + order], order) for a in starts)
    parts = [
        np.einsum("ji,ij->i", w, rows[a : a + CHUNK]) for a, w in zip(starts, weights, strict=True)
    ]
    return np.concatenate(parts)


def _weights(clock: np.ndarray, order: int) -> np.ndarray:
    r"""Return the weights of divided differences, of shape (order + 1, n_samples - order).

    They follow from :math:`[t_i, \dots, t_{i+m}] = ([t_{i+1}, \dots, t_{i+m}]
    - [t_i, \dots, t_{i+m-1}])/(t_{i+m} - t_i)`.
    """
    weights = np.ones((1, clock.size))
    for m in range(1, order + 1):
        later, earlier = weights[:, 1:], weights[:, :-1]
        weights = np.zeros((m + 1, clock.size - m))
        weights[1:] = later
        weights[:-1] -= earlier
        weights /= clock[m:] - clock[:-m]
    return weights / np.linalg.norm(weights, axis=0)


def _least_passed(y: np.ndarray) -> np.ndarray:
    """Filter each half of an even record as fitted to the other half; parabolas never pass."""
    unknown = np.concatenate([[0], np.cumsum(~np.isfinite(y))])
    places = np.flatnonzero(unknown[TAPS:] == unknown[:-TAPS])  # all samples are known from there
    half = places.size // 2
    if half < ROWS_A_TAP * TAPS:
        return np.zeros(0)
    straight = np.linalg.qr(np.vander(np.linspace(-1, 1, TAPS), 3), mode="complete")[0][:, 3:]
    filtered = []
    for some, others in ((places[:half], places[half:]), (places[half:], places[:half])):
        learned = some[:: -(-some.size // ROWS)]
        filtered.append(_filtered(y, others, straight @ _least_direction(y, learned, straight)))
    return np.concatenate(filtered)


def _least_direction(y: np.ndarray, places: np.ndarray, straight: np.ndarray) -> np.ndarray:
    """Return the combination that is smallest on windows, a right singular vector."""
    windows = sliding_window_view(y, TAPS)
    rows = triangle((straight.T @ windows[places[of]].T).T for of in blocks(places.size))
    return np.linalg.svd(rows)[2][-1]


def _filtered(y: np.ndarray, places: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the weighted sums of the windows that begin at increasing indices."""
    first = places[0]
    return np.correlate(y[first : places[-1] + TAPS], weights, "valid")[places - first]
