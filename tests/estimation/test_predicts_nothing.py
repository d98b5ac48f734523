"""What predicts nothing: no output better than without a model, however many records there are."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.window_selection import check_prior, select_windows
from sklearn_pgnn.trajectories import read_records

SHARE, NOISE = 0.05, 2e-3
RIG = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - k*x)/m"},
    {"m": {"value": 0.8, "bounds": [0.1, 10]}, "d": 0.9, "k": 25.0},
    {"F": "N"},
    outputs={"x": "x"},
)


def record(n_records, force=6.0, samples=600, seed=0):
    """Return X and y of a mass on a spring, under a force of some size."""
    rng, tables, outputs = np.random.default_rng(seed), [], []
    for number in range(n_records):
        t = 0.01 * np.arange(samples)
        F = force * np.sign(np.sin(rng.uniform(2.0, 5.0) * t + number))
        tables.append(pd.DataFrame({"trajectory": number, "t": t, "F": F}))
        outputs.append(RIG.simulate(t, F, [0.0, 0.0], substeps=4).y[:, 0])
    y = np.concatenate(outputs)
    return pd.concat(tables, ignore_index=True), y + NOISE * rng.normal(size=y.size)


def problem_of(model, X, y, **options):
    return build_problem(model, read_records(model, X, y), **options)


@pytest.mark.slow
@pytest.mark.parametrize("n_records", [1, 2, 4])
@pytest.mark.parametrize("rate", ["2 + 0.5*v**3", "8*x + 5*v*abs(v) - 1"])
def test_a_model_that_explodes_predicts_nothing_however_many_records_there_are(rate, n_records):
    model = RIG.replace(equations={"x": "v", "v": rate})
    fitter = select_windows(problem_of(model, *record(n_records)))
    check_prior(fitter, [str(number) for number in range(n_records)])  # it is finite somewhere
    assert fitter.predicts_nothing(fitter.base(), SHARE)


@settings(max_examples=10, deadline=None)
@given(
    force=st.sampled_from([0.0, 1e-3, 6.0]),
    window=st.sampled_from([0.2, 0.4, 2.0]),
    seed=st.integers(0, 100),
)
def test_the_right_model_is_not_said_to_predict_nothing_at_rest_or_in_short_windows(
    force, window, seed
):
    X, y = record(2, force, samples=400, seed=seed)
    fitter = HypothesisFitter(problem_of(RIG, X, y, window_length=window))
    assert not fitter.predicts_nothing(fitter.base(), SHARE)


@pytest.mark.slow
def test_a_model_that_lacks_much_predicts_something():
    """Without its damping it is far off, and yet nearer than a straight line."""
    model = RIG.with_parameters(k=23.0).replace(equations={"x": "v", "v": "(F - k*x)/m"})
    fitter = select_windows(problem_of(model, *record(2)))
    assert fitter.base().times_noise > 2.0
    assert not fitter.predicts_nothing(fitter.base(), SHARE)
