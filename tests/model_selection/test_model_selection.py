"""model_selection: splits by whole trajectories, search spaces, and the Pareto front."""

import re
import sys
import warnings
from itertools import chain

import joblib
import numpy as np
import pandas as pd
import pytest
import sklearn
from hypothesis import given
from hypothesis import strategies as st
from sklearn.base import BaseEstimator, RegressorMixin, TransformerMixin
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import check_is_fitted
from skopt import BayesSearchCV
from skopt.space import Categorical, Integer, Real

from sklearn_pgnn import GreyBoxRegressor, PhysicsModelTransformer, datasets, systems
from sklearn_pgnn.estimators.residual_regressor import ResidualRegressor
from sklearn_pgnn.exceptions import ModelWarning
from sklearn_pgnn.model_selection import (
    TrajectoryKFold,
    pareto_front,
    search_space,
    train_validation_test_split,
)
from sklearn_pgnn.model_selection.pareto_front import _not_dominated
from sklearn_pgnn.model_selection.trajectory_rows import deal_in_order
from sklearn_pgnn.simulation.finite_run import FreeRuns
from sklearn_pgnn.trajectories.reader import split_rows

GOLF = systems.golf_robot()


def records(lengths, names=True):
    """Return X of trajectories that all begin at zero, and y that holds the row number."""
    t = np.concatenate([np.arange(n) * 0.1 for n in lengths])
    X = pd.DataFrame({"t": t, "u": np.sin(t)})
    if names:
        X.insert(0, "trajectory", np.repeat([f"run {i}" for i in range(len(lengths))], lengths))
    return X, pd.DataFrame({"y": np.arange(len(t), dtype=float)})


def trajectories_of(rows, lengths):
    """Name the trajectories of some rows; refuse one that is not whole."""
    owner = np.repeat(np.arange(len(lengths)), lengths)[rows]
    found, counts = np.unique(owner, return_counts=True)
    assert counts.tolist() == [lengths[i] for i in found]
    return found.tolist()


LENGTHS = st.lists(st.integers(1, 40), min_size=2, max_size=12)


# -- TrajectoryKFold -------------------------------------------------------------------------------


@given(lengths=LENGTHS, data=st.data())
def test_folds_are_whole_complete_and_balanced(lengths, data):
    n_splits = data.draw(st.integers(2, len(lengths)))
    shuffle, named = data.draw(st.booleans()), data.draw(st.booleans())
    X, y = records(lengths, named)
    splitter = TrajectoryKFold(n_splits, shuffle=shuffle, random_state=0)
    folds = list(splitter.split(X, y))
    assert len(folds) == splitter.get_n_splits(X, y) == n_splits
    tested = []
    for train, test in folds:
        assert np.array_equal(np.sort(np.concatenate([train, test])), np.arange(len(X)))
        # no more than a fair share and the trajectory that sits on the cut
        assert 0 < len(test) <= len(X) / n_splits + max(lengths)
        trajectories_of(train, lengths)
        tested += trajectories_of(test, lengths)
    assert sorted(tested) == list(range(len(lengths)))


@pytest.mark.parametrize(
    ("lengths", "shares", "expected"),
    [
        ([10] * 6, [1 / 3] * 3, [[0, 1], [2, 3], [4, 5]]),
        ([10] * 5, [0.6, 0.2, 0.2], [[0, 1, 2], [3], [4]]),
        ([100, 1, 1], [1 / 3] * 3, [[0], [1], [2]]),
        ([1, 1, 100], [1 / 3] * 3, [[0], [1], [2]]),
        ([30, 10, 10, 10], [0.5, 0.5], [[0], [1, 2, 3]]),
    ],
)
def test_trajectories_are_dealt_nearest_to_the_shares(lengths, shares, expected):
    assert [part.tolist() for part in deal_in_order(lengths, shares)] == expected


def test_tables_arrays_and_groups_tell_the_same_folds():
    X, y = records([30, 20, 25, 10, 40, 30])
    splitter = TrajectoryKFold(3)
    expected = [test.tolist() for _, test in splitter.split(X, y)]
    moved = X[["u", "t"]].to_numpy()
    ways = (
        splitter.split(X.drop(columns="trajectory"), y),
        splitter.split(X[["t", "u"]].to_numpy(), y.to_numpy()),
        TrajectoryKFold(3, time_column=1).split(moved),
        TrajectoryKFold(3, time_column="clock").split(X[["t", "u"]].rename(columns={"t": "clock"})),
        splitter.split(X[["u"]], groups=X["trajectory"]),
        splitter.split(X.assign(trajectory=0), groups=X["trajectory"]),
    )
    for way in ways:
        assert [test.tolist() for _, test in way] == expected


