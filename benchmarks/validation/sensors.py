"""What real sensors do to a clean signal: noise, wander, steps, outliers, jitter.

Every sensor is a function of the clean outputs of shape (n_records, n_samples, n_outputs), the
standard deviation of their noise and a random generator.
"""

import numpy as np
from scipy.signal import lfilter

#: correlation of coloured noise from one sample to the next
KEPT = 0.9
#: share of the samples that are outliers, and their size in standard deviations
OUTLIERS, FAR = 0.005, 15.0
#: steps of a quantised signal, in standard deviations of the noise beneath it
STEP = 3.0
#: standard deviation of the error of a time stamp, in sample times
JITTER = 0.05


def white(y, noise, rng):
    """Add white noise."""
    return y + noise * rng.standard_normal(y.shape)


def coloured(y, noise, rng):
    """Add first-order autoregressive noise."""
    draws = rng.standard_normal(y.shape)
    return y + noise * lfilter([np.sqrt(1 - KEPT**2)], [1, -KEPT], draws, axis=1)


def wandering(y, noise, rng):
    """Add white noise and a random walk that goes as far within a record."""
    steps = rng.standard_normal(y.shape) / np.sqrt(y.shape[1])
    return white(y, noise, rng) + noise * np.cumsum(steps, axis=1)


def quantised(y, noise, rng):
    """Round to steps, with white noise beneath them."""
    return STEP * noise * np.round(white(y, noise, rng) / (STEP * noise))


def with_outliers(y, noise, rng):
    """Add white noise, and single samples that are far off."""
    far = (rng.random(y.shape) < OUTLIERS) * rng.choice([-1, 1], y.shape)
    return white(y, noise, rng) + FAR * noise * far


def with_jitter(y, noise, rng):
    """Sample at times that are off by a share of the sample time, and add white noise."""
    late = JITTER * rng.standard_normal(y.shape[:2])
    slopes = np.gradient(y, axis=1)
    return white(y + late[..., None] * slopes, noise, rng)


SENSORS = {
    "white": white,
    "coloured": coloured,
    "wandering": wandering,
    "quantised": quantised,
    "outliers": with_outliers,
    "jitter": with_jitter,
}
