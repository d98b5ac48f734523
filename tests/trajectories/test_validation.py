"""A table without names, after one with names: its columns are those of fit, in their order."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from sklearn_pgnn import (
    GreyBoxRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
    SINDYcRegressor,
)
from sklearn_pgnn.exceptions import OptionError

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
