"""Folds that a number asks for hold whole trajectories, by the time that the estimator reads."""

import numpy as np
import pandas as pd
import pytest
from sklearn.compose import TransformedTargetRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from sklearn_pgnn import (
    ConformalRegressor,
    EnsembleRegressor,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
    make_pgnn_pipeline,
)
from sklearn_pgnn.model_selection import (
    HalvingBayesSearchCV,
    TrajectoryKFold,
    pareto_front,
    train_validation_test_split,
)
from sklearn_pgnn.model_selection.trajectory_k_fold import columns_of, own_folds

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
RENAMED = LAG.replace(columns={"t": "time"})
T = np.tile(np.arange(100) / 10, 3)
U = np.sin(T) + np.cos(np.arange(300))  # it falls and rises, so that it is no clock
Y = np.concatenate(
    [LAG.with_parameters(T=2.5).simulate(T[:100], U[k : k + 100]).y[:, 0] for k in (0, 100, 200)]
)
A = np.column_stack([U, T])
CALLED = pd.DataFrame(A, columns=["u", "time"])
SETTINGS = {"search": "local", "substeps": 1}


@pytest.mark.parametrize(
    ("estimator", "X", "expected"),
    [
        (PhysicsModelRegressor(LAG), A, None),
        (PhysicsModelRegressor(LAG, time_column=1), A, 1),
        (PhysicsModelRegressor(LAG, time_column="time"), CALLED, "time"),
        (PhysicsModelRegressor(RENAMED), CALLED, "time"),
        (PhysicsModelRegressor(RENAMED), A, None),  # an array has no names
        (PhysicsModelRegressor(RENAMED, time_column="u"), CALLED, "u"),
        (make_pgnn_pipeline(RENAMED), CALLED, "time"),
        (make_pipeline(FunctionTransformer(), PGNNLRegressor(time_column="time")), CALLED, "time"),
        (TransformedTargetRegressor(ResidualRegressor(LAG, time_column=1)), A, 1),
        (ConformalRegressor(ResidualRegressor(LAG, time_column=1)), A, 1),
        (EnsembleRegressor(ResidualRegressor(LAG, time_column=1)), A, 1),
        (FunctionTransformer(), A, None),
    ],
)
def test_the_time_of_an_estimator(estimator, X, expected):
    assert columns_of(estimator, X) == {"time_column": expected, "trajectory_column": None}
    assert own_folds(3, estimator, X).time_column == expected
    splitter = TrajectoryKFold(2)
    assert own_folds(splitter, estimator, X) is splitter


NAMED = LAG.replace(columns={"trajectory": "run"})
RUNS = pd.DataFrame({"t": np.arange(300) / 10, "u": U, "run": np.repeat([*"abc"], 100)})


@pytest.mark.parametrize(
    ("estimator", "X", "expected"),
    [
        (PhysicsModelRegressor(NAMED), RUNS, "run"),
        (make_pgnn_pipeline(NAMED), RUNS, "run"),
        (ConformalRegressor(ResidualRegressor(NAMED)), RUNS, "run"),
        (PhysicsModelRegressor(NAMED), RUNS.rename(columns={"run": "trajectory"}), None),
        (PhysicsModelRegressor(LAG), RUNS, None),
        (PhysicsModelRegressor(NAMED), A, None),  # an array has no names
    ],
)
def test_the_trajectory_of_an_estimator(estimator, X, expected):
    assert own_folds(3, estimator, X).trajectory_column == expected


def test_folds_are_of_the_trajectories_that_the_model_names():
    regressor = PhysicsModelRegressor(NAMED, **SETTINGS)
    search = HalvingBayesSearchCV(regressor, {"search": ["local"]}, n_iter=1, cv=3).fit(RUNS, Y)
    assert search.n_splits_ == 3  # by the time it would be a single trajectory
    low, high = ConformalRegressor(regressor).fit(RUNS, Y).predict_interval(RUNS)
    assert (low <= high).all()
    parts = train_validation_test_split(RUNS, Y, sizes=(1 / 3,) * 3, trajectory_column="run")
    assert [len(part) for part in parts] == [100] * 6