def test_rows_of_trajectories_may_be_interleaved():
    X, _ = records([20, 20, 20])
    mixed = X.iloc[np.argsort(X["t"].to_numpy(), kind="stable")]
    for train, test in TrajectoryKFold(3).split(mixed):
        apart = set(mixed["trajectory"].iloc[train]) & set(mixed["trajectory"].iloc[test])
        assert not apart
        assert len(test) == 20


@pytest.mark.parametrize("dtype", [float, object, "Float64"])
def test_trajectories_without_y_are_never_tested(dtype):
    X, y = records([20, 20, 20])
    y["y"] = y["y"].where(y.index >= 20, None).astype(dtype)
    for measured in (y, y["y"]):
        for train, test in TrajectoryKFold(2).split(X, measured):
            assert test.min() >= 20
            assert np.isin(np.arange(20), train).all()


def test_only_shuffling_draws():
    X, _ = records([10] * 12)

    def folds(**options):
        return [test.tolist() for _, test in TrajectoryKFold(4, **options).split(X)]

    assert folds() == folds(random_state=1)
    assert folds(shuffle=True, random_state=1) == folds(shuffle=True, random_state=1)
    assert folds(shuffle=True, random_state=1) != folds(shuffle=True, random_state=2)
    assert folds(shuffle=True, random_state=1) != folds()


def test_too_few_trajectories_are_refused_with_a_remedy():
    X, _ = records([20, 20])
    text = r"got 3 folds and 2 trajectories. Remedy: n_splits=2, or more records"
    with pytest.raises(ValueError, match=text):
        next(TrajectoryKFold(3).split(X))
    for n_splits in (1, 2.5, "3"):
        with pytest.raises(ValueError, match="n_splits: expected an integer above 1"):
            next(TrajectoryKFold(n_splits).split(X))


def test_tables_without_a_clock_are_refused_with_a_remedy():
    X, _ = records([20, 20], names=False)
    with pytest.raises(ValueError, match=r"no time 't' among u. Remedy: name the time"):
        next(TrajectoryKFold(2).split(X[["u"]]))
    with pytest.raises(ValueError, match="time is nan in row 3"):
        next(TrajectoryKFold(2).split(X.assign(t=X["t"].where(X.index != 3))))


def test_trajectories_that_would_merge_are_refused_with_a_remedy():
    # 0 to 1 s, 0 to 3 s, 2 to 3 s: without the second, the third seems to go on from the first
    t = np.concatenate([np.arange(0, 1, 0.1), np.arange(0, 3, 0.1), np.arange(2, 3, 0.1)])
    X = pd.DataFrame({"t": t})
    kept = np.r_[0:10, 40:50]
    assert len(split_rows(t[kept])) == 1
    text = r"end in row 9 and begin in row 40 .* from 0.9 s to 2 s. Remedy: give X a column"
    with pytest.raises(ValueError, match=text):
        list(TrajectoryKFold(3).split(X))
    named = X.assign(trajectory=np.repeat([0, 1, 2], [10, 30, 10]))
    assert len(list(TrajectoryKFold(3).split(named))) == 3


