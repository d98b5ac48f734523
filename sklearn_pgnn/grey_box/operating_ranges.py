"""The ranges of operation in records: groups of similar samples, by k-means."""

import numpy as np
from sklearn.cluster import KMeans
from sklearn.preprocessing import StandardScaler

from sklearn_pgnn.simulation.record_windows import dominant_period
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES

#: share of the dominant period over which output changes are taken, to suppress noise
CHANGE_SHARE = 0.1


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
