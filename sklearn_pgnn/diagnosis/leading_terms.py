"""A sparse formula for samples of a quantity, term by term, the most important first."""

import numpy as np

#: share of a column's power below which its remainder after earlier terms counts as rounding error
EPSILON = np.finfo(float).eps


def leading_terms(columns: np.ndarray, target: np.ndarray, count: int) -> list[np.ndarray]:
    r"""Fit a quantity with one, two, and more of the columns of a library.

    The columns are selected by forward regression with orthogonal least squares,
    :math:`\min_\xi |d - \Theta\xi|^2` with :math:`|\xi|_0 = 1, 2, \dots`: the next column is the
    one that, together with those selected before, lowers the squares most. (Orthogonal matching
    pursuit selects the column most correlated with the residual, and is misled by columns that are
    nearly collinear.)

    References
    ----------
    .. [1] S. Chen, S. A. Billings, W. Luo, "Orthogonal least squares methods and their application
       to non-linear system identification", International Journal of Control 50(5), 1989,
       :doi:`10.1080/00207178908953472`.
    """
    own = columns / np.linalg.norm(columns, axis=0)
    moved = np.empty_like(own)
    taken: list[int] = []
    found: list[np.ndarray] = []
    while len(taken) < count:
        power = np.einsum("ki,ki->i", own, own)
        is_free = power > EPSILON
        if not is_free.any():
            break
        none = np.full_like(power, -np.inf)
        falls = np.divide((target @ own) ** 2, power, out=none, where=is_free)
        taken.append(int(np.argmax(falls)))
        direction = own[:, taken[-1]] / np.sqrt(power[taken[-1]])
        own -= np.outer(direction, direction @ own, out=moved)
        found.append(np.zeros(columns.shape[1]))
        found[-1][taken] = np.linalg.lstsq(columns[:, taken], target, rcond=None)[0]
    return found
