"""Samples that cross-validation hides: trajectories, blocks of time, ranges of operation."""

import numpy as np

from sklearn_pgnn.grey_box.operating_ranges import operating_ranges
from sklearn_pgnn.model_selection.trajectory_rows import deal_in_order

WAYS = ("auto", "trajectory", "time", "range")


def hidden_parts(records, n_splits: int, by: str = "auto") -> list[np.ndarray]:
    """Return for every fold which samples are hidden from its fit.

    `by` says whether to hide whole trajectories; or in each fold another block of time of every
    trajectory, never the first of its ``n_splits + 1`` blocks, so that its start stays known; or
    another range of operation, see `operating_ranges`. ``"auto"`` hides trajectories if there are
    at least ``n_splits``, else blocks of time in ``n_splits`` folds and ranges in as many more.
    """
    lengths = [record.t.size for record in records]
    too_few = by == "auto" and len(lengths) < n_splits
    if too_few or by in ("time", "range"):
        blocks = [] if by == "range" else _blocks_of_time(lengths, n_splits)
        return blocks + ([] if by == "time" else operating_ranges(records, n_splits))
    if len(lengths) < n_splits:
        raise ValueError(
            f"n_splits: expected at most as many folds as trajectories, got {n_splits} folds and "
            f"{len(lengths)} trajectories. Remedy: by='time', by='range', or lower n_splits."
        )
    dealt = deal_in_order(lengths, np.full(n_splits, 1 / n_splits))
    trajectory = np.repeat(np.arange(len(lengths)), lengths)
    return [np.isin(trajectory, fold) for fold in dealt]


def _blocks_of_time(lengths, n_splits) -> list[np.ndarray]:
    if min(lengths) <= n_splits:
        raise ValueError(
            f"X: expected more samples in every trajectory than the {n_splits + 1} blocks of "
            f"time, got {min(lengths)}. Remedy: lower n_splits, or leave the trajectory out."
        )
    place = np.concatenate([np.arange(n) * (n_splits + 1) // n for n in lengths])
    return [place == fold for fold in range(1, n_splits + 1)]
