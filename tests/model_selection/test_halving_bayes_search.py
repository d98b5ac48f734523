"""A search that stops candidates by their first folds finds what the whole search finds."""

import pickle
import re
import warnings
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.linear_model import Ridge
from sklearn.model_selection import KFold
from skopt import Optimizer

from sklearn_pgnn.exceptions import OptionError, TrainingError
from sklearn_pgnn.model_selection import HalvingBayesSearchCV

RNG = np.random.default_rng(0)
X = np.column_stack([np.tile(np.arange(20.0), 6), RNG.normal(size=(120, 3))])
Y = X[:, 1] - 2 * X[:, 2] + 0.1 * RNG.normal(size=120)
SPACE = {"alpha": (1e-3, 1e5, "log-uniform")}


def search(estimator=None, **options):
    return HalvingBayesSearchCV(
        estimator or Ridge(), SPACE, **{"n_iter": 10, "random_state": 0, **options}
    )


def test_the_best_went_through_all_folds():
    found = search().fit(X, Y)
    results = found.cv_results_
    assert results["n_folds"][found.best_index_] == found.n_splits_ == 3
    whole = np.array(results["n_folds"]) == 3
    assert found.best_score_ == np.array(results["mean_test_score"])[whole].max()
    assert found.best_params_["alpha"] < 100
    assert found.score(X, Y) > 0.99


@pytest.mark.slow
def test_poor_candidates_are_stopped():
    results = search().fit(X, Y).cv_results_
    assert sum(results["n_folds"]) < 30
    for i, n in enumerate(results["n_folds"]):
        column = np.array(results[f"split{n - 1}_test_score"][: i + 1])
        assert n == 3 or not np.isnan(column[i])
        assert n == 3 or np.isnan(results[f"split{n}_test_score"][i])


@pytest.mark.slow
def test_it_is_repeatable_and_survives():
    found = search().fit(X, Y)
    again = clone(found).fit(X, Y)
    assert again.cv_results_["params"] == found.cv_results_["params"]
    loaded = pickle.loads(pickle.dumps(found))
    assert np.array_equal(loaded.predict(X), found.predict(X))
    assert not hasattr(found, "predict_interval")


def test_the_first_candidate_is_the_estimator_as_it_is():
    found = search(Ridge(alpha=0.5)).fit(X, Y)
    results = found.cv_results_
    assert results["params"][0] == {"alpha": 0.5}
    assert results["n_folds"][0] == found.n_splits_
    assert found.best_score_ >= results["mean_test_score"][0]


def test_a_single_candidate_is_no_search():
    found = search(Ridge(alpha=0.5), n_iter=1).fit(X, Y)
    assert np.array_equal(found.predict(X), Ridge(alpha=0.5).fit(X, Y).predict(X))


class Counting(Ridge):
    """A regressor that notes what it is fitted with."""

    fits: ClassVar[list] = []

    def fit(self, X, y):
        self.fits.append((self.alpha, self.fit_intercept, len(y)))
        return super().fit(X, y)


DISCRETE = {"alpha": [0.1, 1.0, 10.0], "fit_intercept": [True, False]}


def test_no_candidate_of_a_discrete_space_is_scored_twice():
    Counting.fits.clear()
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        found = HalvingBayesSearchCV(Counting(), DISCRETE, n_iter=6, random_state=0).fit(X, Y)
    params = found.cv_results_["params"]
    assert len({tuple(each.values()) for each in params}) == len(params) == 6
    in_first_fold = Counting.fits[: sum(found.cv_results_["n_folds"])]
    assert sum(found.cv_results_["n_folds"]) + 1 == len(Counting.fits)  # and the best, to all
    assert max(in_first_fold.count(each) for each in in_first_fold) <= found.n_splits_


def test_a_search_ends_where_no_candidate_is_left():
    space = HalvingBayesSearchCV(Ridge(), DISCRETE, n_iter=20, random_state=0)
    message = r"expected at least n_iter=20 different candidates, got 6, .* Remedy: n_iter=6"
    with pytest.warns(UserWarning, match=message):
        found = space.fit(X, Y)
    assert all(len(column) == 6 for column in found.cv_results_.values())
    assert found.best_index_ < 6


@pytest.mark.parametrize(("alpha", "is_told"), [(0.5, True), (1e-9, False)])
def test_the_process_learns_from_the_first_where_it_lies_in_the_space(monkeypatch, alpha, is_told):
    told, tell = [], Optimizer.tell
    monkeypatch.setattr(
        Optimizer, "tell", lambda self, x, y: told.append({"alpha": x[0]}) or tell(self, x, y)
    )
    tried = search(Ridge(alpha=alpha), n_iter=3).fit(X, Y).cv_results_["params"]
    assert tried[0] == {"alpha": alpha}
    assert told == tried[not is_told :]


