"""The step of which all values of a quantity are multiples."""

import numpy as np

from sklearn_pgnn.record_quality.limits import OFF_GRID


def grid_step(values: np.ndarray) -> float:
    """Return the step of which all differences of values are multiples.

    Only the larger half of the values counts: numbers written with so many digits are coarsest
    there.

    Parameters
    ----------
    values : ndarray of shape (n_samples,)
        The values; NaN is skipped.

    Returns
    -------
    float
        The step, or 0 if there is none.

    Examples
    --------
    >>> float(round(grid_step(np.round(np.random.default_rng(0).normal(size=100), 2)), 6))
    0.01
    >>> float(grid_step(np.random.default_rng(0).normal(size=100)))
    0.0
    """
    known = values[np.isfinite(values)]
    large = known[np.abs(known) >= np.median(np.abs(known))] if known.size else known
    distinct = _distinct(large)
    return _common_measure(np.diff(distinct)) if distinct.size > 2 else 0.0


def steps_at(values: np.ndarray) -> np.ndarray:
    """Return for every value the distance to the nearest other one.

    No step of a sensor is longer, be its steps even or not.

    Parameters
    ----------
    values : ndarray of shape (n_samples,)
        The values; NaN is skipped.

    Returns
    -------
    ndarray of shape (n_samples,)
        The distances; NaN where there is no value, infinite where there is no other one.

    Examples
    --------
    >>> steps_at(np.array([0.0, 0.0, 2.0, 3.0])).tolist()
    [2.0, 2.0, 1.0, 1.0]
    """
    steps, known = np.full(values.shape, np.nan), np.isfinite(values)
    distinct = _distinct(values[known])
    gaps = np.diff(distinct, prepend=-np.inf, append=np.inf)
    nearest = np.minimum(gaps[:-1], gaps[1:])
    steps[known] = nearest[np.searchsorted(distinct, values[known], side="right") - 1]
    return steps


def _distinct(known: np.ndarray) -> np.ndarray:
    """Return the distinct values; what differs by rounding of the computer only is the same."""
    distinct = np.unique(known)
    return distinct[np.diff(distinct, prepend=-np.inf) > 1e-9 * np.abs(distinct).max(initial=0)]


def _common_measure(gaps: np.ndarray) -> float:
    """Return the largest step that goes into all gaps, by Euclid's algorithm; else 0."""
    least, step = 1e-8 * gaps.sum(), gaps.min()
    while step > least:
        rest = np.abs(gaps - step * np.rint(gaps / step))
        if rest.max() < OFF_GRID * step:
            return float(gaps.sum() / np.rint(gaps / step).sum())
        rest = rest[rest >= OFF_GRID * step]
        # many gaps leave the same rest; that of a long gap alone is as rough as the gap is long
        step = float(np.median(rest[rest < (1 + OFF_GRID) * rest.min()]))
    return 0.0
