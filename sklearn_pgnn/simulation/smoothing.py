"""Smoothing of a measured quantity and its derivative, chosen by cross-validation.

Solve symmetric equations whose matrix has two diagonals on either side of its own, compiled.

LAPACK calls BLAS for every column of such a matrix, which takes longer than the arithmetic.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit, types
from scipy.interpolate import PPoly

from sklearn_pgnn.simulation.stepping import OPTIONS

_F1, _F2 = types.float64[::1], types.float64[:, ::1]


@njit(_F2(_F2, _F2, _F1, _F1), **OPTIONS)
def solve_pentadiagonal(A, B, factors, b):
    r"""Solve :math:`(A + cB)\,x = b` for several factors :math:`c`, by :math:`LDL^T`.

    A and B are given by their diagonals and the two below, filled up by zeros; their sum is
    positive definite. Column j of the result is the solution for ``factors[j]``, between two rows
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
