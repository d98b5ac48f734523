"""Intervals of any regressor hold on trajectories that it has not seen."""

import pickle
import re
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import KFold

from sklearn_pgnn import ConformalRegressor, PhysicsModel, PhysicsModelRegressor, ResidualRegressor
from sklearn_pgnn.exceptions import OptionError, RecordWarning

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})


def records(n, seed, noise=0.05):
    rng = np.random.default_rng(seed)
    frames, outputs = [], []
    for i in range(n):
        t = np.arange(0, 20, 0.1)
        u = np.repeat(rng.uniform(-1, 1, 10), 20)
        frames.append(pd.DataFrame({"trajectory": i, "t": t, "u": u, "y": 0.0}))
        run = LAG.with_parameters(T=2.5).simulate(t, u, [0.0])
        outputs.append(run.y[:, 0] + noise * rng.normal(size=t.size))
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


class Blind(ResidualRegressor):
    """Leaves out what was not measured."""

    def fit(self, X, y):
        seen = np.isfinite(y)
        return super().fit(X[seen], y[seen])


def covered(estimator, coverage):
    X, y = records(10, seed=1)
    low, high = estimator.predict_interval(X, coverage)
    return np.mean((low <= y) & (y <= high))


@pytest.mark.parametrize("coverage", [0.5, 0.9])
@pytest.mark.parametrize(
    "estimator",
    [
        PhysicsModelRegressor(LAG, search="local"),
        ConformalRegressor(PhysicsModelRegressor(LAG, search="local")),
        ConformalRegressor(ResidualRegressor(LAG), cv=3),
    ],
    ids=["parameters", "conformal", "conformal residual"],
)
def test_the_coverage_is_what_was_asked_for(estimator, coverage):
    assert covered(clone(estimator).fit(*records(6, seed=0)), coverage) == pytest.approx(
        coverage, abs=0.04
    )


def test_an_interval_is_wider_where_parameters_decide():
    X, y = records(2, seed=0, noise=0.0)
    rough = y + 0.3 * np.random.default_rng(0).normal(size=y.size)
    regressor = PhysicsModelRegressor(LAG, search="local", window_length="trajectory")
    low, high = regressor.fit(X, rough).predict_interval(X)
    width = (high - low)[X["trajectory"] == 0]
    assert width[1:].max() > width[0]  # where the trajectory starts the parameter does not count
    assert np.array_equal(regressor.predict(X), (low + high) / 2) or np.allclose(
        regressor.predict(X), (low + high) / 2
    )


def test_a_copy_gives_the_same_and_what_was_given_stays():
    inner = ResidualRegressor(LAG)
    X, y = records(3, seed=0)
    conformal = ConformalRegressor(inner).fit(X, y)
    assert not hasattr(inner, "regressor_")
    again = pickle.loads(pickle.dumps(conformal))
    assert np.array_equal(again.predict_interval(X), conformal.predict_interval(X))
    assert conformal.get_params()["estimator__model"] is LAG
    assert list(conformal.feature_names_in_) == list(X.columns)


def test_a_refit_forgets_the_names_of_before():
    X, y = records(3, seed=0)
    conformal = ConformalRegressor(ResidualRegressor(LAG))
    assert not hasattr(conformal, "n_features_in_")
    conformal.fit(X, y).fit(X[["t", "u"]].to_numpy(), y)
    assert conformal.n_features_in_ == 2
    assert not hasattr(conformal, "feature_names_in_")


def test_folds_are_counted_by_what_was_measured():
    X, y = records(4, seed=0)
    y = np.where(X["trajectory"] < 2, y, np.nan)

    low, high = ConformalRegressor(Blind(LAG)).fit(X, y).predict_interval(X)
    assert (low < high).all()


def test_groups_make_the_folds():
    X, y = records(4, seed=0)
    pairs = X["trajectory"] // 2
    asked = []

    class Watched(ResidualRegressor):
        def fit(self, X, y):
            asked.append(sorted(set(X["trajectory"])))
            return super().fit(X, y)

    ConformalRegressor(Watched(LAG)).fit(X, y, groups=pairs)
    assert asked == [[0, 1, 2, 3], [2, 3], [0, 1]]


def test_what_the_regressor_can_do_it_can():
    X, y = records(3, seed=0)
    conformal = ConformalRegressor(ResidualRegressor(LAG)).fit(X, y)
    inner = conformal.estimator_
    assert np.array_equal(conformal.predict_states(X), inner.predict_states(X))
    assert np.array_equal(conformal.predict_ahead(X, y, 5), inner.predict_ahead(X, y, 5))
    plain = ConformalRegressor(LinearRegression())
    assert not hasattr(plain, "predict_states")
    assert not hasattr(plain, "predict_ahead")


@pytest.mark.parametrize(
    ("n", "coverage", "said"),
    [
        (
            6,
            0.9,
            "coverage: expected at most 6/7, which is what held-out errors of 6 trajectories can "
            "guarantee for another one, got 0.9, for which 9 are needed; without a guarantee, the "
            "interval covers that share of the errors that were seen, and may cover less. Remedy: "
            "coverage=0.857 or less, or fit 3 more trajectories.",
        ),
        (8, 0.9, "Remedy: coverage=0.888 or less, or fit 1 more trajectory."),
        (9, 0.99, "for which 99 are needed"),
    ],
)
def test_a_coverage_that_so_few_records_cannot_guarantee_is_warned_of(n, coverage, said):
    X, y = records(n, seed=0)
    conformal = ConformalRegressor(ResidualRegressor(LAG)).fit(X, y)
    with pytest.warns(RecordWarning, match=re.escape(said)):
        low, high = conformal.predict_interval(X, coverage)
    assert np.isfinite(high - low).all()


def guaranteed(conformal, X, coverage):
    """Return whether an interval comes without a warning."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        conformal.predict_interval(X, coverage)
    return not told


def test_records_are_counted_as_they_were_measured_and_grouped():
    X, y = records(10, seed=0)
    whole = ConformalRegressor(ResidualRegressor(LAG)).fit(X, y)
    assert guaranteed(whole, X, 10 / 11)
    assert not guaranteed(whole, X, 0.92)
    pairs = clone(whole).fit(X, y, groups=X["trajectory"] // 2)
    assert guaranteed(pairs, X, 5 / 6)
    assert not guaranteed(pairs, X, 0.9)
    some = ConformalRegressor(Blind(LAG)).fit(X, np.where(X["trajectory"] < 8, y, np.nan))
    assert guaranteed(some, X, 8 / 9)
    assert not guaranteed(some, X, 0.9)


def test_rows_without_time_and_trajectory_stand_for_themselves():
    X = pd.DataFrame({"a": np.arange(9.0), "b": 0.0})
    rows = ConformalRegressor(LinearRegression(), cv=KFold(3)).fit(X, X["a"])
    assert guaranteed(rows, X, 0.9)
    assert not guaranteed(rows, X, 0.95)


def test_one_trajectory_is_too_few():
    with pytest.raises(ValueError, match="at most as many folds as trajectories"):
        ConformalRegressor(ResidualRegressor(LAG)).fit(*records(1, seed=0))


@pytest.mark.parametrize("coverage", [0, 1, "much"])
def test_a_coverage_is_a_share(coverage):
    conformal = ConformalRegressor(LinearRegression(), cv=2)
    X = np.column_stack([np.tile([0.0, 1.0, 2.0], 4), np.arange(12.0)])
    conformal.fit(X, X[:, 1])
    with pytest.raises(OptionError, match="coverage"):
        conformal.predict_interval(X, coverage)
