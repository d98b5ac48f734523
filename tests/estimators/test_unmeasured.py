"""Trajectories and rows without y: physics where there are no labels, and nothing else."""

import warnings

import numpy as np
import pandas as pd
import pytest
import torch
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from skorch.callbacks import Callback

from sklearn_pgnn import (
    ConformalRegressor,
    GreyBoxRegressor,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    effects,
)
from sklearn_pgnn.estimators.network.records import told_samples
from sklearn_pgnn.exceptions import RecordError, SimulationWarning
from sklearn_pgnn.model_selection import TrajectoryKFold
from sklearn_pgnn.trajectories import read_records

TANKS = PhysicsModel(
    {"h1": "m", "h2": "m"},
    {"h1": "(q - k*(h1 - h2))/A", "h2": "k*(h1 - h2)/A"},
    {"A": 2.0, "k": 0.5},
    {"q": "m^3/s"},
    outputs={"y1": "h1", "y2": "h2"},
    energy={"stored": "A*(h1 + h2)", "supplied": "q"},
)
PLANT = TANKS.replace(equations={"h1": "(q - k*tanh(h1 - h2))/A", "h2": "k*tanh(h1 - h2)/A"})
QUICK = {"max_epochs": 3, "module__neurons": 3, "refine_max_iter": 5, "substeps": 1}


def records(n, *, size=0.3, n_samples=60, seed=0):
    """Return records of two tanks as a table, and both levels."""
    rng = np.random.default_rng(seed)
    frames, outputs = [], []
    for i in range(n):
        t = 0.2 * np.arange(n_samples)
        q = size * np.repeat(rng.normal(size=n_samples // 10 + 1), 10)[:n_samples]
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "q": q, "h1": 0.0, "h2": 0.0}))
        outputs.append(PLANT.simulate(t, q, [0.0, 0.0], substeps=4).y)
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


X, Y = records(5)
BLIND = np.where((X["trajectory"] < 3).to_numpy()[:, None], Y, np.nan)
SEEN = (X["trajectory"] < 3).to_numpy()


def quick(**options):
    return PGNNLRegressor(TANKS, **{**QUICK, **options})


def same(one, other):
    return np.array_equal(one.predict(X), other.predict(X))


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"horizon": 4, "rollout_epochs": 2}, {"free": ["k"]}])
def test_without_a_weight_they_count_for_nothing(options):
    both = [quick(**options).fit(X, BLIND), quick(**options).fit(X[SEEN], Y[SEEN])]
    assert same(*both)


@pytest.mark.slow
@pytest.mark.parametrize("phase", [{"refine": None}, {"max_epochs": 1}])
def test_with_a_weight_they_count(phase):
    given = {"lambda_phy": 0.5, **phase}
    assert not same(quick(**given).fit(X, BLIND), quick(**given).fit(X[SEEN], Y[SEEN]))


def test_scaling_and_validation_are_of_the_measured_ones_alone():
    wild = X.copy()
    wild.loc[~SEEN, "q"] *= 5
    spreads = []

    class Look(Callback):
        def on_train_begin(self, net, **kwargs):
            spreads.append(net._data.spread)

    one, other = (
        quick(lambda_phy=0.5, refine=None, callbacks=[Look()]).fit(*data)
        for data in ((wild, BLIND), (X[SEEN], Y[SEEN]))
    )
    for name in ("mean", "scale", "gain", "reach"):
        assert np.array_equal(getattr(one.step_, name), getattr(other.step_, name))
    assert one._physics._residuals[0].func.__self__.reference == pytest.approx(
        other._physics._residuals[0].func.__self__.reference
    )
    assert one.interval_ == other.interval_
    assert np.array_equal(*spreads)


@pytest.mark.slow
def test_physics_holds_better_where_nothing_was_measured():
    rng = np.random.default_rng(0)
    rough = BLIND + 0.05 * rng.normal(size=BLIND.shape)
    options = {"refine_max_iter": 60, "structure": "increment", "max_epochs": 20}
    nets = [quick(lambda_phy=weight, **options).fit(X, rough) for weight in (0.0, 0.5)]
    left = [np.nanmean(net.physics_residual(X[~SEEN]) ** 2) for net in nets]
    assert left[1] < 0.1 * left[0]