@pytest.mark.slow
def test_scikit_learn_takes_the_splitter():
    X, y = datasets.make_golf_robot(sample_rate=100, duration=3)
    pipeline = make_pipeline(PhysicsModelTransformer(GOLF), Ridge())
    scores = cross_val_score(pipeline, X, y, cv=TrajectoryKFold(3))
    halves = np.repeat([0, 1], len(X) // 2)
    grouped = cross_val_score(pipeline, X, y, cv=TrajectoryKFold(2), groups=halves)
    with sklearn.config_context(enable_metadata_routing=True):
        assert np.array_equal(cross_val_score(pipeline, X, y, cv=TrajectoryKFold(3)), scores)
        routed = cross_val_score(pipeline, X, y, cv=TrajectoryKFold(2), params={"groups": halves})
    assert np.array_equal(routed, grouped)
    assert " ".join(repr(TrajectoryKFold(3)).split()) == (
        "TrajectoryKFold(n_splits=3, random_state=None, shuffle=False, time_column=None, "
        "trajectory_column=None)"
    )


# -- train_validation_test_split -------------------------------------------------------------------


@given(lengths=st.lists(st.integers(1, 40), min_size=3, max_size=12), shuffle=st.booleans())
def test_parts_are_whole_and_complete(lengths, shuffle):
    X, y = records(lengths)
    parts = train_validation_test_split(X, y, shuffle=shuffle, random_state=0)
    owners = [trajectories_of(part["y"].to_numpy(dtype=int), lengths) for part in parts[3:]]
    assert sorted(chain(*owners)) == list(range(len(lengths)))
    assert all(owners)
    for table, target in zip(parts[:3], parts[3:], strict=True):
        pd.testing.assert_frame_equal(table, X.loc[target.index])


def test_sizes_count_samples():
    X, y = records([40, 20, 20, 10, 10])
    parts = train_validation_test_split(X, y, sizes=(0.6, 0.2, 0.2))
    assert [len(part) for part in parts] == [60, 20, 20] * 2
    parts = train_validation_test_split(X, y, sizes=(0.4, 0.4, 0.2))
    assert [len(part) for part in parts] == [40, 40, 20] * 2


def test_kinds_are_kept():
    X, y = records([10] * 5)
    parts = train_validation_test_split(X, y["y"])
    assert [type(part) for part in parts] == [pd.DataFrame] * 3 + [pd.Series] * 3
    assert list(parts[1].index) == list(range(30, 40))
    arrays = train_validation_test_split(X[["t", "u"]].to_numpy(), y["y"].to_list())
    assert [type(part) for part in arrays] == [np.ndarray] * 6
    assert arrays[4].tolist() == list(range(30, 40))


def test_by_time_cuts_every_trajectory_in_order():
    lengths = [50, 100, 30]
    X, y = records(lengths)
    parts = train_validation_test_split(X, y, by="time")
    for name, n in zip(X["trajectory"].unique(), lengths, strict=True):
        rows = [part[part["trajectory"] == name].index for part in parts[:3]]
        assert [len(each) for each in rows] == [0.6 * n, 0.2 * n, 0.2 * n]
        assert rows[0][-1] + 1 == rows[1][0]
        assert rows[1][-1] + 1 == rows[2][0]


def test_by_time_refuses_pieces_that_would_merge():
    X, y = records([50, 100], names=False)  # validation: 3 to 4 s, then 6 to 8 s
    with pytest.raises(ValueError, match=r"from 3.9 s to 6 s. Remedy: give X a column"):
        train_validation_test_split(X, y, by="time")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"sizes": (0.6, 0.4)}, r"sizes: expected three shares above 0 that sum to 1, got \(0.6"),
        ({"sizes": (0.8, 0.2, 0.0)}, "sizes: expected three shares"),
        ({"sizes": (0.6, 0.2, 0.3)}, "sizes: expected three shares"),
        ({"by": "row"}, "by: expected one of trajectory, time, got 'row'"),
        ({"by": "time", "shuffle": True}, "Remedy: shuffle=False, or by='trajectory'"),
    ],
)
def test_bad_options_are_named(options, text):
    X, y = records([20, 20, 20])
    with pytest.raises(ValueError, match=text):
        train_validation_test_split(X, y, **options)


def test_too_little_is_refused_with_a_remedy():
    X, y = records([20, 20])
    with pytest.raises(ValueError, match=r"at least 3 trajectories.*got 2. Remedy: by='time'"):
        train_validation_test_split(X, y)
    X, y = records([50, 12])
    text = r"trajectory number 1, which has 12 samples, would have 2; expected at least 4"
    with pytest.raises(ValueError, match=text):
        train_validation_test_split(X, y, by="time")
    with pytest.raises(ValueError, match="inconsistent numbers of samples"):
        train_validation_test_split(X, y[:-1])


# -- search_space ----------------------------------------------------------------------------------


class Core:
    """Stands for a network's core."""

    def __init__(self, neurons=8, layers=2, activation="tanh"):
        pass


class Recurrent:
    """Stands for a core that has no layers to choose."""

    def __init__(self, neurons=8):
        pass


