"""An output that shows a state, smoothed in every record, and the errors of its value and slope."""

from functools import cached_property
from itertools import pairwise

import numpy as np

from sklearn_pgnn.simulation.smoothing import FEWEST, Smoothed, choose_penalty, smooth
from sklearn_pgnn.simulation.windows import ShootingWindows

#: measured samples without which a half of a record shows no error of the smoothing
HALF = 10


class SmoothedOutput:
    """An output of every record that shows a state, smoothed with the same penalty in time."""

    def __init__(self, windows: ShootingWindows, column: int, name: str, state: str):
        self.name, self.state, self._noise = name, state, float(windows.scale[column])
        self._records = [
            (windows.t[a:b], windows.y[a:b, column]) for a, b in pairwise(windows.bounds)
        ]
        self._penalties = self._choose_penalties()
        pairs = zip(self._records, self._penalties, strict=True)
        curves = [smooth(t, y, p) for (t, y), p in pairs]
        times = [t for t, _ in self._records]
        self.value = np.concatenate([s.value(t) for s, t in zip(curves, times, strict=True)])
        self.slope = np.concatenate([s.slope(t) for s, t in zip(curves, times, strict=True)])

    def of(self, derivative: int) -> np.ndarray:
        """Return the smoothed output, or its slope."""
        return self.slope if derivative else self.value

    @cached_property
    def is_measured(self) -> np.ndarray:
        """Whether a record has enough samples of the output for a spline, of shape (n_records,)."""
        return np.array([np.isfinite(y).sum() >= FEWEST for _, y in self._records])

    @property
    def samples(self) -> np.ndarray:
        """Whether a sample was measured, of shape (n_samples,)."""
        return np.concatenate([np.isfinite(y) for _, y in self._records])

    def _choose_penalties(self) -> list[float | None]:
        """Choose the penalty on the record with the most samples; none where these are too few.

        It is the same for all records in seconds, and so another in each one's sample interval.
        """
        seen = [(t[np.isfinite(y)], y[np.isfinite(y)]) for t, y in self._records]
        t, y = max(seen, key=lambda samples: samples[0].size)
        if t.size < FEWEST:
            return [None] * len(seen)
        step = _mean_step(t)
        penalty = choose_penalty((t - t[0]) / step, y) * step**3
        return [penalty / _mean_step(t) ** 3 for t, _ in seen]

    @cached_property
    def counts(self) -> np.ndarray:
        """Measured samples of a record, 0 where its errors cannot be told, (n_records,)."""
        counts = np.array([np.isfinite(y).sum() for _, y in self._records])
        return np.where(counts < 2 * HALF, 0, counts)

    @cached_property
    def variances(self) -> np.ndarray:
        """Variances of value and slope at measured samples, of shape (n_records, 2); costly."""
        found = np.zeros((len(self._records), 2))
        for r in np.flatnonzero(self.counts).tolist():
            t, y = self._records[r]
            found[r] = _halves_differ(t, y, self._penalties[r], t[np.isfinite(y)][2:-2])
        return found

    @cached_property
    def variances_between(self) -> np.ndarray:
        """Variances of value and slope at all samples of a record, of shape (n_records, 2).

        Where a sample was measured, the value is at least as good as that. Of the time before and
        after the output was measured nothing is known: there the variances are those of the
        smoothed output. Infinite where none can be told.
        """
        found = np.full((len(self._records), 2), np.inf)
        for r in np.flatnonzero(self.counts).tolist():
            found[r] = self._mean_variances(r)
        return found

    def _mean_variances(self, record: int) -> np.ndarray:
        """Average the variances of measured samples, of those between, and of those outside."""
        t, y = self._records[record]
        measured = np.isfinite(y)
        seen = t[measured]
        step = _mean_step(seen)
        measured_share = np.mean(measured)
        outside_share = np.mean((t <= seen[0] - step) | (t >= seen[-1] + step))
        at_measured = between = self.variances[record]
        inner = (t >= seen[2]) & (t <= seen[-3]) & ~measured
        if inner.any():
            between = _halves_differ(t, y, self._penalties[record], t[inner])
        return (
            measured_share * np.minimum(at_measured, [self._noise**2, np.inf])
            + (1 - measured_share - outside_share) * between
            + outside_share * self._powers(record)
        )

    def interval(self, record: int) -> float:
        """Return the mean interval between two measured samples of a record [s]."""
        t, y = self._records[record]
        return float(t[-1] - t[0]) / max(np.isfinite(y).sum() - 1, 1)

    def period(self, record: int) -> float:
        """Return the dominant period of a record [s]; infinite where nothing moves."""
        value, slope = self._powers(record)
        return float(2 * np.pi * np.sqrt(value / slope)) if slope > 0 else np.inf

    def _powers(self, record: int) -> np.ndarray:
        """Return the variances of a record's smoothed output and slope where it was measured."""
        edges = np.cumsum([0, *(t.size for t, _ in self._records)])
        rows = np.arange(edges[record], edges[record + 1])[np.isfinite(self._records[record][1])]
        return np.var([self.value[rows], self.slope[rows]], axis=1)


def _mean_step(t: np.ndarray) -> float:
    """Return the mean sample interval [s]."""
    return (t[-1] - t[0]) / (t.size - 1) if t.size > 1 else 1.0


def _halves_differ(t, y, penalty, at) -> np.ndarray:
    """Estimate the variances of value and slope at times from halves of the measured samples."""
    t, y = t[np.isfinite(y)], y[np.isfinite(y)]
    # a half has twice the sample interval: the same smoothing in time is 1/8 of the penalty
    first: Smoothed = smooth(t[::2], y[::2], penalty / 8)
    second: Smoothed = smooth(t[1::2], y[1::2], penalty / 8)
    value = np.mean((first.value(at) - second.value(at)) ** 2) / 4
    slope = np.mean((first.slope(at) - second.slope(at)) ** 2) / 4
    return np.array([value, slope])
