"""scikit-learn's own checks, on every estimator with a model.

The checks bring tables of random numbers of one to ten columns. A physical model says which columns
there are, and time must increase, so that most checks end at the reader: the first test counts that
nothing else fails. Behind a step that takes the row's number as the time [s] and the first column
as the input, any table is a record: the second test names what still cannot hold, and why. Tools
that draw, permute or leave out rows and columns are refused by every estimator.
"""

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.ensemble import BaggingRegressor
from sklearn.experimental import enable_halving_search_cv  # noqa: F401
from sklearn.feature_selection import SequentialFeatureSelector
from sklearn.inspection import permutation_importance
from sklearn.linear_model import Ridge
from sklearn.model_selection import (
    HalvingGridSearchCV,
    KFold,
    ShuffleSplit,
    cross_val_score,
    train_test_split,
)
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import check_estimator, parametrize_with_checks
from sklearn.utils.validation import check_is_fitted, validate_data

from sklearn_pgnn import (
    ConformalRegressor,
    EnsembleRegressor,
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


T = np.arange(0, 20, 0.05)
X = pd.concat(
    [pd.DataFrame({"trajectory": k, "t": T, "u": np.sin((1 + k) * T)}) for k in range(3)],
    ignore_index=True,
)
Y = pd.Series(
    np.concatenate([LAG.simulate(T, part["u"]).y[:, 0] for _, part in X.groupby("trajectory")])
)
Y += 1e-3 * np.random.default_rng(0).normal(size=len(Y))
FITTED = {
    type(each).__name__: each.fit(X, Y)
    for each in (
        PhysicsModelRegressor(LAG, search="local"),
        ResidualRegressor(LAG),
        SINDYcRegressor(LAG),
        SINDYcRegressor(),
        PGNNLRegressor(LAG, max_epochs=1, refine=None),
        PGNNLRegressor(max_epochs=1, refine=None),
        GreyBoxRegressor(LAG, depths=["prior", "fitted"], n_splits=2),
        ModelDiagnosis(LAG, catalogue=()),
        ConformalRegressor(ResidualRegressor(LAG), cv=2),
        EnsembleRegressor(PhysicsModelRegressor(LAG, search="local"), n_estimators=1),
        make_pipeline(PhysicsModelTransformer(LAG), Ridge()),
    )
}
REMEDY = "Remedy: folds by TrajectoryKFold, a split by train_validation_test_split, "


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("estimator", FITTED.values(), ids=FITTED)
@pytest.mark.parametrize("splitter", [KFold(5, shuffle=True, random_state=0), ShuffleSplit(1)])
def test_fit_predict_and_score_refuse_torn_trajectories(estimator, splitter):
    for rows in next(splitter.split(X)):
        table, measured = X.iloc[rows], Y.iloc[rows]
        calls = [
            lambda: clone(estimator).fit(table, measured),  # noqa: B023
            lambda: estimator.predict(table),  # noqa: B023
            lambda: estimator.score(table, measured),  # noqa: B023
        ]
        if not hasattr(estimator, "predict"):
            calls[1] = lambda: estimator.transform(table)  # noqa: B023
        for call in calls:
            with pytest.raises(RecordError, match=REMEDY if rows[0] < rows[1] else "TrajectoryKF"):
                call()


REGRESSOR = FITTED["PhysicsModelRegressor"]


@pytest.mark.parametrize("cv", [KFold(3), 3])
def test_whole_blocks_stay_allowed(cv):
    assert cross_val_score(REGRESSOR, X, Y, cv=cv).min() > 0.9


def test_a_permuted_split_names_the_split_to_use():
    with pytest.raises(RecordError, match="train_validation_test_split"):
        REGRESSOR.score(*train_test_split(X, Y, random_state=0)[1::2])


def test_a_bootstrap_of_arrays_names_the_ensemble_to_use():
    with pytest.raises(RecordError, match=r"BaggingRegressor.* need EnsembleRegressor"):
        BaggingRegressor(REGRESSOR, random_state=0).fit(X.assign(room=20.0), Y)
    with pytest.raises(RecordError, match="EnsembleRegressor for BaggingRegressor"):
        BaggingRegressor(REGRESSOR, random_state=0).fit(X[["t", "u"]].to_numpy(), Y)


def test_a_search_over_samples_names_the_search_to_use():
    search = HalvingGridSearchCV(REGRESSOR, {"hold": ["zoh", "foh"]}, random_state=0)
    with pytest.raises(ValueError, match="HalvingBayesSearchCV for HalvingGridSearchCV"):
        search.fit(X, Y)


def test_a_selection_of_columns_names_what_to_compare():
    selector = SequentialFeatureSelector(REGRESSOR, n_features_to_select=1, cv=KFold(3))
    with pytest.raises(ValueError, match=r"Selector, RFE.*fits with a model without"):
        selector.fit(X[["t", "u"]], Y)


def test_a_permutation_names_what_to_compare():
    with pytest.raises(RecordError, match="permutation_importance the scores of fits without an"):
        permutation_importance(REGRESSOR, X, Y, n_repeats=1, random_state=0)


def test_y_with_the_index_of_x_in_another_order_is_refused():
    other = Y.sample(frac=1, random_state=0)
    for call in (*(clone(each).fit for each in FITTED.values()), REGRESSOR.score):
        with pytest.raises(RecordError, match=r"y: expected the rows of X in their order.*y\.loc"):
            call(X, other)
    assert REGRESSOR.score(X, Y.set_axis(Y.index + 7)) > 0.9  # another index is read by place