def test_every_candidate_may_be_drawn():
    drawn = search(own_first=False, n_iter=4).fit(X, Y).cv_results_["params"]
    after = search(Ridge(alpha=1e-9), n_iter=4).fit(X, Y).cv_results_["params"]
    assert after[1:3] == drawn[:2]  # both at random, before the process knows enough


@pytest.mark.parametrize("own", [None, "auto"])
def test_what_no_dimension_has_is_tried_first_all_the_same(own):
    found = HalvingBayesSearchCV(Named(level=own), {"level": (0.0, 0.5)}, n_iter=3).fit(X, Y)
    assert found.cv_results_["params"][0] == {"level": own}
    assert found.best_params_ == {"level": own}


def test_a_parameter_that_the_estimator_does_not_tell_is_left_as_it_is():
    found = HalvingBayesSearchCV(Named(), {"level": (0.0, 0.5), "more__size": (1, 3)}, n_iter=2)
    assert found.fit(X, Y).cv_results_["params"][0] == {"level": 1.0}
    assert set(found.cv_results_["params"][1]) == {"level", "more__size"}


def test_progress_is_shown(capsys):
    search(n_iter=2, verbose=1).fit(X, Y)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == [
        "[HalvingBayesSearchCV] candidate 1 of 2",
        "[HalvingBayesSearchCV] candidate 2 of 2",
    ]
    told = r"alpha=\S+; score [-\d.]+ over \d of \d folds, [\d.]+ s; best [-\d.]+$"
    assert all(re.search(told, line) for line in lines)


class Named(RegressorMixin, BaseEstimator):
    """It takes parameters that it does not tell, as a skorch regressor does of its module."""

    def __init__(self, level=1.0):
        self.level = level

    def set_params(self, **params):
        return super().set_params(**{k: v for k, v in params.items() if k == "level"})

    def fit(self, X, y):
        self.fitted_ = True
        return self

    def score(self, X, y):
        return self.level if isinstance(self.level, float) else 1.0


class Diverging(RegressorMixin, BaseEstimator):
    def __init__(self, alpha=1.0):
        self.alpha = alpha

    def fit(self, X, y):
        self.fitted_ = True
        return self

    def score(self, X, y):
        return np.nan


def test_a_score_that_is_none_is_named():
    with (
        pytest.warns(UserWarning, match="could not be scored"),
        pytest.raises(ValueError, match="Remedy: another scoring"),
    ):
        HalvingBayesSearchCV(Diverging(), SPACE, n_iter=3, verbose=1).fit(X, Y)


class Breaking(Ridge):
    """Its training diverges, or its score is none, where alpha is small; else it is a ridge."""

    def fit(self, X, y):
        if self.alpha < 0.1:
            raise TrainingError("the training stopped in epoch 3: nan.")
        return super().fit(X, y)

    def score(self, X, y):
        return np.nan if self.alpha > 1e4 else super().score(X, y)


@pytest.mark.parametrize(
    ("alpha", "why"),
    [(1e-3, r"in fold 0: the training stopped in epoch 3"), (5e4, r"expected a finite .*got nan")],
)
def test_a_candidate_without_a_score_ends_no_search(alpha, why, monkeypatch):
    told, tell = [], Optimizer.tell
    monkeypatch.setattr(Optimizer, "tell", lambda self, x, y: told.append(y) or tell(self, x, y))
    with pytest.warns(UserWarning, match=rf"candidate {{'alpha': {alpha}}} could not .*{why}"):
        found = search(Breaking(alpha=alpha), n_iter=8).fit(X, Y)
    results = found.cv_results_
    assert results["n_folds"][0] == 0
    assert np.isnan(results["mean_test_score"][0])
    assert 0.1 <= found.best_params_["alpha"] <= 1e4
    assert len(told) == 8
    assert np.isfinite(told).all()
    assert told[0] == max(told[:2])  # the worst so far


def parted(results):
    """Return the results of a search without its times."""
    return {name: column for name, column in results.items() if name != "fit_time"}


@pytest.mark.parametrize("inner", [Ridge(), Breaking()], ids=["ridge", "some fail"])
@pytest.mark.parametrize("n_jobs", [2, 3, -1])
def test_folds_scored_at_the_same_time_change_nothing(inner, n_jobs):
    with warnings.catch_warnings(), parallel_config(backend="threading"):
        warnings.simplefilter("ignore")  # of candidates that fail
        alone = search(inner, cv=5, n_iter=8).fit(X, Y)
        together = search(inner, cv=5, n_iter=8, n_jobs=n_jobs).fit(X, Y)
    assert sum(alone.cv_results_["n_folds"]) < 8 * 5
    np.testing.assert_equal(parted(together.cv_results_), parted(alone.cv_results_))
    assert together.best_params_ == alone.best_params_
    assert np.array_equal(together.predict(X), alone.predict(X))


def test_folds_are_scored_in_other_processes():
    alone, together = (search(n_iter=2, n_jobs=n).fit(X, Y) for n in (None, 2))
    np.testing.assert_equal(parted(together.cv_results_), parted(alone.cv_results_))


