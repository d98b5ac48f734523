"""Estimators of other authors drop in behind the physics, and nothing measured leaks."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import loguniform
from sklearn.base import clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.ensemble import RandomForestRegressor
from sklearn.experimental import enable_halving_search_cv  # noqa: F401
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, HalvingRandomSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from sklearn_pgnn import PhysicsModelRegressor, PhysicsModelTransformer, systems
from sklearn_pgnn.estimators.residual_regressor import ResidualRegressor
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.model_selection import TrajectoryKFold

GOLF = systems.golf_robot()
STATES = list(GOLF.states)
FOREST = RandomForestRegressor(20, min_samples_leaf=5, random_state=0)


@pytest.fixture(scope="module")
def measured():
    """Return records with the states in every row, and the same with those of the first only."""
    rng = np.random.default_rng(0)
    frames = []
    for name in range(3):
        t = np.arange(200) * 0.01
        torque = 0.3 * np.sin(rng.uniform(2, 6) * t)
        run = GOLF.simulate(t, torque, [0.1 * name, 0.0], substeps=4)
        frame = pd.DataFrame({"trajectory": name, "t": t, "torque": torque})
        frame[STATES] = run.x + rng.normal(scale=1e-3, size=run.x.shape)
        frames.append(frame.assign(y=run.y[:, 0] + rng.normal(scale=1e-3, size=t.size)))
    X = pd.concat(frames, ignore_index=True)
    y, X = X["y"].to_numpy(), X.drop(columns="y")
    poisoned = X.copy()
    poisoned.loc[X.groupby("trajectory").cumcount() > 0, STATES] = np.nan
    return X, poisoned, y


def behind_physics(regressor):
    return make_pipeline(PhysicsModelTransformer(GOLF), clone(regressor))


# -- searches, scores, targets, tables -------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("regressor", [FOREST, Ridge()], ids=["forest", "ridge"])
def test_any_regressor_stands_behind_the_physics(golf, regressor):
    X, y = golf
    scores = cross_val_score(behind_physics(regressor), X, y, cv=TrajectoryKFold(3))
    assert scores.min() > 0.8
    without = X[["t", "torque"]]  # what the simulation adds is what makes it good
    alone = cross_val_score(regressor, without, y, cv=TrajectoryKFold(3))
    assert scores.min() > alone.max() + 0.2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("regressor", "grid"),
    [
        (FOREST, {"randomforestregressor__min_samples_leaf": [5, 500]}),
        (Ridge(), {"ridge__alpha": [1e-3, 1e6]}),
    ],
    ids=["forest", "ridge"],
)
def test_grid_search(golf, regressor, grid):
    X, y = golf
    search = GridSearchCV(behind_physics(regressor), grid, cv=TrajectoryKFold(3)).fit(X, y)
    (name, values) = next(iter(grid.items()))
    assert search.best_params_[name] == values[0]
    assert search.predict(X).shape == y.shape


@pytest.mark.slow
def test_halving_search_saves_trees_instead_of_samples(golf):
    X, y = golf
    search = HalvingRandomSearchCV(
        behind_physics(FOREST),
        {"randomforestregressor__min_samples_leaf": [5, 50, 500, 700]},
        resource="randomforestregressor__n_estimators",
        min_resources=3,
        max_resources=12,
        factor=2,
        cv=TrajectoryKFold(3),
        random_state=0,
    ).fit(X, y)
    assert search.n_resources_ == [3, 6, 12]
    assert search.best_params_["randomforestregressor__min_samples_leaf"] < 500


def test_halving_search_by_samples_is_refused_not_misread(golf):
    X, y = golf
    search = HalvingRandomSearchCV(
        behind_physics(Ridge()),
        {"ridge__alpha": loguniform(1e-6, 1e3)},
        resource="n_samples",
        min_resources=300,
        cv=TrajectoryKFold(3),
        random_state=0,
        error_score="raise",
    )
    with pytest.raises(RecordError, match="HalvingBayesSearchCV for HalvingGridSearchCV"):
        search.fit(X, y)


def test_target_may_be_transformed(golf):
    X, y = golf
    plain = behind_physics(Ridge(1e-9)).fit(X, y)
    scaled = TransformedTargetRegressor(behind_physics(Ridge(1e-9)), transformer=StandardScaler())
    assert scaled.fit(X, y).predict(X) == pytest.approx(plain.predict(X), abs=1e-6)
    # an angle given in degrees: the model is fitted in its own unit, what comes out is in degrees
    radians = PhysicsModelRegressor(GOLF, free=["d"], search="local")
    degrees = TransformedTargetRegressor(radians, func=np.deg2rad, inverse_func=np.rad2deg)
    expected = np.rad2deg(clone(radians).fit(X, y).predict(X))
    assert degrees.fit(X, np.rad2deg(y)).predict(X) == pytest.approx(expected, abs=1e-6)


def test_output_may_be_a_table(golf):
    X, y = golf
    pipeline = behind_physics(FOREST).set_output(transform="pandas").fit(X, y)
    names = ["t", "torque", "phi", "omega", "phi_phy", "omega_phy", "phi_measured_phy"]
    assert list(pipeline[-1].feature_names_in_) == names
    arrays = behind_physics(FOREST).fit(X, y)
    assert np.array_equal(pipeline.predict(X), arrays.predict(X))


# -- leakage ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "estimator",
    [
        behind_physics(Ridge()),
        behind_physics(FOREST),
        PhysicsModelRegressor(GOLF, free=["d"], search="local"),
        ResidualRegressor(GOLF),
        ResidualRegressor(GOLF, FOREST),
    ],
    ids=["ridge", "forest", "physics", "residual", "residual forest"],
)
def test_measured_states_after_the_first_row_change_no_prediction(measured, estimator):
    X, poisoned, y = measured
    fitted = clone(estimator).fit(X, y)
    assert np.isfinite(fitted.predict(poisoned)).all()
    assert np.array_equal(fitted.predict(poisoned), fitted.predict(X))
    blind = clone(estimator).fit(poisoned, y)
    assert np.array_equal(blind.predict(X), fitted.predict(X))


# -- a transformer without a model -----------------------------------------------------------------


@parametrize_with_checks([PhysicsModelTransformer()])
def test_scikit_learn_checks(estimator, check):
    check(estimator)


def test_transformer_without_a_model_passes_everything_on(golf):
    X, _ = golf
    transformer = PhysicsModelTransformer().fit(X)
    pd.testing.assert_frame_equal(transformer.transform(X), X)
    assert list(transformer.get_feature_names_out()) == list(X.columns)
    numbers = X.drop(columns="trajectory")
    as_table = PhysicsModelTransformer().set_output(transform="pandas").fit_transform(numbers)
    pd.testing.assert_frame_equal(as_table, numbers)
    assert np.array_equal(PhysicsModelTransformer().fit_transform(X[["t"]].to_numpy()), X[["t"]])


def test_search_may_choose_whether_to_simulate(golf):
    X, y = golf
    grid = {"physicsmodeltransformer__model": [None, GOLF]}
    X = X[["t", "torque"]]
    search = GridSearchCV(behind_physics(Ridge()), grid, cv=TrajectoryKFold(3)).fit(X, y)
    assert search.best_params_["physicsmodeltransformer__model"] is GOLF
