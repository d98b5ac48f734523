"""scikit-learn's own checks, on every estimator with a model.

The checks bring tables of random numbers of one to ten columns. A physical model says which columns
there are, and time must increase, so that most checks end at the reader: the first test counts that
nothing else fails. Behind a step that takes the row's number as the time [s] and the first column
as the input, any table is a record: the second test names what still cannot hold, and why.
"""

import joblib
import numpy as np
import pytest
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import check_estimator, parametrize_with_checks
from sklearn.utils.validation import check_is_fitted, validate_data

from sklearn_pgnn import (
    GreyBoxRegressor,
    ModelDiagnosis,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
    SINDYcRegressor,
)
from sklearn_pgnn.exceptions import RecordError

LAG = PhysicsModel({"y": "V"}, {"y": "(K*u - y)/T"}, {"K": 1.0, "T": 2.0}, {"u": "V"})
ESTIMATORS = [
    PhysicsModelTransformer(LAG),
    PhysicsModelRegressor(LAG, search="local"),
    ResidualRegressor(LAG),
    SINDYcRegressor(LAG),
    PGNNLRegressor(LAG, max_epochs=2, refine=None),
    GreyBoxRegressor(LAG, depths=["prior", "fitted"], n_splits=2),
]
#: how the reader refuses columns that the model forbids
OF_THE_COLUMNS = (
    "X: expected the columns",  # of another number
    "X: trajectory '0' has",  # whose first one is no time: it does not increase
    "X: expected the rows of a trajectory in the order of their time",  # the same
    "X: column 't' is nan",  # where only states may be
    "X: the time is standardised",  # as some checks do with all that they bring
)

OF_TIME = {
    "check_methods_sample_order_invariance": "a simulation depends on the order in time",
    "check_methods_subset_invariance": "a simulation depends on what came before",
}
OF_SKORCH = {
    "check_no_attributes_set_in_init": "skorch keeps an empty history there",
}
OF_A_PIPELINE = {
    "check_estimators_overwrite_params": "a Pipeline fits its steps in place",
    "check_dont_overwrite_parameters": "a Pipeline fits its steps in place",
}
OF_A_REGRESSOR = {
    "check_regressor_multioutput": "brings five outputs; the model has one",
    "check_supervised_y_no_nan": "wants scikit-learn's own words of a Pipeline",
}


def is_of_the_columns(error) -> bool:
    """Whether an error is the reader's refusal of columns, or was raised while handling it."""
    while error is not None:
        if isinstance(error, RecordError):
            return str(error).startswith(OF_THE_COLUMNS)
        error = error.__cause__ or error.__context__
    return False


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "estimator", [*ESTIMATORS, ModelDiagnosis(LAG, catalogue=())], ids=lambda e: type(e).__name__
)
def test_only_columns_that_the_model_forbids_fail(estimator):
    results = check_estimator(estimator, on_fail=None, on_skip=None)
    failed = [each for each in results if each["status"] == "failed"]
    others = {e["check_name"] for e in failed if not is_of_the_columns(e["exception"])}
    allowed = OF_SKORCH if isinstance(estimator, PGNNLRegressor) else {}
    assert others == set(allowed)
    assert len(results) > 45


class AsRecord(TransformerMixin, BaseEstimator):
    """Take the row's number as the time [s] and the first column as the input."""

    def fit(self, X, y=None):
        validate_data(self, X)
        return self

    def transform(self, X):
        check_is_fitted(self)
        X = validate_data(self, X, reset=False)
        return np.column_stack([np.arange(len(X)), X[:, 0]])

    def get_feature_names_out(self, input_features=None):
        return np.array(["t", "u"], dtype=object)


def cannot_hold(pipeline):
    transforms = isinstance(pipeline[-1], PhysicsModelTransformer)
    return OF_TIME | OF_A_PIPELINE | ({} if transforms else OF_A_REGRESSOR)


@pytest.mark.filterwarnings("ignore::UserWarning")
@parametrize_with_checks(
    [make_pipeline(AsRecord(), each) for each in ESTIMATORS],
    expected_failed_checks=cannot_hold,
)
def test_scikit_learn_checks_of_records(estimator, check):
    check(estimator)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: type(e).__name__)
def test_a_map_of_its_file_is_enough(estimator, tmp_path):
    t = np.arange(0, 10, 0.1)
    X = np.column_stack([t, np.sin(t)])
    estimator.fit(X, 1.1 * LAG.simulate(t, X[:, 1]).y)
    joblib.dump(estimator, tmp_path / "it.joblib")
    mapped = joblib.load(tmp_path / "it.joblib", mmap_mode="r")
    name = "predict" if hasattr(estimator, "predict") else "transform"
    assert np.array_equal(getattr(mapped, name)(X), getattr(estimator, name)(X))
