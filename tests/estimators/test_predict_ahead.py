"""Predictions some samples ahead, from every estimator of trajectories."""

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
    network,
)
from sklearn_pgnn.estimators.network import step_network
from sklearn_pgnn.estimators.network.step_network import piece_run

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "force - 9*x - d*v"},
    {"d": 0.5},
    {"force": "N"},
    outputs={"position": "x"},
)
QUICK = {"module__neurons": 3, "max_epochs": 2, "refine": None, "substeps": 1}


def records(n=2, size=4.0):
    frames, outputs = [], []
    for i in range(n):
        t = 0.06 * np.arange(50)
        force = size * np.sin((i + 1) * t**2 / 3)
        outputs.append(CART.simulate(t, force, [0.1 * i, 0.0]).y[:, 0])
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": 0.1 * i, "v": 0}))
    order = np.random.default_rng(0).permutation(n * t.size)  # rows of trajectories interleaved
    order = order[np.lexsort((np.tile(t, n)[order],))]
    return pd.concat(frames, ignore_index=True).iloc[order], np.concatenate(outputs)[order]


X, Y = records()
FIRSTS = X.groupby("trajectory").cumcount().to_numpy()


@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART, search="local"),
        GreyBoxRegressor(CART, depths=("fitted",), n_splits=2),
        ResidualRegressor(CART),
        SINDYcRegressor(CART, degree=1),
        SINDYcRegressor(CART, degree=1, discrete=True),
        PGNNLRegressor(CART, **QUICK),
        PGNNLRegressor(CART, structure="increment", **QUICK),
    ],
    ids=lambda each: type(each).__name__,
)
def test_far_ahead_is_the_free_run_and_near_ahead_is_near(estimator):
    free = estimator.fit(X, Y).predict(X)
    assert np.allclose(estimator.predict_ahead(X, Y, steps=100), free, atol=1e-12)
    found = estimator.predict_ahead(X, Y, steps=10)
    assert np.allclose(found[FIRSTS < 10], free[FIRSTS < 10], atol=1e-12)
    moved = Y + 0.5  # another plant: what is measured matters
    errors = [
        np.sqrt(np.mean((each - moved)[FIRSTS > 20] ** 2))
        for each in (estimator.predict_ahead(X, moved), free)
    ]
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(CART, search="local"),
        ResidualRegressor(CART),
        SINDYcRegressor(CART, degree=1),
        SINDYcRegressor(CART, degree=1, discrete=True),
        PGNNLRegressor(CART, **QUICK),
    ],
    ids=lambda each: type(each).__name__,
)
def test_short_trajectories_and_those_without_y_are_the_free_run(estimator):
    free = estimator.fit(X, Y).predict(X)
    for n in (1, 3):
        first = n >= FIRSTS + 1
        assert np.allclose(estimator.predict_ahead(X[first], Y[first], steps=20), free[first])
    blind = X["trajectory"].to_numpy() == 1
    found = estimator.predict_ahead(X, np.where(blind, np.nan, Y + 0.5), steps=2)
    assert np.allclose(found[blind], free[blind], atol=1e-6)
    assert np.abs(found - free)[~blind].max() > 0.1


@pytest.mark.parametrize("estimator", [SINDYcRegressor(), PGNNLRegressor(max_epochs=2)])
def test_independent_rows_have_no_state(estimator):
    A = np.random.default_rng(0).normal(size=(60, 3))
    with pytest.raises(ValueError, match="have no states"):
        estimator.fit(A, A[:, :1] ** 2).predict_ahead(A, A[:, :1])


def test_a_hidden_state_is_refused():
    net = PGNNLRegressor(CART, module=network.Recurrent, **QUICK).fit(X, Y)
    with pytest.raises(ValueError, match="without a hidden state, got Recurrent"):
        net.predict_ahead(X, Y)


def test_a_residual_needs_a_model():
    A = np.random.default_rng(0).normal(size=(60, 3))
    with pytest.raises(ValueError, match="expected a regressor with a model"):
        ResidualRegressor().fit(A, A[:, 0]).predict_ahead(A, A[:, 0])


def test_the_noise_is_that_of_the_training():
    later = Y + 0.5 * np.random.default_rng(0).normal(size=Y.shape) * (FIRSTS > 30)
    for estimator in (PhysicsModelRegressor(CART, search="local"), ResidualRegressor(CART)):
        estimator.fit(X, Y)
        a, b = (estimator.predict_ahead(X, y, steps=5) for y in (Y, later))
        assert np.array_equal(a[FIRSTS <= 35], b[FIRSTS <= 35])
    told = PhysicsModelRegressor(CART, search="local", noise_std=[0.2]).fit(X, Y)
    assert told.noise_ == pytest.approx([0.2])


def test_a_network_is_prepared_once_for_all_pieces(monkeypatch):
    net, read = PGNNLRegressor(CART, **QUICK).fit(X, Y), []
    of = step_network.weights_of
    monkeypatch.setattr(step_network, "weights_of", lambda core: read.append(core) or of(core))
    net.predict_ahead(X, Y)
    assert len(read) == 1


def test_outputs_of_a_network_ahead_are_those_of_its_prediction():
    felt = CART.replace(outputs={"felt": "2*x + 0.1*force - t/10", "v": "v", "level": "d"})
    y = np.column_stack([2 * Y, np.zeros(len(Y)), np.full(len(Y), 0.5)])
    net = PGNNLRegressor(felt, **QUICK).fit(X, y)
    free = net.predict(X)
    assert net.predict_ahead(X, y, steps=50) == pytest.approx(free, rel=1e-12, abs=1e-15)
    runs = net._read_ready(X, y)
    along = piece_run(net.module_.core, net.step_)
    states, outputs = along(runs.ready[0], runs.kept[0], 0, 1, runs.ready[0].x0)
    rows = runs.records[0].rows[:2]
    assert outputs == pytest.approx(free[rows], rel=1e-12, abs=1e-15)
    assert states == pytest.approx(net.predict_states(X)[rows], rel=1e-12, abs=1e-15)
