"""The same record given twice is told by every command, whatever it is called."""

import numpy as np
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, PhysicsModelRegressor
from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.record import repeated_records

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 0.5}, {"u": "V"})


def tables(late=0.0, other=0.0):
    """Return three records, the last one as the first, `late` on its clock."""
    t = 0.05 * np.arange(300)
    rng = np.random.default_rng(0)
    u = [np.repeat(rng.normal(size=15), 20) for _ in range(2)]
    y = [LAG.simulate(t, each).y + 0.01 * rng.normal(size=(300, 1)) for each in u]
    X = [np.c_[t, u[0]], np.c_[t, u[1]], np.c_[t + late, u[0]]]
    return np.vstack(X), np.vstack([*y, y[0] + other])


@pytest.mark.parametrize("late", [0.0, 12.3])
def test_equal_values_are_told_though_name_and_clock_differ(late):
    assert repeated_records(read_records(LAG, *tables(late))) == [("0", "2")]
    assert repeated_records(read_records(LAG, *tables(late, other=1e-6))) == []


def test_a_fit_warns_of_it():
    with pytest.warns(RecordWarning, match="record '2' has the same values as '0'. Remedy: give"):
        PhysicsModelRegressor(LAG, search="local").fit(*tables())


@pytest.mark.slow
def test_a_diagnosis_tells_it():
    found = ModelDiagnosis(LAG, catalogue=()).fit(*tables()).data_quality_
    assert ("repeated record", "2") in {(each.kind, each.where) for each in found}
