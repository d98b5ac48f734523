"""States in free run from every estimator of trajectories."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import (
    GreyBoxRegressor,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
    SINDYcRegressor,
    make_pgnn_pipeline,
)

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "force - 9*x - d*v"},
    {"d": 0.5},
    {"force": "N"},
    outputs={"position": "x"},
)


def records(n=3):
    frames, outputs, states = [], [], []
    for i in range(n):
        t = np.arange(0, 10, 0.02)
        force = 4 * np.sin((i + 1) * t**2 / 8)
        run = CART.simulate(t, force, [0.1 * i, 0.0])
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": 0.1 * i, "v": 0}))
        outputs.append(run.y[:, 0])
        states.append(run.x)
    order = np.random.default_rng(0).permutation(n * t.size)  # rows of trajectories interleaved
    order = order[np.lexsort((np.tile(t, n)[order],))]
    X = pd.concat(frames, ignore_index=True).iloc[order]
    return X, np.concatenate(outputs)[order], np.concatenate(states)[order]


@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART, search="local"),
        GreyBoxRegressor(CART, depths=("fitted",)),
        SINDYcRegressor(CART, degree=1),
        PGNNLRegressor(CART, module__neurons=3, max_epochs=3, refine=None),
        ResidualRegressor(CART),
    ],
    ids=lambda each: type(each).__name__,
)
def test_the_states_are_those_behind_the_outputs(estimator):
    X, y, states = records()
    found = estimator.fit(X, y).predict_states(X)
    assert found.shape == states.shape
    assert np.allclose(found[:, 0], estimator.predict(X), atol=1e-6)
    assert np.sqrt(np.mean((found - states) ** 2)) < 0.05 * states.std()


@pytest.mark.parametrize("estimator", [SINDYcRegressor(), PGNNLRegressor(max_epochs=2)])
def test_independent_rows_have_none(estimator):
    A = np.random.default_rng(0).normal(size=(100, 3))
    with pytest.raises(ValueError, match="have no states"):
        estimator.fit(A, A[:, :1] ** 2).predict_states(A)


def test_without_a_model_a_residual_has_none():
    A = np.random.default_rng(0).normal(size=(100, 3))
    with pytest.raises(ValueError, match="predict_states: expected a regressor with a model"):
        ResidualRegressor().fit(A, A[:, :1]).predict_states(A)


def test_a_pipeline_gives_them_by_its_last_step():
    X, y, _ = records(2)
    order = np.lexsort((X["t"], X["trajectory"]))
    X, y = X.iloc[order], y[order]
    pipeline = make_pgnn_pipeline(CART, module__neurons=3, max_epochs=1, refine=None).fit(X, y)
    before = pipeline[:-1].transform(X)
    assert pipeline[-1].predict_states(before).shape == (len(X), 2)
    assert np.isfinite(pipeline[-1].predict_ahead(before, y)).all()
