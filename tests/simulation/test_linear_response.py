"""Linear responses: what the initial states of windows explain of changes of the outputs."""

import numpy as np
import pytest
from sledge import SLEDGE, drive

from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.simulation.linear_response import linear_responses, without_states
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core


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
