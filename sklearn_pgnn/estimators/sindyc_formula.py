"""A sparse formula for samples of a quantity, term by term, the most telling first."""

import numpy as np
import pysindy


def leading_terms(columns: np.ndarray, target: np.ndarray, count: int) -> list[np.ndarray]:
    r"""Fit a quantity by one, two, and more of the columns of a library.

    The columns are taken in by forward regression with orthogonal least squares,
    :math:`\min_\xi |d - \Theta\xi|^2` with :math:`|\xi|_0 = 1, 2, \dots`.

    Parameters
    ----------
    columns : ndarray of shape (n_samples, n_terms)
        The library :math:`\Theta`; no column a sum of others.
    target : ndarray of shape (n_samples,)
        The quantity :math:`d`.
    count : int
        Most terms.

    Returns
    -------
    list of ndarray of shape (n_terms,)
        Coefficients :math:`\xi` with one term, with two, and so on.

    References
    ----------
    .. [1] S. Chen, S. A. Billings, W. Luo, "Orthogonal least squares methods and their application
       to non-linear system identification", International Journal of Control 50(5), 1989,
       :doi:`10.1080/00207178908953472`.

    Examples
    --------
    >>> x = np.linspace(-1, 1, 50)
    >>> leading_terms(np.column_stack([x, x**2, x**3]), 2 * x**3, 1)[0].round(3)
    array([0., 0., 2.])
    """
    size = np.linalg.norm(columns, axis=0)
    optimizer = pysindy.FROLS(max_iter=min(count, columns.shape[1]), alpha=1e-12)
    optimizer.fit(columns / size, target[:, None])
    return [np.ravel(coefficients) / size for coefficients in optimizer.history_[1:]]
