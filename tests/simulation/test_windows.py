"""Windows: how they are cut, thinned and summed, and what their initial states explain."""

from dataclasses import replace

import numpy as np
import pytest
from sledge import SLEDGE, drive

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.simulation import simulate
from sklearn_pgnn.simulation.linear_response import linear_responses, without_states
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core


def test_thinned_windows_hold_the_mean_of_the_inputs():
    t, u = np.arange(10.0), np.arange(10.0)[:, None]
    bounds = np.array([0, 10])
    windows = ShootingWindows(t, u, u, bounds, np.array([0, 5]), np.array([5, 5]), np.ones(1))
    thin = windows.thin(2)
    np.testing.assert_array_equal(thin.t, [0, 2, 4, 5, 7, 9])
    np.testing.assert_array_equal(thin.u[:, 0], [0.5, 2.5, 4.0, 5.5, 7.5, 9.0])
    np.testing.assert_array_equal(thin.starts, [0, 3])
    np.testing.assert_array_equal(thin.bounds, [0, 6])
    np.testing.assert_array_equal(replace(windows, hold="foh").thin(2).u, thin.t[:, None])


def test_thinned_records_keep_what_lies_between_windows():
    t, u = np.arange(12.0), np.arange(12.0)[:, None]
    bounds = np.array([0, 12])
    windows = ShootingWindows(t, u, u, bounds, np.array([1, 8]), np.array([4, 4]), np.ones(1))
    thin = windows.thin(2)
    np.testing.assert_array_equal(thin.t, [0, 1, 3, 5, 7, 8, 10])
    np.testing.assert_array_equal(thin.t[thin.starts], t[windows.starts])
    np.testing.assert_array_equal(thin.lengths, [2, 2])


def test_a_window_goes_through_a_gap_in_steps_as_fine_as_elsewhere():
    spring = PhysicsModel(
        {"x": "m", "v": "m/s"}, {"x": "v", "v": "F - k*x - d*v"}, {"k": 400.0, "d": 2.0},
        {"F": "N"}, outputs={"position": "x"},
    )  # fmt: skip
    whole = np.arange(400) * 0.01
    t = np.delete(whole, np.arange(100, 140))
    u, x0 = np.ones((t.size, 1)), np.array([0.1, 0.0])
    run = simulate(spring, t, u, x0, substeps=2)
    windows = ShootingWindows(
        t, u, run.y, np.array([0, t.size]), np.array([0]), np.array([t.size]), np.ones(1),
        substeps=2,
    )  # fmt: skip
    found = evaluate(spring, windows, x0[None], ("k",))
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-12)
    # and the gap is bridged as exactly as a record without it
    through = simulate(spring, whole, np.ones((whole.size, 1)), x0, substeps=2)
    np.testing.assert_allclose(run.y[100:], through.y[140:], atol=1e-6)


def test_changes_of_samples_that_were_not_measured_do_not_count():
    X, y = drive(SLEDGE, n_records=1)
    y = y.copy()
    y.iloc[1::2] = np.nan
    problem = build_problem(SLEDGE, read_records(SLEDGE, X, y))
    windows = problem.windows
    x0 = problem.states.estimate(SLEDGE).x[windows.starts]
    theta = np.ones((windows.t.size, 1))
    table, by_state = linear_responses(SLEDGE, windows, x0, "v", theta)
    unmeasured = np.isnan(windows.y)
    other, other_by_state = table.copy(), by_state.copy()
    other[unmeasured], other_by_state[unmeasured] = 1e3, -1e3
    left = without_states(windows, table, by_state)
    np.testing.assert_array_equal(without_states(windows, other, other_by_state), left)
    assert not left[unmeasured[windows.rows].ravel()].any()
    assert left.any()