class Network(RegressorMixin, BaseEstimator):
    """Stand for a network with a physical loss: it has the parameters, and shrinks a regression.

    The prediction is (1 - lambda) y of the training data's least squares, the physical residual the
    prediction itself, so that both errors are known.
    """

    def __init__(
        self,
        model=None,
        structure="auto",
        lambda_phy=0.0,
        physics_loss=None,
        free=None,
        corrects=None,
        horizon=1,
        lr=0.01,
        max_epochs=10,
        module=Core,
        module__neurons=8,
        module__layers=2,
    ):
        self.model = model
        self.structure = structure
        self.lambda_phy = lambda_phy
        self.physics_loss = physics_loss
        self.free = free
        self.corrects = corrects
        self.horizon = horizon
        self.lr = lr
        self.max_epochs = max_epochs
        self.module = module
        self.module__neurons = module__neurons
        self.module__layers = module__layers

    def set_params(self, **params):
        """Take parameters of the module as skorch does."""
        for name in [name for name in params if name.startswith("module__")]:
            setattr(self, name, params.pop(name))
        return super().set_params(**params)

    def fit(self, X, y):
        y = np.asarray(y, dtype=float)
        self.slope_ = np.linalg.lstsq(self._u(X), np.nan_to_num(y), rcond=None)[0]
        return self

    def predict(self, X):
        check_is_fitted(self)
        return (1 - self.lambda_phy) * (self._u(X) @ self.slope_)

    def physics_residual(self, X):
        residual = self.predict(X).reshape(len(X), -1).copy()
        residual[0] = np.nan
        return residual

    def _u(self, X):
        return np.asarray(X["u"], dtype=float)[:, None]


class Sparse(RegressorMixin, BaseEstimator):
    """Stand for a sparse regression over a library: it has the parameters."""

    def __init__(self, model=None, library="polynomial", threshold=0.1, optimizer=None):
        self.model = model
        self.library = library
        self.threshold = threshold
        self.optimizer = optimizer


def test_network_with_a_model():
    assert search_space(Network(GOLF)) == {
        "module__neurons": Integer(3, 20),
        "module__layers": Integer(1, 2),
        "lr": Real(1e-3, 3e-2, prior="log-uniform"),
        "lambda_phy": Categorical([0.0, 0.001, 0.01, 0.1, 0.3, 0.9]),
        "structure": Categorical(["output", "increment", "correction"]),
        "horizon": Categorical([1, 20, 50]),
    }


@pytest.mark.parametrize(
    ("network", "missing"),
    [
        (Network(), {"structure", "lambda_phy"}),
        (Network(physics_loss="own"), {"structure"}),
        (Network(GOLF.replace(energy={})), {"lambda_phy"}),
        (Network(GOLF, module=Recurrent), {"module__layers"}),
        (Network(GOLF, structure="dissipative"), {"structure"}),
        (Network(GOLF, free="all"), {"structure"}),
        (Network(GOLF, corrects=["omega"]), {"structure"}),
    ],
)
def test_what_an_estimator_lacks_or_settles_is_not_searched(network, missing):
    assert set(search_space(Network(GOLF))) - set(search_space(network)) == missing


@pytest.mark.parametrize(
    ("model", "why"), [(None, "there is no model"), (GOLF.replace(energy={}), "has no energy")]
)
def test_a_weight_of_no_physical_loss_is_left_out_with_a_word(model, why):
    pipeline = make_pipeline(StandardScaler(), Network(model))
    with pytest.warns(ModelWarning, match=rf"network__lambda_phy: left out .*{why}.*Remedy: 'en"):
        assert "network__lambda_phy" not in search_space(pipeline)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        search_space(pipeline, lambda_phy=None)
        search_space(make_pipeline(StandardScaler(), Network(GOLF)))
        search_space(Network(model, physics_loss="own"))


def test_a_structure_that_is_settled_may_be_left_out_or_searched_all_the_same():
    pipeline = make_pipeline(PhysicsModelTransformer(GOLF), Network(GOLF, structure="dissipative"))
    assert "network__structure" not in search_space(pipeline, structure=None)
    assert search_space(pipeline, structure=["output"])["network__structure"] == ["output"]


