"""make_pgnn_pipeline: the paper's pipeline in one, by hand, scaled, searched and stored."""

import subprocess
import sys
from pathlib import Path

import joblib
import numpy as np
import pytest
from sklearn.base import clone
from sklearn.compose import ColumnTransformer
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer, MinMaxScaler, RobustScaler, StandardScaler

import sklearn_pgnn
from sklearn_pgnn import (
    PGNNLRegressor,
    PhysicsModelTransformer,
    datasets,
    make_pgnn_pipeline,
    systems,
)
from sklearn_pgnn.model_selection import TrajectorySplit

GOLF = systems.golf_robot()
QUICK = {"max_epochs": 4, "module__neurons": 4, "refine_iterations": 6, "substeps": 2}
ROOT = Path(sklearn_pgnn.__file__).parents[1]


@pytest.fixture(scope="module")
def golf():
    """Give records of the golf robot at 100 Hz."""
    X, y = datasets.make_golf_robot(sample_rate=100, duration=3)
    return X, y["phi_measured"].to_numpy()


def by_hand(scaler, columns, **network):
    scale = ColumnTransformer(
        [("simulation", scaler, columns)],
        remainder="passthrough",
        verbose_feature_names_out=False,
    )
    return Pipeline(
        [
            ("physics", PhysicsModelTransformer(GOLF, append="all").set_output(transform="pandas")),
            ("scale", scale.set_output(transform="pandas")),
            ("network", PGNNLRegressor(GOLF, **network)),
        ]
    )


PHY = ["phi_phy", "omega_phy", "phi_measured_phy"]


@pytest.mark.parametrize("structure", ["output", "increment", "correction"])
def test_written_out_by_hand_it_is_the_same(golf, structure):
    X, y = golf
    options = {**QUICK, "structure": structure, "lambda_phy": 0.2}
    made = make_pgnn_pipeline(GOLF, **options).fit(X, y)
    hand = by_hand(StandardScaler(), PHY, **options).fit(X, y)
    assert np.array_equal(made.predict(X), hand.predict(X))


@pytest.mark.parametrize(
    "scaler", [MinMaxScaler(), RobustScaler(), FunctionTransformer()], ids=lambda s: str(s)
)
def test_any_scaler_of_the_simulation_gives_the_same_network(golf, scaler):
    """The network standardises what it sees; a line before it changes nothing but roundings."""
    X, y = golf
    options = {**QUICK, "structure": "increment", "refine": None, "lambda_phy": 0.2}
    made = make_pgnn_pipeline(GOLF, **options).fit(X, y)
    other = by_hand(scaler.set_output(transform="pandas"), PHY, **options).fit(X, y)
    losses = [np.array(each[-1].history[:, "train_loss"]) for each in (made, other)]
    assert losses[1] == pytest.approx(losses[0], rel=1e-6)


def test_network_alone_simulates_for_itself(golf):
    X, y = golf
    options = {**QUICK, "structure": "increment", "refine": None}
    made = make_pgnn_pipeline(GOLF, **options).fit(X, y)
    alone = PGNNLRegressor(GOLF, **options).fit(X, y)
    mine, own = (np.array(each.history[:, "train_loss"]) for each in (made[-1], alone))
    assert mine == pytest.approx(own, rel=0.05)  # substeps may differ


def test_array_from_the_transformer_is_read(golf):
    X, y = golf
    one = (X["trajectory"] == X["trajectory"].iloc[0]).to_numpy()
    table = X.loc[one, ["t", "torque"]]
    transformer = PhysicsModelTransformer(GOLF, append="all")
    array = transformer.fit(table.to_numpy()).transform(table.to_numpy())
    net = PGNNLRegressor(GOLF, structure="increment", **QUICK).fit(array, y[one])
    assert net.n_features_in_ == array.shape[1]
    assert np.isfinite(net.predict(array)).all()


def test_parameters_are_reached_by_name(golf):
    pipeline = make_pgnn_pipeline(GOLF, lambda_phy=0.1, module__neurons=3)
    assert list(pipeline.named_steps) == ["physics", "scale", "network"]
    pipeline.set_params(network__lambda_phy=0.3, network__module__neurons=7)
    params = clone(pipeline)[-1].get_params()
    assert params["lambda_phy"] == 0.3
    assert params["module__neurons"] == 7
    with pytest.raises(TypeError):
        make_pgnn_pipeline(GOLF, 3)


def test_memory_keeps_the_simulation(golf, tmp_path):
    X, y = golf
    pipeline = make_pgnn_pipeline(GOLF, memory=str(tmp_path), structure="increment", **QUICK)
    first = pipeline.fit(X, y).predict(X)
    assert list(tmp_path.rglob("output.pkl"))
    kept = make_pgnn_pipeline(GOLF, structure="increment", **QUICK).fit(X, y)
    assert np.array_equal(clone(pipeline).fit(X, y).predict(X), first)
    assert np.array_equal(kept.predict(X), first)


def test_scikit_learn_around_it(golf):
    X, y = golf
    pipeline = make_pgnn_pipeline(GOLF, **QUICK)
    scores = cross_val_score(pipeline, X, y, cv=TrajectorySplit(2))
    assert np.isfinite(scores).all()
    grid = {"network__structure": ["increment", "correction"]}
    search = GridSearchCV(pipeline, grid, cv=TrajectorySplit(2)).fit(X, y)
    assert search.best_params_ == {"network__structure": "correction"}


LOAD = """
import joblib, numpy as np
best, X = joblib.load("best.joblib")
np.save("found.npy", best.predict(X))
"""


def test_best_of_a_search_survives_in_a_fresh_process(golf, tmp_path):
    skopt = pytest.importorskip("skopt")
    X, y = golf
    search = skopt.BayesSearchCV(
        make_pgnn_pipeline(GOLF, **QUICK),
        {
            "network__module__neurons": (2, 6),
            "network__lr": (1e-3, 3e-2, "log-uniform"),
            "network__lambda_phy": (0.0, 0.5),
        },
        n_iter=3, cv=TrajectorySplit(2), random_state=0,
    ).fit(X, y)  # fmt: skip
    assert np.isfinite(search.best_score_)
    joblib.dump((search.best_estimator_, X), tmp_path / "best.joblib")
    script = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{LOAD}"
    result = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert np.array_equal(np.load(tmp_path / "found.npy"), search.best_estimator_.predict(X))
