"""Spectral lines: a tone is heard through noise."""

import numpy as np
import pytest

from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.spectral_lines import tones_left
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
