"""Smooth a measured quantity and take its derivative; the data choose the smoothing."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_smoothing_spline

#: samples on which the smoothing is chosen (the choice costs far more than its use)
CHOICE_SAMPLES = 600
PENALTIES = np.logspace(-4, 9, 14)
#: samples that a spline needs, one left out
FEWEST = 6


@dataclass(frozen=True)
class Smoothed:
    """A smoothed quantity.

    Parameters
    ----------
    spline : scipy.interpolate.BSpline
        The smoothing spline over time.
    """

    spline: BSpline

    def value(self, t) -> np.ndarray:
        """Give the smoothed quantity at times `t` [s]."""
        return self.spline(t)

    def slope(self, t) -> np.ndarray:
        """Give its rate of change at times `t` [s]."""
        return self.spline.derivative()(t)


def smooth(t: np.ndarray, y: np.ndarray, penalty: float | None = None) -> Smoothed:
    """Fit a cubic smoothing spline whose penalty cross-validation chooses.

    Parameters
    ----------
    t : ndarray of shape (n_samples,)
        Time [s], increasing.
    y : ndarray of shape (n_samples,)
        Measured quantity; NaN is skipped.
    penalty : float, optional
        Penalty on the curvature, in units of the mean sample interval; by default
        `choose_penalty` of this record.

    Returns
    -------
    Smoothed
        The quantity and its rate of change at any time of the record.

    References
    ----------
    .. [1] G. Wahba, "Spline models for observational data", SIAM, 1990,
       :doi:`10.1137/1.9781611970128`.

    Examples
    --------
    >>> t = np.linspace(0, 1, 50)
    >>> bool(abs(smooth(t, 3 * t).slope(0.5) - 3) < 1e-6)
    True
    """
    known = np.isfinite(y)
    t, y = t[known], y[known]
    if t.size < FEWEST:
        return Smoothed(BSpline(*_line(t, y)))
    step = (t[-1] - t[0]) / (t.size - 1)
    clock = (t - t[0]) / step
    spline = make_smoothing_spline(
        clock, y, lam=choose_penalty(clock, y) if penalty is None else penalty
    )
    return Smoothed(BSpline(spline.t * step + t[0], spline.c, spline.k))


def choose_penalty(t: np.ndarray, y: np.ndarray) -> float:
    """Choose the smoothing penalty by cross-validation on the liveliest stretch of a record.

    Parameters
    ----------
    t : ndarray of shape (n_samples,)
        Time, in units of the mean sample interval.
    y : ndarray of shape (n_samples,)
        Measured quantity.

    Returns
    -------
    float
        Penalty on the curvature.
    """
    starts = np.arange(0, max(t.size - CHOICE_SAMPLES, 0) + 1, CHOICE_SAMPLES // 2)
    a = starts[int(np.argmax([np.ptp(y[a : a + CHOICE_SAMPLES]) for a in starts]))]
    stretch = slice(a, a + CHOICE_SAMPLES)
    errors = [_cross_validation(t[stretch], y[stretch], penalty) for penalty in PENALTIES]
    return float(PENALTIES[np.argmin(errors)])


def _cross_validation(t, y, penalty) -> float:
    """Predict every fifth sample from the others."""
    error = 0.0
    for k in range(5):
        left_out = np.zeros(t.size, dtype=bool)
        left_out[2 + k : -2 : 5] = True
        spline = make_smoothing_spline(t[~left_out], y[~left_out], lam=penalty)
        error += np.sum((spline(t[left_out]) - y[left_out]) ** 2)
    return error


def _line(t, y):
    """Give knots, coefficients and degree of the straight line through few samples."""
    slope, level = np.polyfit(t, y, 1) if t.size > 1 else (0.0, float(y[0]) if t.size else 0.0)
    a, b = (t[0], t[-1]) if t.size > 1 else (0.0, 1.0)
    return np.array([a, a, b, b]), np.array([level + slope * a, level + slope * b]), 1


def noise_level(y: np.ndarray) -> float:
    """Estimate the standard deviation of white noise on a smooth signal.

    Third differences remove every quadratic trend; their variance is 20 times the noise's.

    Parameters
    ----------
    y : ndarray of shape (n_samples,)
        The signal, evenly sampled; NaN is skipped.

    Returns
    -------
    float
        Noise [unit of y].

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> y = np.sin(np.linspace(0, 10, 2000)) + 0.01 * rng.standard_normal(2000)
    >>> round(noise_level(y), 3)
    0.01
    """
    differences = np.diff(y, 3)
    differences = differences[np.isfinite(differences)]
    if differences.size == 0:
        return 0.0
    # the median is not misled by jumps and by stretches of rest
    robust = np.median(np.abs(differences)) / 0.6745 if np.any(differences) else 0.0
    return float((robust or np.std(differences)) / np.sqrt(20.0))
