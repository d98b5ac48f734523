r"""What can be predicted over windows without any model: outputs that are polynomials in time.

A model of :math:`n` states has :math:`n` free initial values in every window. Without a model, as
many free values give each of :math:`m` outputs a polynomial of :math:`\lceil n/m \rceil`
coefficients: a point that is seen moves on at its speed. A model that predicts no better says
nothing about what drives the motion.
"""

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.windows import ShootingWindows


def free_values(model: PhysicsModel) -> int:
    """Return how many initial values are free in every window, for each output."""
    return -(-len(model.states) // len(model.outputs))


def squares_without_model(windows: ShootingWindows, n_values: int) -> np.ndarray:
    """Return the squares that polynomials leave, in units of the noise."""
    left = np.zeros(windows.y.shape[1])
    for start, length in zip(windows.starts, windows.lengths, strict=True):
        rows = slice(start, start + length)
        for i, column in enumerate(windows.y[rows].T / windows.scale[:, None]):
            left[i] += _left_of(windows.t[rows], column, n_values)
    return left


def _left_of(t: np.ndarray, y: np.ndarray, n_values: int) -> float:
    """Return the squares that a polynomial leaves of the measured values of one window."""
    seen = np.isfinite(y)
    if np.count_nonzero(seen) <= n_values:
        return 0.0
    place = (t[seen] - t[seen].mean()) / np.ptp(t[seen])
    powers = np.vander(place, n_values)
    return float(np.sum((y[seen] - powers @ np.linalg.lstsq(powers, y[seen], rcond=None)[0]) ** 2))
