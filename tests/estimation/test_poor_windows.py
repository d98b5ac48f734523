"""Windows stuck at a start of the wrong sign, at rest, or in a play, are begun elsewhere."""

import numpy as np
import pandas as pd
import pytest
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn import effects, systems
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.poor_windows import refit_poor_windows
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.simulation.window_fit import fit_windows
from sklearn_pgnn.trajectories import read_records


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 5])
def test_ways_through_zero_are_fitted_with_either_sign(seed):
    """Where a sensor shows the magnitude only, the true model leaves noise in every window."""
    cart = systems.cart_on_spring()
    options = {"n_records": 3, "sample_rate": 100.0, "random_state": seed}
    hidden = make_hidden_effect(cart, "sensor_rectification", **options)
    problem = build_problem(hidden.prior, read_records(hidden.prior, hidden.X, hidden.y))
    fitter = HypothesisFitter(problem)
    base, cause = fitter.base(), effects.SensorRectification("position")
    fit = fitter.converge(fitter.first_fit(fitter.subsample(base), cause))
    assert fitter.fit_all(fit, base).squares < 1.1 * problem.n_samples < 0.1 * base.squares


def test_a_window_that_sticks_is_begun_elsewhere():
    """Where friction holds a state at rest, no small change of its start sets it in motion."""
    rig = SLEDGE + effects.CoulombFriction("v", 1.0)
    problem = build_problem(SLEDGE, read_records(SLEDGE, *drive(rig)))
    windows, start = problem.windows, problem.states.estimate(rig)
    expected = start.x[windows.starts]
    moving = int(np.argmax(np.abs(expected[:, 0])))
    x0 = expected.copy()
    x0[moving] = 0.0
    stuck = fit_windows(rig, windows, (), expected, start.spread, x0_start=x0, max_steps=0)
    again = refit_poor_windows(stuck, windows, expected, start.spread, tolerance=1e-4)
    typical = np.median(again.evaluation.squares)
    assert stuck.evaluation.squares[moving] > 100 * typical
    assert again.evaluation.squares[moving] < 10 * typical


def test_a_play_that_does_not_begin_a_record_where_it_is_settled_is_begun_elsewhere():
    """Where the play is settled is far from where the machine stood."""
    rig = SLEDGE + effects.InputBacklash("F", width=2.0, time_constant=0.05)
    X, _ = drive(rig)
    X["F"] += 3.0
    records = (record for _, record in X.groupby("trajectory"))
    at_rest = [rig.simulate(r["t"], r[["F"]], x0=[0.0, -2.0], substeps=5).y for r in records]
    noise = NOISE * np.random.default_rng(1).normal(size=(len(X), 1))
    y = pd.DataFrame(np.concatenate(at_rest) + noise, columns=["v"])
    problem = build_problem(SLEDGE, read_records(SLEDGE, X, y))
    windows, start = problem.windows, problem.states.estimate(rig)
    expected, first = start.x[windows.starts], windows.starts == windows.bounds[windows.record]
    stuck = fit_windows(rig, windows, (), expected, start.spread, max_steps=0)
    again = refit_poor_windows(stuck, windows, expected, start.spread, tolerance=1e-4)
    typical = np.median(again.evaluation.squares)
    assert (stuck.evaluation.squares[first] > 50 * typical).all()
    assert (again.evaluation.squares[first] < 2 * typical).all()
