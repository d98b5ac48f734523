"""A search over the recipe: parameters of what it holds, and what it keeps from fit to fit."""

import pickle

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV
from skopt import BayesSearchCV

from sklearn_pgnn import (
    GreyBoxRegressor,
    ModelDiagnosis,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
    effects,
)
from sklearn_pgnn.exceptions import DiagnosisWarning
from sklearn_pgnn.model_selection import HalvingBayesSearchCV, TrajectoryKFold, search_space
from sklearn_pgnn.user_line import warn_user

CART = PhysicsModel(
    {"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"},
    inertia={"v": "m"}, energy={"stored": "m*v**2/2", "supplied": "F*v", "dissipated": "d*v**2"},
)  # fmt: skip
QUICK = {"max_epochs": 1, "rollout_epochs": 1, "refine": None}
ALPHAS = {"network__regressor__alpha": [1e-6, 1e6]}


class Counted(ModelDiagnosis):
    """A diagnosis that tells how often it was made."""

    made: list = []

    def fit(self, X, y):
        self.made.append(len(y))
        return super().fit(X, y)


class BrokenOff(Counted):
    """One of which a stage fails after it has found something."""

    def fit(self, X, y):
        super().fit(X, y)
        warn_user("broken", DiagnosisWarning)


@pytest.fixture(scope="module")
def cart():
    """Six short records of a cart with dry friction; X tells where they start."""
    rig, rng = CART + effects.CoulombFriction("v", level=0.4), np.random.default_rng(0)
    t = np.arange(0, 10, 0.1)
    tables, outputs = [], []
    for i in range(6):
        F = 2 * np.sin((0.5 + 0.2 * i) * t) + np.sin(1.9 * t + i)
        tables.append(pd.DataFrame({"trajectory": i, "t": t, "F": F, "v": 0.0}))
        outputs.append(rig.simulate(t, F, substeps=5).y[:, 0] + 1e-3 * rng.normal(size=t.size))
    return pd.concat(tables, ignore_index=True), np.concatenate(outputs)


@pytest.fixture
def made():
    """Return how many samples every diagnosis of the test has had."""
    Counted.made.clear()
    return Counted.made


def recipe(diagnosis=Counted, depths=("fitted", "extended", "network"), **options):
    return GreyBoxRegressor(
        CART,
        depths=depths,
        diagnosis=diagnosis(CART, catalogue=(effects.CoulombFriction,)),
        network=ResidualRegressor(CART, Ridge()),
        n_splits=2,
        **options,
    )


def told(fitted, X):
    """Return all numbers that a fitted recipe tells."""
    return [
        fitted.errors_,
        fitted.parameters_,
        fitted.diagnosis_.to_dict(),
        fitted.predict(X).tolist(),
        fitted.predict_interval(X)[0].tolist(),
    ]


@pytest.mark.slow
def test_a_search_with_memory_diagnoses_every_fold_once_and_finds_the_same(cart, made, tmp_path):
    X, y = cart
    scores, counts, best = [], [], []
    for memory in (None, str(tmp_path)):
        made.clear()
        search = GridSearchCV(recipe(memory=memory), ALPHAS, cv=TrajectoryKFold(2)).fit(X, y)
        scores.append(search.cv_results_["mean_test_score"].tolist())
        best.append(told(search.best_estimator_, X))
        counts.append(sorted(made))
    assert scores[0] == scores[1]
    assert best[0] == best[1]
    assert counts == [[300] * 4 + [600], [300] * 2 + [600]]


@pytest.mark.slow
def test_physical_depths_are_judged_once_on_the_same_records(cart, tmp_path, monkeypatch):
    X, y = cart
    fits, fit = [], PhysicsModelRegressor.fit

    def counted(regressor, X, y):
        fits.append(np.isfinite(y).sum())
        return fit(regressor, X, y)

    monkeypatch.setattr(PhysicsModelRegressor, "fit", counted)
    first = recipe(memory=joblib.Memory(tmp_path, verbose=0)).fit(X, y)
    assert fits == [300] * 4 + [600]  # two depths in two folds, and the chosen one
    fits.clear()
    other = clone(first).set_params(network__regressor__alpha=1e6).fit(X, y)
    assert fits == [600]
    assert other.errors_["network"] != first.errors_["network"]
    assert other.errors_["extended"] == first.errors_["extended"]


