"""Laws of what can be predicted without a model: a point that is seen moves on."""

from dataclasses import replace

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, systems
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.without_model import free_values, squares_without_model
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

POINT = PhysicsModel(
    {"x": "m", "v": "m/s"}, {"x": "v", "v": "F"}, {}, {"F": "N/kg"}, outputs={"x": "x"}
)


def windows_of(y, t=None):
    """Return windows of 20 samples of a point's position, with noise of one."""
    t = 0.01 * np.arange(len(y)) if t is None else t
    records = read_records(POINT, np.column_stack([t, np.zeros(len(y))]), y)
    return build_problem(POINT, records, window_length=0.2, noise_std=1.0).windows


@pytest.mark.parametrize("n_values", [1, 2, 3])
def test_a_polynomial_is_known_from_as_many_values_and_not_from_fewer(n_values):
    t = 0.01 * np.arange(400)
    windows = windows_of(1e3 * (t + 1.0) ** (n_values - 1) + 1e-9 * t**5)
    assert squares_without_model(windows, n_values) == pytest.approx([0.0], abs=1e-6)
    if n_values > 1:
        assert squares_without_model(windows, n_values - 1)[0] > 1.0


@pytest.mark.parametrize("n_values", [1, 2, 3])
def test_of_white_noise_as_many_values_are_lost_in_every_window(n_values):
    windows = windows_of(np.random.default_rng(0).normal(size=20_000))
    left = 20_000 - n_values * len(windows)
    assert squares_without_model(windows, n_values)[0] == pytest.approx(left, rel=0.03)


def test_samples_that_are_lost_and_another_unit_of_noise_change_nothing_else():
    y = np.random.default_rng(1).normal(size=400)
    y[7::11] = np.nan
    windows = windows_of(y)
    coarse = replace(windows, scale=10.0 * windows.scale)
    for n_values in (1, 2):
        squares = squares_without_model(windows, n_values)
        assert np.isfinite(squares).all()
        assert squares_without_model(coarse, n_values) == pytest.approx(squares / 100)


def test_a_window_with_no_more_values_than_are_free_says_nothing():
    y = np.full(400, np.nan)
    y[::10] = np.random.default_rng(2).normal(size=40)
    assert squares_without_model(windows_of(y), 20) == pytest.approx([0.0])


@pytest.mark.parametrize(
    ("model", "count"), [(POINT, 2), (systems.cart_on_spring(), 2), (systems.two_tanks(), 2)]
)
def test_every_output_has_its_part_of_the_initial_values(model, count):
    assert free_values(model) == -(-len(model.states) // len(model.outputs)) == count