class Fragile(Ridge):
    """Refuses the last fold where alpha is large; such a candidate seldom gets that far."""

    def fit(self, X, y):
        if self.alpha > 1e3 and np.array_equal(y, Y[:-20]):
            raise ValueError("this fold is refused.")
        return super().fit(X, y)


@pytest.mark.parametrize("n_jobs", [None, 6])
def test_an_error_counts_only_where_a_candidate_gets_that_far(n_jobs):
    with parallel_config(backend="threading"):
        found = search(Fragile(), cv=KFold(6), n_jobs=n_jobs).fit(X, Y)
        assert max(params["alpha"] for params in found.cv_results_["params"]) > 1e3
        with pytest.raises(ValueError, match="this fold is refused"):
            search(Fragile(alpha=1e4), cv=KFold(6), n_iter=1, n_jobs=n_jobs).fit(X, Y)


class Stuck(Ridge):
    """A regressor that ends in a bad minimum where it has all records."""

    def fit(self, X, y):
        return super().fit(X, y if len(y) < len(Y) else 0.1 * y)


def test_a_last_fit_in_a_bad_minimum_is_named():
    expected = (
        r"fitted to all records, scores 0\.\d+ on them; in the folds it scored at least 0\.99\d* "
        r"on held-out records.* Remedy: another random_state .*EnsembleRegressor"
    )
    with pytest.warns(UserWarning, match=expected):
        search(Stuck(), n_iter=2).fit(X, Y)


def test_wrong_parameters_of_a_candidate_end_it():
    found = HalvingBayesSearchCV(Ridge(), {"alpha": (-2.0, -1.0)}, own_first=False)
    with pytest.raises(ValueError, match="'alpha' parameter of Ridge"):
        found.fit(X, Y)


def test_groups_make_the_folds():
    groups = np.repeat([0, 1], 60)
    found = search(n_iter=1, cv=2).fit(X[:, 1:], Y, groups=groups)
    assert found.n_splits_ == 2


@pytest.mark.parametrize(
    ("wrong", "what"),
    [({"n_iter": 0}, "n_iter"), ({"search_spaces": {}}, "search_spaces")],
)
def test_wrong_parameters_are_refused(wrong, what):
    with pytest.raises(OptionError, match=what):
        search().set_params(**wrong).fit(X, Y)


class Ahead(Ridge):
    def predict_states(self, X):
        return np.asarray(X)[:, 1:]

    def predict_interval(self, X, coverage=0.9, y=None):
        return (self.predict(X), self.predict(X)) if y is None else (y, y)

    def predict_ahead(self, X, y, steps=1):
        return self.predict(X) + steps


@pytest.mark.slow
def test_what_the_best_can_do_the_search_can():
    found = search(estimator=Ahead()).fit(X, Y)
    assert np.array_equal(found.predict_ahead(X, Y, steps=3), found.predict(X) + 3)
    assert np.array_equal(found.predict_states(X), X[:, 1:])
    assert np.array_equal(found.predict_interval(X)[0], found.predict(X))
    assert np.array_equal(found.predict_interval(X, y=Y)[0], Y)
    assert not hasattr(search().fit(X, Y), "predict_ahead")


def test_what_was_found_is_plain():
    space = {"alpha": (1e-3, 1e5), "solver": ["svd", "lsqr"], "max_iter": (5, 9)}
    found = HalvingBayesSearchCV(Ridge(), space, n_iter=3, own_first=False, random_state=0)
    found.fit(X, Y)
    for params in [found.best_params_, *found.cv_results_["params"]]:
        assert {name: type(value) for name, value in params.items()} == {
            "alpha": float,
            "solver": str,
            "max_iter": int,
        }


def test_its_columns_are_those_of_the_best():
    found = search(n_iter=1)
    assert not hasattr(found, "n_features_in_")
    assert list(found.fit(pd.DataFrame(X, columns=list("tabc")), Y).feature_names_in_) == [*"tabc"]
    assert found.fit(X, Y).n_features_in_ == 4
    assert not hasattr(found, "feature_names_in_")


class Counted(Ridge):
    """Counts its fits."""

    fits = 0

    def fit(self, X, y):
        type(self).fits += 1
        return super().fit(X, y)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"search_spaces": {"alfa": (1e-3, 1.0)}},
            r"alfa: expected a parameter of Counted, got",
        ),
        ({"scoring": "r3"}, r"scoring: expected None, a callable or one name .*got 'r3'\. Remedy:"),
        ({"scoring": ["r2"]}, r"scoring: expected None, a callable or one name .*got \['r2'\]\."),
    ],
)
def test_what_cannot_be_searched_or_scored_is_refused_before_any_fit(options, message):
    Counted.fits = 0
    with pytest.raises(OptionError, match=message):
        search(Counted()).set_params(**options).fit(X, Y)
    assert Counted.fits == 0
