"""Intervals hold on trajectories that a regressor has not seen; ensembles are their median."""

import pickle
import re
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.ensemble import RandomForestRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import KFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.tree import ExtraTreeRegressor
from sklearn.utils.estimator_checks import parametrize_with_checks

from sklearn_pgnn import (
    ConformalRegressor,
    EnsembleRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
)
from sklearn_pgnn.exceptions import OptionError, RecordWarning, SimulationWarning

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})


def records(n=3, seed=0, noise=0.05):
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


FOREST = RandomForestRegressor(3, max_depth=4)
RESIDUAL = ResidualRegressor(LAG, FOREST)


X, Y = records()


@parametrize_with_checks([EnsembleRegressor(ExtraTreeRegressor(), 2)])
def test_scikit_learn_checks(estimator, check):
    check(estimator)


def test_it_is_the_median_of_its_fits():
    ensemble = EnsembleRegressor(RESIDUAL).fit(X, Y)
    each = [fit.predict(X) for fit in ensemble.estimators_]
    predicted, spread = ensemble.predict(X, return_std=True)
    assert len(each) == 5
    assert np.array_equal(predicted, np.median(each, axis=0))
    assert np.array_equal(spread, np.std(each, axis=0))
    assert (spread > 0).any()


def test_what_the_regressor_can_do_an_ensemble_can():
    ensemble = EnsembleRegressor(RESIDUAL, 3).fit(X, Y)
    ahead = [fit.predict_ahead(X, Y, 5) for fit in ensemble.estimators_]
    assert np.array_equal(ensemble.predict_ahead(X, Y, 5), np.median(ahead, axis=0))
    assert np.array_equal(ensemble.predict_states(X), ensemble.estimators_[0].predict_states(X))
    assert not hasattr(EnsembleRegressor(FOREST), "predict_states")
    assert not hasattr(EnsembleRegressor(FOREST), "predict_ahead")


def test_all_that_fails_in_the_fits_is_one_warning():
    unstable = LAG.with_parameters(T=-0.2)
    ensemble = EnsembleRegressor(ResidualRegressor(unstable, FOREST), 3)
    with pytest.warns(SimulationWarning):
        ensemble.fit(X, Y)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ensemble.predict(X)
    (warned,) = caught
    assert str(warned.message).startswith("trajectory '0': the simulation of 'model' diverges")
    assert str(warned.message).endswith("2 more simulations failed in the same call.")


def in_volt(table):
    return table.assign(u=table["u"] / 1000.0)


@pytest.mark.parametrize("outer", [EnsembleRegressor, ConformalRegressor])
def test_what_the_last_step_of_a_pipeline_can_do_it_can(outer):
    steps = ["passthrough", FunctionTransformer(in_volt)]
    inner = ResidualRegressor(LAG, RandomForestRegressor(3, max_depth=4, random_state=0))
    if outer is EnsembleRegressor:
        fitted = outer(make_pipeline(*steps, inner), 1)
    else:
        fitted = outer(make_pipeline(*steps, inner), cv=3)
    millivolt = X.assign(u=X["u"] * 1000.0)
    assert hasattr(fitted, "predict_ahead")  # before it is fitted, too
    fitted.fit(millivolt, Y)
    whole = fitted.estimators_[0] if outer is EnsembleRegressor else fitted.estimator_
    alone, table = whole[-1], in_volt(millivolt)
    assert np.array_equal(
        fitted.predict_ahead(millivolt, Y, steps=5), alone.predict_ahead(table, Y, 5)
    )
    assert np.array_equal(fitted.predict_states(millivolt), alone.predict_states(table))
    plain = make_pipeline(FunctionTransformer(in_volt), FOREST)
    assert not hasattr(outer(plain), "predict_ahead")
    assert not hasattr(outer(plain), "predict_states")


class Sometimes(ExtraTreeRegressor):
    """A regressor of which one fit in three diverges."""

    def predict(self, X):
        return super().predict(X) + (1e6 if self.random_state % 3 == 0 else 0.0)


def test_one_that_diverges_does_not_count():
    features = X[["t", "u"]].to_numpy()
    ensemble = EnsembleRegressor(Sometimes(max_depth=3), 9, random_state=2).fit(features, Y)
    each = np.array([fit.predict(features).max() for fit in ensemble.estimators_])
    assert 0 < (each > 1e5).sum() < 5
    assert ensemble.predict(features).max() < 2.0


def test_it_draws_by_its_seed_alone_and_what_was_given_stays():
    inner = clone(RESIDUAL)
    fits = [EnsembleRegressor(inner, 2, random_state=s, n_jobs=j) for s, j in ((1, None), (1, 2))]
    first, again = (fit.fit(X, Y).predict(X) for fit in fits)
    assert np.array_equal(first, again)
    other = EnsembleRegressor(inner, 2, random_state=2).fit(X, Y)
    assert not np.array_equal(first, other.predict(X))
    assert inner.regressor.random_state is None
    assert not hasattr(inner, "regressor_")
    assert np.array_equal(pickle.loads(pickle.dumps(other)).predict(X), other.predict(X))


def test_what_a_pipeline_holds_draws_too():
    pipeline = make_pipeline(StandardScaler(), FOREST)
    features = X[["t", "u"]]
    ensemble = EnsembleRegressor(pipeline, 3).fit(features, Y)
    drawn = {fit[-1].random_state for fit in ensemble.estimators_}
    assert len(drawn) == 3
    assert list(ensemble.feature_names_in_) == ["t", "u"]
    assert ensemble.n_features_in_ == 2


def test_samples_that_were_not_measured_do_not_count():
    gaps = np.where(np.arange(Y.size) % 7 == 0, np.nan, Y)
    ensemble = EnsembleRegressor(RESIDUAL, 2).fit(X, gaps)
    assert np.isfinite(ensemble.predict(X)).all()
    assert ensemble.score(X, gaps) > 0.9


def test_intervals_around_it():
    sure = ConformalRegressor(EnsembleRegressor(RESIDUAL, 2), cv=3).fit(X, Y)
    low, high = sure.predict_interval(X)
    assert 0.8 < np.mean((low <= Y) & (high >= Y)) <= 1.0


@pytest.mark.parametrize("count", [0, 2.5, "five"])
def test_a_count_that_is_none(count):
    with pytest.raises(OptionError, match="n_estimators: expected an integer >= 1, got"):
        EnsembleRegressor(RESIDUAL, count).fit(X, Y)


def test_what_draws_nothing_is_refused():
    with pytest.raises(
        OptionError, match=r"'random_state', got LinearRegression\(\).*fit it alone"
    ):
        EnsembleRegressor(LinearRegression()).fit(X, Y)


def test_fits_that_are_all_the_same_are_told():
    same = EnsembleRegressor(ResidualRegressor(LAG, Ridge()), 2)  # it draws for one solver only
    with pytest.warns(UserWarning, match=r"the 2 fits of .* predict the same .*Remedy: fit it al"):
        same.fit(X, Y)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        EnsembleRegressor(RESIDUAL, 2).fit(X, Y)
        same.set_params(n_estimators=1).fit(X, Y)
