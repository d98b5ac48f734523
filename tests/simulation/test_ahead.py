"""Predictions some samples ahead: laws of the estimate, whatever runs."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.simulation.ahead import model_machine, predict_ahead
from sklearn_pgnn.trajectories import read_records

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "force - 9*x - d*v"},
    {"d": 0.5},
    {"force": "N"},
    outputs={"position": "x"},
)
T = np.arange(0, 3, 0.02)
FORCE = 4 * np.sin(T**2 / 2)
STIFFER = CART.replace(equations={"x": "v", "v": "force - 14*x - d*v"})


def ahead(plant, steps, *, x0=(0.3, 0.0), told=(0.3, 0.0), noise=0.0, gap=slice(0, 0)):
    """Return predictions by the cart's model of what a plant does, and what that does."""
    y = plant.simulate(T, FORCE, list(x0)).y
    measured = y + noise * np.random.default_rng(0).normal(size=y.shape)
    measured[gap] = np.nan
    X = np.column_stack([T, FORCE, np.full((len(T), 2), np.nan)])
    X[0, 2:] = told
    machines = [model_machine(CART, record) for record in read_records(CART, X, measured)]
    return predict_ahead(machines, steps, np.array([max(noise, 1e-6)]))[1], y


@pytest.mark.parametrize("steps", [1, 7, 60])
def test_a_perfect_model_without_noise_makes_no_error(steps):
    found, y = ahead(CART, steps)
    assert np.abs(found - y).max() < 1e-12


def test_far_ahead_is_the_free_run():
    free = CART.simulate(T, FORCE, [0.3, 0.0]).y
    assert np.array_equal(ahead(STIFFER, len(T))[0], free)
    assert np.array_equal(ahead(STIFFER, 20)[0][:20], free[:20])


def test_it_is_the_worse_the_farther_ahead_and_better_than_the_free_run():
    found = [ahead(STIFFER, steps, noise=1e-3) for steps in (1, 5, 20, len(T))]
    errors = [np.sqrt(np.mean((each - y) ** 2)) for each, y in found]
    assert errors == sorted(errors)
    assert errors[0] < 0.05 * errors[-1]


def test_an_unknown_start_is_found():
    found, y = ahead(CART, 5, x0=(-0.5, 1.0), told=(np.nan, np.nan))
    assert np.abs(found - y)[20:].max() < 1e-3


def test_nothing_after_a_sample_matters():
    whole, _ = ahead(STIFFER, 5, noise=1e-2)
    part, _ = ahead(STIFFER, 5, noise=1e-2, gap=slice(100, 140))
    # the noise is estimated from all of the record, and chooses a little differently
    assert np.abs(whole - part)[:105].max() < 0.02 * np.abs(whole).max()


def test_over_a_gap_it_goes_on():
    found, y = ahead(STIFFER, 1, noise=1e-3, gap=slice(60, 90))
    assert np.isfinite(found).all()
    assert np.abs(found - y)[-40:].max() < 0.05


@pytest.mark.parametrize("steps", [0, 1.5, "1"])
def test_steps_that_are_none(steps):
    with pytest.raises(OptionError, match="steps: expected an integer >= 1"):
        predict_ahead([], steps, np.ones(1))


def test_what_comes_later_changes_nothing():
    whole, _ = ahead(STIFFER, 5, noise=0.01)
    X = np.column_stack([T, FORCE, np.full((len(T), 2), np.nan)])
    X[0, 2:] = 0.3, 0.0
    y = STIFFER.simulate(T, FORCE, [0.3, 0.0]).y
    y = y + 0.01 * np.random.default_rng(0).normal(size=y.shape)
    y[100:] += 3 * np.random.default_rng(1).normal(size=y[100:].shape)
    machines = [model_machine(CART, record) for record in read_records(CART, X, y)]
    found = predict_ahead(machines, 5, np.array([0.01]))[1]
    assert np.array_equal(found[:105], whole[:105])
