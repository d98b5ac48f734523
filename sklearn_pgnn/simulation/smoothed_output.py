"""Outputs that show a state: smoothed by cross-validation, and the errors of value and slope."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numba import njit, types
from scipy.interpolate import PPoly

from sklearn_pgnn.simulation.stepping import OPTIONS
from sklearn_pgnn.simulation.windows import ShootingWindows

_F1, _F2 = types.float64[::1], types.float64[:, ::1]


@njit(_F2(_F2, _F2, _F1, _F1), **OPTIONS)
def solve_pentadiagonal(A, B, factors, b):
    r"""Solve :math:`(A + cB)\,x = b` for several factors :math:`c`, by :math:`LDL^T`.

    LAPACK calls BLAS for every column of such a matrix, which takes longer than the arithmetic. A
    and B are given by their diagonals and the two below, filled up by zeros; their sum is positive
    definite. Column j of the result is the solution for ``factors[j]``, between two rows
    of zeros at its beginning and two at its end.
    """
    n, width = b.size, factors.size
    D, x = np.zeros((n + 2, width)), np.zeros((n + 4, width))
    near, far = np.zeros((n + 2, width)), np.zeros((n + 2, width))  # the diagonals of L
    for i in range(n):
        k = i + 2
        for j in range(width):
            c, before = factors[j], near[k - 1, j] * D[k - 1, j]
            pivot = A[0, i] + c * B[0, i] - near[k - 1, j] * before
            pivot -= far[k - 2, j] * far[k - 2, j] * D[k - 2, j]
            D[k, j] = pivot
            near[k, j] = (A[1, i] + c * B[1, i] - far[k - 1, j] * before) / pivot
            far[k, j] = (A[2, i] + c * B[2, i]) / pivot
            x[k, j] = b[i] - near[k - 1, j] * x[k - 1, j] - far[k - 2, j] * x[k - 2, j]
    for k in range(n + 1, 1, -1):
        for j in range(width):
            x[k, j] = x[k, j] / D[k, j] - near[k, j] * x[k + 1, j] - far[k, j] * x[k + 2, j]
    return x


#: samples used for the choice of the smoothing (which costs far more than its use)
CHOICE_SAMPLES = 600
PENALTIES = np.logspace(-4, 9, 14)
#: samples that a spline needs, with one left out
FEWEST = 6


@dataclass(frozen=True)
class Smoothed:
    """A smoothed quantity."""

    spline: PPoly

    def value(self, t) -> np.ndarray:
        """Return the smoothed quantity at times `t` [s]."""
        return _evaluate(self.spline, t)

    def slope(self, t) -> np.ndarray:
        """Return its rate of change at times `t` [s]."""
        return _evaluate(self.spline.derivative(), t)


class NaturalSpline:
    r"""Smoothing splines through the same samples, for any penalty.

    The natural cubic spline that minimises

    .. math:: \sum_i (y_i - g(t_i))^2 + \lambda \int g''(t)^2\,dt

    has the values :math:`g = y - \lambda Q\gamma` and, between the ends, the second derivatives
    :math:`\gamma` of :math:`(R + \lambda Q^T Q)\,\gamma = Q^T y`, with the second divided
    differences :math:`Q^T y` and a tridiagonal :math:`R` [1]_.

    The times increase; there are at least three samples.

    .. [1] P. J. Green, B. W. Silverman, "Nonparametric regression and generalized linear models",
       Chapman and Hall, 1994, section 2.3.3.
    """

    def __init__(self, t: np.ndarray, y: np.ndarray):
        self.t, self.y, self.h = t, y, np.diff(t)
        before, after = 1 / self.h[:-1], 1 / self.h[1:]
        centre = -(before + after)
        self._q = before, centre, after
        self._second_differences = before * y[:-2] + centre * y[1:-1] + after * y[2:]
        self._r = _symmetric((self.h[:-1] + self.h[1:]) / 3, self.h[1:-1] / 6, np.zeros(t.size - 4))
        self._qq = _symmetric(
            before**2 + centre**2 + after**2,
            after[:-1] * (centre[:-1] + centre[1:]),
            after[:-2] * after[1:-1],
        )

    def smoothed(self, penalty) -> PPoly:
        """Return the splines, (..., n_penalties), for penalties [s^3] on the curvature."""
        value, curvature = self._at_samples(np.atleast_1d(penalty))
        pieces = _pieces(self.h[:, None], value[:-1], value[1:], curvature[:-1], curvature[1:])
        return PPoly(np.stack(pieces).reshape(4, self.h.size, *np.shape(penalty)), self.t)

    def predicted(self, penalties, t) -> np.ndarray:
        """Return the values of `smoothed`, (n_times, n_penalties), at times between the samples."""
        value, curvature = self._at_samples(penalties)
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, self.h.size - 1)
        after = (t - self.t[i])[:, None]
        around = (value[i], value[i + 1], curvature[i], curvature[i + 1])
        cubic, square, slope, start = _pieces(self.h[i, None], *around)
        return ((cubic * after + square) * after + slope) * after + start

    def _at_samples(self, penalties) -> tuple[np.ndarray, np.ndarray]:
        """Return values and second derivatives at the samples, one column per penalty."""
        curvature = self._curvatures(penalties)
        value = np.repeat(self.y[:, None], penalties.size, axis=1)
        for i, part in enumerate(self._q):
            value[i : i + part.size] -= penalties * part[:, None] * curvature[1:-1]
        return value, curvature

    def _curvatures(self, penalties) -> np.ndarray:
        """Return the second derivatives at the samples, zero at the ends, one column a penalty."""
        factors = np.asarray(penalties, dtype=float)
        return solve_pentadiagonal(self._r, self._qq, factors, self._second_differences)[1:-1]


def _pieces(h, start, end, curvature, next_curvature) -> list[np.ndarray]:
    """Return the coefficients of cubics over intervals `h`, the highest power first."""
    bend = h / 6 * (2 * curvature + next_curvature)
    return [(next_curvature - curvature) / (6 * h), curvature / 2, (end - start) / h - bend, start]


def _evaluate(spline: PPoly, t) -> np.ndarray:
    """Evaluate a spline; at its own samples every piece begins with the value."""
    if not np.array_equal(t, spline.x):
        return spline(t)
    return np.append(spline.c[-1], spline(spline.x[-1]))


def _symmetric(diagonal, next_to_it, two_off) -> np.ndarray:
    """Store a symmetric matrix by its diagonal and the two below it, as LAPACK does."""
    bands = np.zeros((3, diagonal.size))
    bands[0], bands[1, :-1], bands[2, :-2] = diagonal, next_to_it, two_off
    return bands


def smooth(t: np.ndarray, y: np.ndarray, penalty: float | None = None) -> Smoothed:
    """Fit a cubic smoothing spline whose penalty cross-validation chooses.

    .. [1] G. Wahba, "Spline models for observational data", SIAM, 1990,
       :doi:`10.1137/1.9781611970128`.
    """
    known = np.isfinite(y)
    t, y = t[known], y[known]
    if t.size < FEWEST:
        return Smoothed(_line(t, y))
    step = (t[-1] - t[0]) / (t.size - 1)
    penalty = choose_penalty((t - t[0]) / step, y) if penalty is None else penalty
    return Smoothed(NaturalSpline(t, y).smoothed(penalty * step**3))


def choose_penalty(t: np.ndarray, y: np.ndarray) -> float:
    """Choose the smoothing penalty by cross-validation on the most active part of a record."""
    starts = np.arange(0, max(t.size - CHOICE_SAMPLES, 0) + 1, CHOICE_SAMPLES // 2)
    a = starts[int(np.argmax([np.ptp(y[a : a + CHOICE_SAMPLES]) for a in starts]))]
    stretch = slice(a, a + CHOICE_SAMPLES)
    errors = _cross_validation(t[stretch], y[stretch], PENALTIES)
    return float(PENALTIES[np.argmin(errors)])


def _cross_validation(t, y, penalties) -> np.ndarray:
    """Predict every fifth sample from the others, with each penalty."""
    errors = np.zeros(len(penalties))
    for k in range(5):
        left_out = np.zeros(t.size, dtype=bool)
        left_out[2 + k : -2 : 5] = True
        spline = NaturalSpline(t[~left_out], y[~left_out])
        predicted = spline.predicted(penalties, t[left_out])
        errors += np.sum((predicted - y[left_out, None]) ** 2, axis=0)
    return errors


def _line(t, y) -> PPoly:
    """Return the straight line through few samples."""
    slope, level = np.polyfit(t, y, 1) if t.size > 1 else (0.0, float(y[0]) if t.size else 0.0)
    a, b = (t[0], t[-1]) if t.size > 1 else (0.0, 1.0)
    return PPoly(np.array([[slope], [level + slope * a]]), np.array([a, b]))


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
