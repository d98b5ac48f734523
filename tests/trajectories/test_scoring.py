"""Scores of records with gaps: of what was measured, output by output."""

import numpy as np
import pandas as pd
import pytest
from sklearn.metrics import r2_score
from sklearn.model_selection import cross_val_score
from sklearn.tree import DecisionTreeRegressor

from sklearn_pgnn import (
    ConformalRegressor,
    EnsembleRegressor,
    GreyBoxRegressor,
    ModelDiagnosis,
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
    effects,
)
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.model_selection import TrajectoryKFold

pytestmark = pytest.mark.core

CART = PhysicsModel(
    {"x": "m", "v": "m/s"}, {"x": "v", "v": "F - d*v - 9*x"}, {"d": 0.5}, {"F": "N"}
)
T = np.tile(np.arange(100) * 0.05, 4)
X = pd.DataFrame({"t": T, "F": np.sin(T * np.repeat([1.0, 2.0, 3.0, 4.0], 100))})
PARTS = X["F"].to_numpy().reshape(4, 100)
TRUTH = CART.replace(equations={"x": "v", "v": "F - 0.8*v - 9*x - x**3"})
Y = np.concatenate([TRUTH.simulate(T[:100], part).y for part in PARTS])
Y += 0.02 * np.random.default_rng(0).normal(size=Y.shape)
GAPPY = Y.copy()
GAPPY[::2, 0] = GAPPY[1::2, 1] = np.nan  # no row has both

TREE = DecisionTreeRegressor(max_depth=2)
REGRESSORS = [
    PhysicsModelRegressor(CART, search="local"),
    ResidualRegressor(CART),
    ConformalRegressor(ResidualRegressor(CART)),
    EnsembleRegressor(ResidualRegressor(CART, TREE), 2),
    GreyBoxRegressor(CART, depths=("prior", "fitted")),
    ModelDiagnosis(CART, catalogue=(effects.QuadraticDrag,), max_causes=1),
]


@pytest.mark.parametrize("estimator", REGRESSORS)
def test_without_gaps_it_is_that_of_scikit_learn(estimator):
    weight, predicted = np.arange(len(X)), estimator.fit(X, Y).predict(X)
    assert estimator.score(X, Y) == pytest.approx(r2_score(Y, predicted))
    weighed = r2_score(Y, predicted, sample_weight=weight)
    assert estimator.score(X, Y, sample_weight=weight) == pytest.approx(weighed)


@pytest.mark.parametrize("estimator", REGRESSORS)
def test_samples_without_a_measurement_are_left_out_output_by_output(estimator):
    predicted, weight = estimator.fit(X, Y).predict(X), np.arange(len(X))
    expected = [
        r2_score(Y[k::2, i], predicted[k::2, i], sample_weight=weight[k::2])
        for i, k in ((0, 1), (1, 0))
    ]
    assert estimator.score(X, GAPPY, weight) == pytest.approx(np.mean(expected))
    one = GAPPY.copy()
    one[:, 1] = np.nan
    assert estimator.score(X, one) == pytest.approx(r2_score(Y[1::2, 0], predicted[1::2, 0]))


def test_records_with_gaps_can_be_cross_validated():
    scores = cross_val_score(REGRESSORS[0], X, GAPPY, cv=TrajectoryKFold(2))
    assert (scores > 0.9).all()
    gappy = np.where(np.arange(len(X)) % 5, X["F"], np.nan)
    assert ResidualRegressor().fit(X, gappy).score(X, gappy) == pytest.approx(1)


def test_nothing_to_score_by_is_said():
    fitted = ResidualRegressor(CART).fit(X, Y)
    with pytest.raises(RecordError, match="expected a measured sample to score by"):
        fitted.score(X, np.full_like(Y, np.nan))
    with pytest.raises(RecordError, match=r"expected shape \(400, 2\)"):
        fitted.score(X, Y[:5])
    with pytest.raises(RecordError, match=r"expected shape \(400, 1\), as predictions have"):
        ResidualRegressor().fit(X, Y[:, 0]).score(X, Y)
