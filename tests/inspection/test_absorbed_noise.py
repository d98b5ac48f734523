"""What fitted initial states take of white noise."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.inspection.absorbed_noise import absorbed_autocorrelation
from sklearn_pgnn.simulation.windows import ShootingWindows

LENGTH, WINDOWS = 12, 5
LEVEL = PhysicsModel({"x": "m"}, {"x": "0"}, initial_state={"x": 0.0})


def level_windows():
    """Return windows of a level that stays, measured with a noise of 1."""
    t = np.arange(LENGTH * WINDOWS, dtype=float)
    starts = np.arange(0, t.size, LENGTH)
    return ShootingWindows(
        t=t,
        u=np.zeros((t.size, 0)),
        y=np.zeros((t.size, 1)),
        bounds=np.array([0, t.size]),
        starts=starts,
        lengths=np.full(WINDOWS, LENGTH),
        scale=np.ones(1),
    )


def absorbed(spread):
    x0 = np.zeros((WINDOWS, 1))
    return absorbed_autocorrelation(level_windows(), LEVEL, x0, np.array([spread]), 5)[:, 0]


def test_a_level_fitted_to_white_noise_leaves_what_is_known_of_it():
    known = [-(LENGTH - k) / LENGTH / (LENGTH - 1) for k in range(1, 6)]
    assert absorbed(1e6) == pytest.approx(known, rel=1e-6)


def test_a_level_that_is_known_takes_nothing():
    assert absorbed(1e-9) == pytest.approx(np.zeros(5), abs=1e-12)
