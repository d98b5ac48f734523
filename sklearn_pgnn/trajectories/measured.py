"""Statistics of the measured samples of every output, which may be none."""

from collections.abc import Callable

import numpy as np


def of_measured(statistic: Callable, y: np.ndarray) -> np.ndarray:
    """Return a statistic of every column, NaN where nothing was measured.

    Parameters
    ----------
    statistic : callable
        ``numpy.nanstd``, ``numpy.nanmean`` or the like, which warn of a column without any number.
    y : ndarray of shape (n_samples, n_outputs)
        Outputs, NaN where there is none.

    Returns
    -------
    ndarray of shape (n_outputs,)
        The statistics.

    Examples
    --------
    >>> of_measured(np.nanmean, np.array([[1.0, np.nan], [2.0, np.nan]])).tolist()
    [1.5, nan]
    """
    some = ~np.isnan(y).all(axis=0)
    found = np.full(y.shape[1], np.nan)
    found[some] = statistic(y[:, some], axis=0)
    return found
