"""Samples that cross-validation hides: trajectories, blocks of time, ranges of operation."""

import numpy as np
from sklearn.cluster import KMeans
from sklearn.preprocessing import StandardScaler

from sklearn_pgnn.model_selection.trajectory_rows import deal_in_order
from sklearn_pgnn.simulation.record_windows import dominant_period
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES

WAYS = ("auto", "trajectory", "time", "range")
#: share of the dominant period over which output changes are taken, to suppress noise
CHANGE_SHARE = 0.1


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


def operating_ranges(records, n_ranges: int) -> list[np.ndarray]:
    """Return which samples are in each range of operation, except the most central one.

    Samples are grouped by their measured outputs, how these change over a tenth of their dominant
    period, and the inputs, all in standard deviations. Unmeasured samples are in no range, nor
    are the first samples of a trajectory, from which its initial state is known.

    `n_ranges` does not count that one, whose centre is nearest to the mean. A mask of shape
    (n_samples,) is over the concatenated trajectories; the range nearest to the mean comes first.
    """
    signals = _signals(records)
    known = np.isfinite(signals).all(axis=1)
    n_known = len(np.unique(signals[known], axis=0))
    if n_known <= n_ranges:
        raise ValueError(
            f"y: expected more distinct measured samples than the {n_ranges + 1} operating ranges, "
            f"got {n_known}. Remedy: lower n_splits, by='time', or record more."
        )
    found = KMeans(n_ranges + 1, n_init=10, random_state=0).fit(signals[known])
    label = np.full(len(signals), -1)
    label[known] = found.labels_
    place = np.concatenate([np.arange(record.t.size) for record in records])
    label[place < MIN_SAMPLES] = -1
    outward = np.argsort(np.linalg.norm(found.cluster_centers_, axis=1))
    return [label == k for k in outward[1:]]


def _signals(records) -> np.ndarray:
    """Return outputs, their changes and the inputs, without mean, in standard deviations."""
    span = CHANGE_SHARE * dominant_period(records)
    parts = [np.hstack([r.y, _changes(r.t, r.y, span), r.u]) for r in records]
    return StandardScaler().fit_transform(np.concatenate(parts))


def _changes(t: np.ndarray, y: np.ndarray, span: float) -> np.ndarray:
    """Return the slope of the outputs over a span of time around every sample."""
    place, last = np.arange(t.size), t.size - 1
    half = max(1, round(span / 2 / float(np.median(np.diff(t))))) if last else 0
    before, after = np.maximum(place - half, 0), np.minimum(place + half, last)
    elapsed = np.where(after > before, t[after] - t[before], 1.0)
    return (y[after] - y[before]) / elapsed[:, None]
