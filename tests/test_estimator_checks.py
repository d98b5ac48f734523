"""scikit-learn's own checks, on every estimator that reads records.

The checks bring tables of random numbers of one to ten columns. A physical model says which columns
there are, and time must increase, so most checks would end at the reader. Here the reader is
exchanged for one that takes the row's number as the time [s] and the first column as the input;
all else is the package's. What still cannot hold says why.
"""

import numpy as np
import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

from sklearn_pgnn import (
    ModelDiagnosis,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
)
from sklearn_pgnn.trajectories import read_records

LAG = PhysicsModel({"y": "V"}, {"y": "(K*u - y)/T"}, {"K": 1.0, "T": 2.0}, {"u": "V"})
READERS = (
    "sklearn_pgnn.preprocessing.physics_model_transformer",
    "sklearn_pgnn.estimators.physics_model_regressor",
    "sklearn_pgnn.diagnosis.model_diagnosis",
)

ANY = {
    "check_estimators_pickle": "puts NaN everywhere; only states may hold it, not time or inputs",
    "check_methods_sample_order_invariance": "a simulation depends on the order in time",
    "check_methods_subset_invariance": "a simulation depends on what came before",
}
REGRESSOR = {
    **ANY,
    "check_regressor_multioutput": "brings five outputs; the model has one",
}


def read_rows(model, X, y=None, *, time=None):
    """Read any table of numbers as one record, a row a second."""
    X = np.asarray(X, dtype=float)
    return read_records(model, np.column_stack([np.arange(len(X)), X[:, 0]]), y)


@pytest.fixture(autouse=True)
def any_table_is_a_record(monkeypatch):
    for module in READERS:
        monkeypatch.setattr(f"{module}.read_records", read_rows)
    # the checks' records are shorter than what a diagnosis asks for
    monkeypatch.setattr("sklearn_pgnn.diagnosis.setting.MIN_SAMPLES", 5)


def cannot_hold(estimator):
    return ANY if isinstance(estimator, PhysicsModelTransformer) else REGRESSOR


@pytest.mark.filterwarnings("ignore::UserWarning")
@parametrize_with_checks(
    [
        PhysicsModelTransformer(LAG),
        PhysicsModelRegressor(LAG, search="local"),
        ModelDiagnosis(LAG, catalogue=()),
    ],
    expected_failed_checks=cannot_hold,
)
def test_scikit_learn_checks(estimator, check):
    check(estimator)
