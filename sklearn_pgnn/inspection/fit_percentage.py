"""The fit of a simulation in percent, as MATLAB's System Identification Toolbox computes it."""

import numpy as np


def fit_percentage(measured, simulated) -> np.ndarray:
    r"""Return the fit of a simulation to measured outputs, in percent.

    .. math:: 100 \left(1 - \frac{\| y - \hat y \|}{\| y - \bar y \|}\right)

    This is the normalised root mean square error as reported by MATLAB's ``compare``: 100 is
    perfect, 0 is no better than the mean of the record, and below 0 is worse than it.

    Parameters
    ----------
    measured : array-like of shape (n_samples, n_outputs) or (n_samples,)
        Measured outputs [unit of the output]; NaN where nothing was measured.
    simulated : array-like of the same shape
        Simulated outputs [unit of the output].

    Returns
    -------
    ndarray of shape (n_outputs,)
        The fit of every output [%]; minus infinity where a simulation becomes non-finite,
        NaN where an output never changes.

    Raises
    ------
    ValueError
        If the shapes differ.

    Examples
    --------
    >>> t = np.linspace(0, 10, 101)
    >>> fit_percentage(np.sin(t), 0.9 * np.sin(t)).round(1).tolist()
    [89.6]
    """
    y, yhat = (np.asarray(values, dtype=float) for values in (measured, simulated))
    if y.shape != yhat.shape:
        raise ValueError(
            f"simulated: expected the shape of what was measured, {y.shape}, got {yhat.shape}."
        )
    y, yhat = (values.reshape(len(values), -1) for values in (y, yhat))
    seen = np.isfinite(y)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = np.where(seen, y, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
        error = np.sqrt((np.where(seen, y - yhat, 0.0) ** 2).sum(axis=0))
        spread = np.sqrt((np.where(seen, y - mean, 0.0) ** 2).sum(axis=0))
    error = np.where(np.isfinite(error), error, np.inf)
    return 100.0 * (1.0 - error / np.where(spread > 0, spread, np.nan))
