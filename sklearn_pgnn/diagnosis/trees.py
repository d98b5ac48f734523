"""Regressions by boosted trees, and the groups of samples on which they are tested."""

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor

from sklearn_pgnn.estimation.budgets import LEAVES, STRETCHES, TREES


def boosted_trees() -> HistGradientBoostingRegressor:
    """Return the regression by which a quantity is predicted on held-out groups."""
    return HistGradientBoostingRegressor(max_iter=TREES, max_leaf_nodes=LEAVES, random_state=0)


def groups_of(record: np.ndarray) -> np.ndarray:
    """Assign samples to groups: records, or stretches of them where there are few records."""
    _, record, sizes = np.unique(record, return_inverse=True, return_counts=True)
    stretches = -(-STRETCHES // sizes.size)
    place = np.arange(record.size) - np.searchsorted(record, record)
    stretch = place * stretches // sizes[record]
    return (record * stretches + stretch) % max(STRETCHES, stretches)
