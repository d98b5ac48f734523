"""Regressions by boosted trees, and the groups of samples on which they are tested."""

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.model_selection import GroupKFold, cross_val_predict

from sklearn_pgnn.estimation.budgets import FOLDS, LEAVES, SAMPLES, STRETCHES, TREES
from sklearn_pgnn.threads import one_thread_each


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


def share_predicted(columns: np.ndarray, target: np.ndarray, groups: np.ndarray) -> float:
    """Return the share of a quantity's variance that others predict in groups not learned on."""
    some = slice(None, None, max(1, target.size // SAMPLES))
    columns, target, groups = columns[some], target[some], groups[some]
    folds = GroupKFold(min(FOLDS, np.unique(groups).size))
    with one_thread_each():
        predicted = cross_val_predict(boosted_trees(), columns, target, groups=groups, cv=folds)
    return float(1.0 - np.mean((target - predicted) ** 2) / np.var(target))
