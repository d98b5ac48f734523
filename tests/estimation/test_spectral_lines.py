"""Spectral lines: a tone is heard through noise, a ripple through a spring."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.spectral_lines import ripples_left, tones_left
from sklearn_pgnn.trajectories import read_records


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [0.83, 7.3, 23.1])
def test_a_tone_in_what_is_left_is_heard_through_noise_of_four_times_its_power(frequency):
    hidden = make_hidden_effect(n_records=3, duration=8, sample_rate=60, random_state=0)
    problem = build_problem(hidden.prior, read_records(hidden.prior, hidden.X, hidden.y))
    t = problem.windows.t
    noise = np.random.default_rng(0).standard_normal(t.size) * np.sqrt(2)
    left = np.sin(2 * np.pi * frequency * t) + noise
    left[::7] = np.nan
    tones = np.array(tones_left(problem.windows, left[:, None]))
    assert np.abs(tones - frequency).min() < 1 / 8


SHAFT = PhysicsModel(
    {"phi": "rad", "w": "rad/s", "twist": "rad", "w_l": "rad/s"},
    {
        "phi": "w",
        "w": "(M - c*twist - b*(w - w_l))/J",
        "twist": "w - w_l",
        "w_l": "(c*twist + b*(w - w_l) - d*w_l)/J_l",
    },
    {"J": 0.01, "J_l": 0.02, "c": 4.0, "b": 0.02, "d": 0.05},
    {"M": "N m"},
    {"angle": "phi"},
)


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.7, 2.4, 5.3])
def test_a_ripple_is_found_where_no_sensor_shows_the_twist_of_a_shaft(period):
    """The rate that a model lacks is lost there; what the outputs show of it is not."""
    rig = SHAFT + effects.Cogging("w", sine=0.1, cosine=0.05, period=period)
    t, rng = np.arange(0, 10, 0.01), np.random.default_rng(0)
    M = 0.5 * np.sin(2 * np.pi * 0.2 * t)[:, None]
    y = rig.simulate(t, M, substeps=5).y + 1e-3 * rng.standard_normal((t.size, 1))
    X = pd.DataFrame({"trajectory": 0, "t": t, "M": M[:, 0]})
    problem = build_problem(SHAFT, read_records(SHAFT, X, pd.DataFrame(y, columns=["angle"])))
    fit, windows = HypothesisFitter(problem).base().fit, problem.windows
    x = problem.states.estimate(fit.model).x
    found = np.array(ripples_left(windows, fit, x, np.arange(len(windows)))["w"])
    cycles = np.ptp(x[:, 0]) / found
    assert np.abs(cycles - np.ptp(x[:, 0]) / period).min() < 0.5
