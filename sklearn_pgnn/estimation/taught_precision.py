"""What a fold's fit keeps of the estimates by the other folds."""

import numpy as np

from sklearn_pgnn.estimation.budgets import ROUNDING, SMALL_CHANGE


def keep_taught(fold: np.ndarray, others: np.ndarray) -> np.ndarray | None:
    """Return the precision with which a fold's fit keeps the other folds' estimates.

    Directions of the parameters keep the others' estimates, except those on which the others have
    less than `SMALL_CHANGE` of the fold's information.
    """
    size = np.sqrt(np.maximum(np.diag(fold + others), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh((fold + others) / np.outer(size, size))
    values = np.maximum(values, ROUNDING)
    whitened = vectors / np.sqrt(values)
    shares, turns = np.linalg.eigh(whitened.T @ (fold / np.outer(size, size)) @ whitened)
    untold = shares > 1.0 / (1.0 + SMALL_CHANGE)
    if not untold.any():
        return None
    along = size[:, None] * (vectors * np.sqrt(values)) @ turns
    return along * np.where(untold, np.maximum(1.0 - shares, 0.0), 1.0 / ROUNDING) @ along.T
