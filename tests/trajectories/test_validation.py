"""A table without names, after one with names: its columns are those of fit, in their order."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.metrics import r2_score
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.tree import DecisionTreeRegressor

from sklearn_pgnn import (
    ConformalRegressor,
    EnsembleRegressor,
    GreyBoxRegressor,
    ModelDiagnosis,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
    SINDYcRegressor,
    effects,
)
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.model_selection import TrajectoryKFold

pytestmark = pytest.mark.core

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "F - d*v - 9*x"},
    {"d": 0.5},
    {"F": "N"},
    outputs={"position": "x"},
)
T = np.tile(np.arange(100) * 0.05, 2)
# the columns stand in another order than the model's
X = pd.DataFrame({"F": np.sin(T * np.repeat([1.0, 2.0], 100)), "v": -0.3, "t": T, "x": 0.5})
Y = np.concatenate(
    [CART.with_parameters(d=0.8).simulate(T[:100], X["F"][k : k + 100], [0.5, -0.3]).y[:, 0]
     for k in (0, 100)]
)  # fmt: skip

FITS = [
    PhysicsModelRegressor(CART),
    ResidualRegressor(CART),
    SINDYcRegressor(CART),
    GreyBoxRegressor(CART),
]


@pytest.mark.parametrize("estimator", FITS, ids=lambda each: type(each).__name__)
def test_weights_of_samples_are_refused_before_any_work(estimator):
    name = type(estimator).__name__
    with pytest.raises(OptionError) as caught:
        estimator.fit(X, Y, sample_weight=np.ones(len(X)))
    assert str(caught.value) == (
        f"sample_weight: expected none, for {name} weighs all measured samples alike. Remedy: "
        f"leave it out; a sample whose y is NaN does not count."
    )
    with pytest.raises(TypeError, match=f"{name}.fit: expected X and y, got 'groups' as well. Re"):
        estimator.fit(X, Y, groups=None)
    assert not [each for each in vars(estimator) if each.endswith("_")]


def test_no_weights_are_no_weights():
    expected = ResidualRegressor(CART).fit(X, Y).predict(X)
    found = ResidualRegressor(CART).fit(X, Y, sample_weight=None).predict(X)
    np.testing.assert_array_equal(found, expected)


TRANSFORMERS = [
    PhysicsModelTransformer(CART),
    PhysicsModelTransformer(CART, append=False),
    PhysicsModelTransformer(CART, append="all"),
    PhysicsModelTransformer(CART).set_output(transform="pandas"),
    PhysicsModelTransformer(),
]


@pytest.mark.parametrize("as_array", [pd.DataFrame.to_numpy, lambda X: pd.DataFrame(X.to_numpy())])
@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART, search="local"),
        ResidualRegressor(CART),
        ResidualRegressor(),
        make_pipeline(PhysicsModelTransformer(CART), LinearRegression()),
    ],
)
def test_predictions_are_those_of_the_columns_of_fit(estimator, as_array):
    expected = estimator.fit(X, Y).predict(X)
    with pytest.warns(UserWarning, match="does not have valid feature names"):
        found = estimator.predict(as_array(X))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("transformer", TRANSFORMERS)
def test_simulations_are_those_of_the_columns_of_fit(transformer):
    expected = transformer.fit(X).transform(X)
    with pytest.warns(UserWarning, match="does not have valid feature names"):
        found = transformer.transform(X.to_numpy())
    pd.testing.assert_frame_equal(found, expected)


def test_measured_outputs_of_an_array_go_in_too():
    fitted = PhysicsModelRegressor(CART, search="local").fit(X, Y)
    with pytest.warns(UserWarning, match="does not have valid feature names"):
        assert fitted.score(X.to_numpy(), Y) == fitted.score(X, Y)


# -- scores of records with gaps: of what was measured, output by output ---------------------------

SPRUNG = PhysicsModel(
    {"x": "m", "v": "m/s"}, {"x": "v", "v": "F - d*v - 9*x"}, {"d": 0.5}, {"F": "N"}
)
RIDE_T = np.tile(np.arange(100) * 0.05, 4)
RIDES = pd.DataFrame({"t": RIDE_T, "F": np.sin(RIDE_T * np.repeat([1.0, 2.0, 3.0, 4.0], 100))})
PARTS = RIDES["F"].to_numpy().reshape(4, 100)
TRUTH = SPRUNG.replace(equations={"x": "v", "v": "F - 0.8*v - 9*x - x**3"})
RIDDEN = np.concatenate([TRUTH.simulate(RIDE_T[:100], part).y for part in PARTS])
RIDDEN += 0.02 * np.random.default_rng(0).normal(size=RIDDEN.shape)
GAPPY = RIDDEN.copy()
GAPPY[::2, 0] = GAPPY[1::2, 1] = np.nan  # no row has both

TREE = DecisionTreeRegressor(max_depth=2)
REGRESSORS = [
    PhysicsModelRegressor(SPRUNG, search="local"),
    ResidualRegressor(SPRUNG),
    ConformalRegressor(ResidualRegressor(SPRUNG)),
    EnsembleRegressor(ResidualRegressor(SPRUNG, TREE), 2),
    GreyBoxRegressor(SPRUNG, depths=("prior", "fitted")),
    ModelDiagnosis(SPRUNG, catalogue=(effects.QuadraticDrag,), max_causes=1),
]


@pytest.mark.parametrize("estimator", REGRESSORS)
def test_without_gaps_it_is_that_of_scikit_learn(estimator):
    weight, predicted = np.arange(len(RIDES)), estimator.fit(RIDES, RIDDEN).predict(RIDES)
    assert estimator.score(RIDES, RIDDEN) == pytest.approx(r2_score(RIDDEN, predicted))
    weighed = r2_score(RIDDEN, predicted, sample_weight=weight)
    assert estimator.score(RIDES, RIDDEN, sample_weight=weight) == pytest.approx(weighed)


@pytest.mark.parametrize("estimator", REGRESSORS)
def test_samples_without_a_measurement_are_left_out_output_by_output(estimator):
    predicted, weight = estimator.fit(RIDES, RIDDEN).predict(RIDES), np.arange(len(RIDES))
    expected = [
        r2_score(RIDDEN[k::2, i], predicted[k::2, i], sample_weight=weight[k::2])
        for i, k in ((0, 1), (1, 0))
    ]
    assert estimator.score(RIDES, GAPPY, weight) == pytest.approx(np.mean(expected))
    one = GAPPY.copy()
    one[:, 1] = np.nan
    assert estimator.score(RIDES, one) == pytest.approx(
        r2_score(RIDDEN[1::2, 0], predicted[1::2, 0])
    )


def test_records_with_gaps_can_be_cross_validated():
    scores = cross_val_score(REGRESSORS[0], RIDES, GAPPY, cv=TrajectoryKFold(2))
    assert (scores > 0.9).all()
    gappy = np.where(np.arange(len(RIDES)) % 5, RIDES["F"], np.nan)
    assert ResidualRegressor().fit(RIDES, gappy).score(RIDES, gappy) == pytest.approx(1)


def test_nothing_to_score_by_is_said():
    fitted = ResidualRegressor(SPRUNG).fit(RIDES, RIDDEN)
    with pytest.raises(RecordError, match="expected a measured sample to score by"):
        fitted.score(RIDES, np.full_like(RIDDEN, np.nan))
    with pytest.raises(RecordError, match=r"expected shape \(400, 2\)"):
        fitted.score(RIDES, RIDDEN[:5])
    with pytest.raises(RecordError, match=r"expected shape \(400, 1\), as predictions have"):
        ResidualRegressor().fit(RIDES, RIDDEN[:, 0]).score(RIDES, RIDDEN)