@pytest.mark.slow
def test_what_changes_the_diagnosis_makes_it_anew(cart, made, tmp_path):
    X, y = cart
    kept = recipe(memory=str(tmp_path), depths=("extended",)).fit(X, y)
    for changes in (
        {"least_gain": 0.1},  # changes nothing
        {"diagnosis__max_causes": 1},
        {"model": CART.with_parameters(m=2.1)},
    ):
        kept.set_params(**changes).fit(X, y)
    kept.fit(X, y + 1e-9)
    assert len(made) == 4


@pytest.mark.slow
def test_a_diagnosis_that_breaks_off_is_not_kept(cart, made, tmp_path):
    X, y = cart
    broken = recipe(BrokenOff, depths=("extended",), memory=str(tmp_path))
    for _ in range(2):
        with pytest.warns(UserWarning, match="broken"):
            broken.fit(X, y)
        assert broken.diagnosis_.causes_[0].effect == "coulomb_friction"
    assert len(made) == 2


def test_a_memory_that_is_none_is_refused_before_any_work(cart, made):
    with pytest.raises(ValueError, match="'memory' should be None, a string or"):
        recipe(memory=3).fit(*cart)
    assert made == []


def test_parameters_of_a_default_part_put_it_in_its_place():
    default = GreyBoxRegressor(CART)
    assert default.set_params(n_splits=2).network is None
    changed = clone(default).set_params(network__lr=0.02, diagnosis__max_causes=1)
    assert (default.network, default.diagnosis) == (None, None)
    assert type(changed.network).__name__ == "PGNNLRegressor"
    assert (changed.network.lr, changed.diagnosis.max_causes) == (0.02, 1)
    assert changed.diagnosis.model == CART
    own = ResidualRegressor(CART, Ridge())
    assert changed.set_params(network=own, network__regressor__alpha=3.0).network is own
    assert own.regressor.alpha == 3.0
    with pytest.raises(ValueError, match="Invalid parameter 'max_cause'"):
        clone(default).set_params(diagnosis__max_cause=1)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("search", "network"),
    [(BayesSearchCV, None), (HalvingBayesSearchCV, PGNNLRegressor(CART, **QUICK))],
)
def test_bayesian_search_over_the_recipe(cart, tmp_path, search, network):
    X, y = cart
    inside = GreyBoxRegressor(CART, depths=("prior", "network"), network=network, n_splits=2)
    quick = {f"network__{name}": [value] for name, value in QUICK.items()}
    space = search_space(inside.set_params(memory=str(tmp_path)), **quick)
    found = search(inside, space, n_iter=3, cv=TrajectoryKFold(2), random_state=0).fit(X, y)
    assert set(found.cv_results_["params"][-1]) == set(space)
    assert inside.network is network
    best = clone(inside).set_params(**found.best_params_).fit(X, y)
    loaded = pickle.loads(pickle.dumps(found))
    for each in (best, loaded):
        assert np.array_equal(each.predict(X), found.predict(X))


@pytest.mark.slow
def test_the_diagnosis_has_the_recipe_s_threads_unless_it_has_its_own(cart, made, tmp_path):
    options = {"depths": ("fitted", "extended"), "memory": str(tmp_path)}
    two, one = (recipe(n_jobs=n, **options).fit(*cart) for n in (2, 1))
    assert two.diagnosis_.n_jobs == 2
    assert len(made) == 1  # the numbers do not depend on threads: it is found
    assert one.errors_ == two.errors_
    own = recipe(n_jobs=2, **options).set_params(diagnosis__n_jobs=1, memory=None).fit(*cart)
    assert own.diagnosis_.n_jobs == 1