def test_sparse_regression():
    threshold = Real(5e-4, 0.1, prior="log-uniform")
    assert search_space(Sparse(GOLF)) == {
        "library": Categorical(["polynomial", "fourier", "model"]),
        "threshold": threshold,
    }
    assert search_space(Sparse())["library"] == Categorical(["polynomial", "fourier"])
    assert "threshold" not in search_space(Sparse(optimizer=Ridge()))


def test_names_lead_to_the_step_they_belong_to():
    inside = make_pipeline(StandardScaler(), ResidualRegressor(GOLF, Sparse()))
    assert set(search_space(inside)) == {
        "residualregressor__regressor__library",
        "residualregressor__regressor__threshold",
    }
    pipeline = make_pipeline(PhysicsModelTransformer(GOLF), Network(GOLF))
    space = search_space(pipeline)
    assert {name.removeprefix("network__") for name in space} == set(search_space(Network(GOLF)))
    pipeline.set_params(**dict.fromkeys(space, 1))  # every name is a parameter


@pytest.mark.parametrize("network", [None, Network(), Network(GOLF.replace(energy={}))])
def test_the_network_of_a_recipe_has_the_prior_as_its_model(network):
    recipe = GreyBoxRegressor(GOLF, network=network)
    space = search_space(make_pipeline(recipe))
    inner = search_space(Network(GOLF))
    assert space == {f"greyboxregressor__network__{name}": inner[name] for name in inner}
    assert recipe.network is network
    make_pipeline(recipe).set_params(**{name: inner[name[27:]].rvs(1)[0] for name in space})


def test_a_recipe_without_networks_has_nothing_to_search():
    for network in (None, Network(), ResidualRegressor(GOLF, Sparse())):
        with pytest.raises(ValueError, match="GreyBoxRegressor has no parameter"):
            search_space(GreyBoxRegressor(GOLF, depths=("prior", "fitted"), network=network))
    inside = GreyBoxRegressor(GOLF, network=ResidualRegressor(GOLF, Sparse()))
    assert set(search_space(inside)) == {
        "network__regressor__library",
        "network__regressor__threshold",
    }


def test_changes_replace_drop_and_add():
    pipeline = make_pipeline(PhysicsModelTransformer(GOLF), Network(GOLF))
    space = search_space(
        pipeline,
        neurons=(2, 4),
        lr=None,
        structure=None,
        physicsmodeltransformer__hold=["zoh", "foh"],
        network__module__activation=["tanh"],
    )
    assert space["network__module__neurons"] == (2, 4)
    assert {"network__lr", "network__structure"}.isdisjoint(space)
    assert space["physicsmodeltransformer__hold"] == ["zoh", "foh"]
    assert space["network__module__activation"] == ["tanh"]


def test_what_cannot_be_searched_is_refused():
    with pytest.raises(ValueError, match=r"neuron: .* \(neurons, layers, lr, lambda_phy, struc"):
        search_space(Network(GOLF), neuron=(2, 4))
    pipeline = make_pipeline(PhysicsModelTransformer(GOLF), Network(GOLF))
    with pytest.raises(ValueError, match=r"transformer__foo: expected a parameter of Pipeline"):
        search_space(pipeline, physicsmodeltransformer__foo=[1, 2])
    for estimator in (pipeline, GreyBoxRegressor(GOLF)):
        with pytest.raises(ValueError, match=r"module__neuron: .* the core .*, one of neurons, la"):
            search_space(estimator, network__module__neuron=(3, 8))
    with pytest.raises(ValueError, match=r"Ridge has no parameter .* Remedy: name what to search"):
        search_space(Ridge())


def test_missing_scikit_optimize_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "skopt", None)
    with pytest.raises(ImportError, match=r'Remedy: pip install "sklearn-pgnn\[tuning\]"'):
        search_space(Network(GOLF))


@pytest.mark.slow
def test_bayesian_search_over_whole_trajectories():
    X, y = datasets.make_golf_robot(sample_rate=100, duration=3)
    pipeline = make_pipeline(PhysicsModelTransformer(GOLF), Ridge())
    space = search_space(pipeline, ridge__alpha=(1e-6, 1e6, "log-uniform"))
    search = BayesSearchCV(pipeline, space, n_iter=4, cv=TrajectoryKFold(3), random_state=0)
    search.fit(X, y)
    tried = [candidate["ridge__alpha"] for candidate in search.cv_results_["params"]]
    assert len(set(tried)) == 4
    best = cross_val_score(
        pipeline.set_params(**search.best_params_), X, y, cv=TrajectoryKFold(3)
    ).mean()
    assert best == pytest.approx(search.best_score_)
    assert search.best_score_ == max(search.cv_results_["mean_test_score"])


