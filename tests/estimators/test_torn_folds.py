"""Tools that draw, permute or leave out rows and columns are refused by every estimator."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
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