def test_rows_without_y_are_no_targets_of_single_steps():
    seen = []

    class Watching(PGNNLRegressor):
        def get_loss(self, y_pred, y_true, X=None, training=False):
            seen.append(X["index"][torch.isfinite(y_true).all(-1)])
            return super().get_loss(y_pred, y_true, X, training)

    alone = X[X["trajectory"] == 0]
    ends = np.where(np.arange(60)[:, None] < 50, Y[:60], np.nan)
    Watching(TANKS, **{**QUICK, "refine": None, "validation_fraction": 0}).fit(alone, ends)
    assert torch.cat(seen).max() == 48


def test_a_short_gap_is_bridged_and_a_long_one_is_not():
    t = np.arange(200.0)
    y = np.sin(t / 2)
    y[:5] = y[50:53] = y[100:160] = y[190:] = np.nan
    table = pd.DataFrame({"t": t, "u": 0.0})
    lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    (told,) = told_samples(read_records(lag, table, y))
    assert np.flatnonzero(~told).tolist() == [*range(5), *range(100, 160), *range(190, 200)]


def test_score_leaves_them_out():
    net = quick().fit(X, BLIND)
    assert net.score(X, BLIND) == net.score(X[SEEN], Y[SEEN])
    weights = np.arange(len(X))
    assert net.score(X, BLIND, weights) == net.score(X[SEEN], Y[SEEN], weights[SEEN])


@pytest.mark.slow
def test_folds_test_what_was_measured():
    folds = list(TrajectoryKFold(3).split(X, BLIND))
    for train, test in folds:
        assert np.isfinite(BLIND[test]).all()
        assert np.isnan(BLIND[train]).any(axis=1).sum() == np.isnan(BLIND).any(axis=1).sum()
    assert sum(len(test) for _, test in folds) == SEEN.sum()
    search = GridSearchCV(
        quick(refine=None), {"lambda_phy": [0.0, 0.1]}, cv=TrajectoryKFold(3), error_score="raise"
    )
    assert np.isfinite(search.fit(X, BLIND).best_score_)


def test_one_must_be_measured():
    with pytest.raises(RecordError, match="no trajectory has a measured output at all"):
        quick().fit(X, np.full(Y.shape, np.nan))


def test_one_on_which_the_network_runs_away_is_left_out_of_the_last_phase():
    away = X.copy()
    away.loc[~SEEN, "q"] *= 1e6
    with pytest.warns(SimulationWarning, match="in 2 of 2 trajectories without y"):
        quick(lambda_phy=0.1).fit(away, BLIND)


@pytest.mark.parametrize(
    "regressor",
    [
        PhysicsModelRegressor(TANKS),
        GreyBoxRegressor(TANKS, depths=("prior",)),
        ConformalRegressor(quick(refine_max_iter=1)),
    ],
)
def test_an_output_that_was_never_measured_has_no_interval_and_no_warning(regressor):
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # numpy's of empty slices
        regressor.fit(X, np.column_stack([Y[:, 0], np.full(len(Y), np.nan)]))
        low, high = regressor.predict_interval(X)
    assert np.isfinite(low[:, 0]).all()
    assert (low[:, 0] < high[:, 0]).all()
    assert np.isnan(low[:, 1]).all()
    assert np.isnan(high[:, 1]).all()


# -- a sensor that is rarely read ------------------------------------------------------------------


@pytest.mark.parametrize(
    "outputs", [{"x": "x", "v": "v"}, {"p": "x", "q": "x"}], ids=["velocity", "second position"]
)
def test_a_sparse_second_sensor_spoils_no_training(outputs):
    rates = {"x": "v", "v": "-30*x - 0.6*v + u"}
    spring = PhysicsModel({"x": "m", "v": "m/s"}, rates, {}, {"u": "N"}, outputs=outputs)
    hardening = spring + effects.CubicStiffness("v", stiffness=100.0)
    t = np.arange(1000) * 0.02
    table = pd.DataFrame(
        {"t": t, "u": 16 * np.repeat(np.random.default_rng(0).normal(size=50), 20)}
    )
    y = hardening.simulate(t, table["u"], substeps=8).y
    sparse = np.where((np.arange(1000) % 20 == 0)[:, None] | [True, False], y, np.nan)
    options = {"structure": "correction", "module__neurons": 3, "max_epochs": 20, "refine": None}
    net = PGNNLRegressor(spring, random_state=0, **options)
    left = [np.std(clone(net).fit(table, seen).predict(table) - y) for seen in (y, sparse)]
    assert left[1] < 1.05 * left[0]