@pytest.mark.slow
def test_bayesian_search_may_choose_no_physical_loss(capsys):
    X, _ = records([30] * 3)
    keep = dict.fromkeys(["neurons", "layers", "lr", "structure", "horizon"])
    search = BayesSearchCV(
        Network(GOLF), search_space(Network(GOLF), **keep), n_iter=12, cv=TrajectoryKFold(3),
        random_state=0, verbose=3,
    ).fit(X, 2.0 * X["u"])  # fmt: skip
    tried = {candidate["lambda_phy"] for candidate in search.cv_results_["params"]}
    assert {0.0, 0.9} <= tried
    assert search.best_params_ == {"lambda_phy": 0.0}  # 1 - lambda scales what is exact
    lines = re.findall(r"END .*lambda_phy=0.*score=[-\d]", capsys.readouterr().out)
    assert len(lines) == 3 * 12  # parameters and score of every candidate in every fold


def test_bayesian_search_takes_every_dimension_of_a_network():
    X, _ = records([30] * 3)
    search = BayesSearchCV(
        Network(GOLF),
        search_space(Network(GOLF)),
        n_iter=4,
        cv=TrajectoryKFold(3),
        random_state=0,
    ).fit(X, 2.0 * X["u"])
    assert set(search.best_params_) == set(search_space(Network(GOLF)))


@pytest.mark.slow
def test_memory_saves_simulations_and_changes_no_score(tmp_path, monkeypatch):
    X, y = datasets.make_golf_robot(sample_rate=100, duration=3)
    simulate, tables = FreeRuns.simulate, []

    def counted(runs, model, records, names):
        tables.append(len(records))
        return simulate(runs, model, records, names)

    monkeypatch.setattr(FreeRuns, "simulate", counted)
    found = []
    for memory in (None, str(tmp_path)):
        pipeline = make_pipeline(PhysicsModelTransformer(GOLF), Ridge(), memory=memory)
        tables.clear()
        search = GridSearchCV(pipeline, {"ridge__alpha": [0.1, 1, 10, 100]}, cv=TrajectoryKFold(3))
        search.fit(X, y)
        found.append((search.cv_results_["mean_test_score"], sorted(tables)))
    assert np.array_equal(found[0][0], found[1][0])
    # of 6 records, 2 are tested 12 times; 4 are learnt from 12 times or, remembered, 3 times
    assert found[0][1] == [2] * 12 + [4] * 12 + [6]
    assert found[1][1] == [2] * 12 + [4] * 3 + [6]


# -- pareto_front ----------------------------------------------------------------------------------


class Renamed(TransformerMixin, BaseEstimator):
    """Rename a column, so that a later step finds it only if names are kept."""

    def __init__(self, before="torque"):
        self.before = before

    def fit(self, X, y=None):
        return self

    def transform(self, X):
        return X.rename(columns={self.before: "u"})

    def __sklearn_is_fitted__(self):
        return True


def test_front_of_a_known_trade_off():
    X, _ = records([50, 50])
    u = X["u"].to_numpy()
    lambdas = (0.0, 0.25, 0.5)
    front = pareto_front(Network(GOLF), X, 2 * u, lambdas=lambdas, X_test=X, y_test=2 * u)
    assert list(front.columns) == ["lambda_phy", "error", "physics", "on_front"]
    assert front["lambda_phy"].tolist() == list(lambdas)
    expected = [weight * np.sqrt(np.mean(u**2)) / np.std(u) for weight in lambdas]
    assert front["error"].to_numpy() == pytest.approx(expected, abs=1e-12)
    residual = [np.mean(((1 - weight) * 2 * u[1:]) ** 2) for weight in lambdas]
    assert front["physics"].to_numpy() == pytest.approx(residual)
    assert front["on_front"].all()


