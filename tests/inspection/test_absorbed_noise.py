"""What fitted initial states take of white noise."""

from dataclasses import replace

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, effects
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


def test_an_actuator_that_has_forgotten_the_start_takes_nothing():
    cart = PhysicsModel({"v": "m/s"}, {"v": "(F - 0.3*v)/m"}, {"m": 1.0}, {"F": "N"})
    lag, t = cart + effects.ActuatorLag("F", 0.4), 0.05 * np.arange(300)
    starts = np.arange(150, 300, 30)  # 7.5 s, and later
    windows = ShootingWindows(
        t,
        np.sin(t)[:, None],
        np.zeros((t.size, 1)),
        np.array([0, t.size]),
        starts,
        np.full(starts.size, 30),
        np.array([0.01]),
        states=("v",),
    )
    spread = np.array([1.0, 1.0])
    found = absorbed_autocorrelation(windows, lag, np.zeros((starts.size, 2)), spread, 5)
    known = absorbed_autocorrelation(windows, cart, np.zeros((starts.size, 1)), spread[:1], 5)
    np.testing.assert_allclose(found, known, rtol=1e-6)


def test_a_window_that_is_shorter_than_a_lag_has_no_pairs_so_far_apart():
    whole = level_windows()
    lengths = np.array([LENGTH, LENGTH, 3])
    windows = replace(whole, starts=whole.starts[:3], lengths=lengths)
    found = absorbed_autocorrelation(windows, LEVEL, np.zeros((3, 1)), np.array([1e6]), 5)[:, 0]
    pairs = np.maximum(lengths[:, None] - np.arange(1, 6), 0) / lengths[:, None]
    assert found == pytest.approx(-pairs.sum(axis=0) / (lengths - 1).sum(), rel=1e-6)