@pytest.mark.parametrize("X", [RUNS, A])
def test_a_trajectory_that_is_no_column_is_refused(X):
    with pytest.raises(ValueError, match="trajectory_column: expected a column of X, got 'ruhn'"):
        next(TrajectoryKFold(3, trajectory_column="ruhn").split(X))


@pytest.mark.parametrize(
    ("n", "expected"),
    [
        (1, "1 trajectory. Remedy: more records;"),
        (2, "2 trajectories. Remedy: n_splits=2, or more records;"),
    ],
)
def test_too_few_trajectories_are_told_what_helps(n, expected):
    with pytest.raises(ValueError, match=f"got 3 folds and {expected}"):
        next(TrajectoryKFold(3).split(np.tile(np.arange(5.0), n)[:, None]))


class Watched(PhysicsModelRegressor):
    """Refuses trajectories that are torn."""

    def fit(self, X, y):
        starts = np.flatnonzero(np.diff(np.asarray(X)[:, 1], prepend=np.inf) <= 0)
        assert np.diff([*starts, len(X)]).tolist() == [100] * (len(X) // 100)
        return super().fit(X, y)


@pytest.mark.parametrize(
    ("estimator", "X"),
    [
        (Watched(LAG, time_column=1, **SETTINGS), A),
        (Watched(LAG, time_column=1, **SETTINGS), pd.DataFrame(A)),
        (Watched(LAG, time_column="time", **SETTINGS), CALLED),
        (Watched(RENAMED, **SETTINGS), CALLED),
        (make_pipeline(FunctionTransformer(), Watched(RENAMED, **SETTINGS)), CALLED),
    ],
    ids=["number", "frame of an array", "name", "model", "pipeline"],
)
def test_searches_and_intervals_keep_trajectories_whole(estimator, X):
    name = next(name for name in estimator.get_params() if name.endswith("search"))
    search = HalvingBayesSearchCV(estimator, {name: ["local"]}, n_iter=1, cv=3).fit(X, Y)
    assert search.n_splits_ == 3
    for cv in (None, 3):
        low, high = ConformalRegressor(estimator, cv=cv).fit(X, Y).predict_interval(X)
        assert (low <= high).all()


def test_a_front_keeps_trajectories_whole():
    quick = {"max_epochs": 1, "refine": None, "module__neurons": 2, "substeps": 1}

    class Flat(PGNNLRegressor):
        def physics_residual(self, X):
            return np.zeros(len(X))

    net = Flat(time_column="time", **quick)
    given = pareto_front(net, CALLED, Y, lambdas=[1], param="horizon", cv=3)
    told = TrajectoryKFold(3, time_column="time")
    assert given.equals(pareto_front(net, CALLED, Y, lambdas=[1], param="horizon", cv=told))


def test_a_frame_without_names_has_its_time_first():
    swapped = pd.DataFrame(A[:, ::-1])
    for train, test in TrajectoryKFold(3).split(swapped):
        assert (len(train), len(test)) == (200, 100)
    parts = train_validation_test_split(swapped, Y, sizes=(1 / 3,) * 3)
    assert [len(part) for part in parts] == [100] * 6


def test_a_time_that_cannot_be_told_is_asked_for():
    expected = (
        r"no time 't' among u, time\. Remedy: name the time by time_column=\.\.\., where folds are "
        r"asked for by cv=TrajectoryKFold\(\.\.\., time_column=\.\.\.\); or give X a column 'traj"
    )
    silent = make_pipeline(FunctionTransformer(), FunctionTransformer())
    tried = {"functiontransformer-1__validate": [True]}
    for fit in (
        lambda: HalvingBayesSearchCV(silent, tried, n_iter=1, scoring="r2", cv=3).fit(CALLED, Y),
        lambda: ConformalRegressor(TransformedTargetRegressor()).fit(CALLED, Y),
        lambda: next(TrajectoryKFold(3).split(CALLED)),
    ):
        with pytest.raises(ValueError, match=expected):
            fit()


@pytest.mark.parametrize("column", ["time", 2, -3, 0.5])
def test_an_array_has_numbered_columns(column):
    expected = r"^time_column: expected a column number below 2, .*shape \(300, 2\).*got "
    with pytest.raises(ValueError, match=expected):
        next(TrajectoryKFold(3, time_column=column).split(A))
