"""States in free run from every estimator of trajectories."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import (
    GreyBoxRegressor,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    SINDYcRegressor,
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
    ],
    ids=lambda each: type(each).__name__,
)
def test_the_states_are_those_behind_the_outputs(estimator):
    X, y, states = records()
    found = estimator.fit(X, y).predict_states(X)
    assert found.shape == states.shape
    assert np.allclose(found[:, 0], estimator.predict(X))
    assert np.sqrt(np.mean((found - states) ** 2)) < 0.05 * states.std()


@pytest.mark.parametrize("estimator", [SINDYcRegressor(), PGNNLRegressor(max_epochs=2)])
def test_independent_rows_have_none(estimator):
    A = np.random.default_rng(0).normal(size=(100, 3))
    with pytest.raises(ValueError, match="have no states"):
        estimator.fit(A, A[:, :1] ** 2).predict_states(A)
