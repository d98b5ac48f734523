"""What describes a formula: the quantities in it, and the share that they explain."""

from types import SimpleNamespace

import numpy as np
import pytest
from sledge import SLEDGE, drive

from sklearn_pgnn.diagnosis import description
from sklearn_pgnn.effects import Formula
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.simulation.hidden_input import HiddenInput
from sklearn_pgnn.trajectories import read_records


@pytest.mark.parametrize("short", [1, 3, 6])
def test_records_may_differ_so_much_that_most_keep_no_row(short, monkeypatch):
    X, y = drive(n_records=1 + short, samples=1200)
    kept = (X.trajectory == 0) | (X.t < 0.599)
    problem = build_problem(SLEDGE, read_records(SLEDGE, X[kept], y[kept]))
    assert np.diff(problem.windows.bounds).tolist() == [1200, *[30] * short]
    v = problem.windows.y
    hidden = HiddenInput("v", v[:, 0] ** 3, np.ones(len(v)), v)
    trial = HypothesisFitter(problem).base()
    proposal = SimpleNamespace(effect=Formula("v", ("v**3",), (1.0,)), hidden=hidden, trial=trial)
    monkeypatch.setattr(description, "SAMPLES", 20)
    assert description.describe(problem, proposal).quantities == ("v",)