def test_error_counts_every_output_by_its_own_spread():
    X, _ = records([50, 50])
    u = X["u"].to_numpy()
    y = np.column_stack([u, 1e4 * u])
    front = pareto_front(Network(), X, y, lambdas=(0.5,), X_test=X, y_test=y)
    assert front["error"][0] == pytest.approx(0.5 * np.sqrt(np.mean(u**2)) / np.std(u))
    gappy = y.copy()
    gappy[::2] = np.nan
    gaps = pareto_front(Network(), X, y, lambdas=(0.5,), X_test=X, y_test=gappy)
    half = u[1::2]
    assert gaps["error"][0] == pytest.approx(0.5 * np.sqrt(np.mean(half**2)) / np.std(half))


def test_folds_are_pooled_and_never_torn():
    X, _ = records([40, 60, 50])
    u = X["u"].to_numpy()
    pooled = pareto_front(Network(), X, 2 * u, lambdas=(0.5,), cv=3)
    assert pooled["error"][0] == pytest.approx(0.5 * np.sqrt(np.mean(u**2)) / np.std(u))
    with joblib.parallel_config("threading"):
        same = pareto_front(Network(), X, 2 * u, lambdas=(0.5,), cv=TrajectoryKFold(3), n_jobs=2)
    pd.testing.assert_frame_equal(pooled, same)
    with pytest.raises(ValueError, match="got 5 folds and 3 trajectories"):
        pareto_front(Network(), X, 2 * u)


def test_pipeline_keeps_names_before_its_last_step():
    X, _ = records([50, 50])
    torque = X.rename(columns={"u": "torque"})
    given = {"lambdas": (0.0, 0.5), "y_test": X["u"]}
    alone = pareto_front(Network(), X, X["u"], X_test=X, **given)
    pipeline = make_pipeline(Renamed(), Network())
    found = pareto_front(pipeline, torque, X["u"], X_test=torque, **given)
    pd.testing.assert_frame_equal(found, alone)
    full = pareto_front(
        make_pipeline(Network()), X, X["u"], X_test=X, param="network__lambda_phy", **given
    )
    pd.testing.assert_frame_equal(full, alone)


def test_estimator_is_left_alone():
    X, _ = records([50, 50])
    network = Network(GOLF, lambda_phy=0.3)
    pareto_front(network, X, X["u"], lambdas=(0.0,), X_test=X, y_test=X["u"])
    assert network.lambda_phy == 0.3
    assert not hasattr(network, "slope_")


class Diverging(Network):
    def predict(self, X):
        found = super().predict(X)
        return np.where(np.arange(len(found)) > 9, np.nan, found) if self.lambda_phy else found


def test_prediction_that_is_not_finite_is_never_on_the_front():
    X, _ = records([50, 50])
    front = pareto_front(
        Diverging(), X, X["u"], lambdas=(0.0, 0.5), X_test=X, y_test=X["u"], n_jobs=1
    )
    assert front["error"].tolist() == [pytest.approx(0.0, abs=1e-12), np.inf]
    assert front["on_front"].tolist() == [True, False]


@given(points=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=12))
def test_front_is_what_no_point_beats(points):
    """Compare with the definition, point by point."""
    found = _not_dominated(*np.array(points, dtype=float).T)
    for (e, r), on_front in zip(points, found, strict=True):
        beaten = any(a <= e and b <= r and (a < e or b < r) for a, b in points)
        assert on_front == (not beaten)


def test_what_cannot_be_judged_is_refused():
    X, y = records([20, 20])
    fixed = {"X_test": X, "y_test": y}
    with pytest.raises(ValueError, match="expected both or none"):
        pareto_front(Network(), X, y, X_test=X)
    with pytest.raises(ValueError, match="got both"):
        pareto_front(Network(), X, y, cv=2, **fixed)
    with pytest.raises(ValueError, match=r"'lambda_phy' in Ridge, got none. Remedy: give the"):
        pareto_front(Ridge(), X, y, **fixed)
    pair = make_pipeline(ResidualRegressor(None, Network()), Network())
    with pytest.raises(ValueError, match=r"got .*residualregressor__regressor__lambda_phy"):
        pareto_front(pair, X, y, **fixed)
    with pytest.raises(ValueError, match=r"Ridge has no physics_residual\(X\). Remedy: end the"):
        pareto_front(Ridge(), X[["u"]], y, param="alpha", lambdas=(1.0,), X_test=X[["u"]], y_test=y)
    with pytest.raises(ValueError, match="output 0 is constant on the tested samples"):
        pareto_front(Network(), X, y, X_test=X, y_test=0 * y)
