"""make_pgnn_pipeline: the paper's pipeline in one, by hand, scaled, searched and stored."""

import subprocess
import sys
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
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
    effects,
    make_pgnn_pipeline,
    systems,
)
from sklearn_pgnn.exceptions import OptionError, SimulationWarning
from sklearn_pgnn.model_selection import TrajectoryKFold

GOLF = systems.golf_robot()
QUICK = {"max_epochs": 4, "module__neurons": 4, "refine_max_iter": 6, "substeps": 2}
ROOT = Path(sklearn_pgnn.__file__).parents[1]


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


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["output", "increment", "correction"])
def test_written_out_by_hand_it_is_the_same(golf, structure):
    X, y = golf
    options = {**QUICK, "structure": structure, "lambda_phy": 0.2}
    made = make_pgnn_pipeline(GOLF, **options).fit(X, y)
    hand = by_hand(StandardScaler(), PHY, **options).fit(X, y)
    assert np.array_equal(made.predict(X), hand.predict(X))


@pytest.mark.slow
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


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_the_tables_between_the_steps_are_of_the_library_asked_for(golf, library):
    X, y = golf
    made = make_pgnn_pipeline(GOLF, **{**QUICK, "max_epochs": 1, "refine": None})
    expected = clone(made).fit(X, y).predict(X)
    asked = made.set_output(transform=library).fit(X, y)
    assert type(asked[:-1].transform(X)).__module__.startswith(library)
    assert np.array_equal(asked.predict(X), expected)
    names = list(asked[:-1].transform(X).columns)
    assert names == [*PHY, *X.columns]


def test_an_array_between_the_steps_has_no_names():
    with pytest.raises(OptionError, match=r"by their names, got 'default'. Remedy: set_output\("):
        make_pgnn_pipeline(GOLF).set_output(transform="default")


def plain_by_hand(**network):
    return Pipeline(
        [("physics", PhysicsModelTransformer(GOLF)), ("net", PGNNLRegressor(GOLF, **network))]
    )


@pytest.fixture(scope="module")
def thrown():
    """Return records with an initial speed, unlike the model's initial state."""
    t = np.arange(0, 3, 0.01)
    frames, outputs = [], []
    for i in range(3):
        torque = 0.3 * np.sin((2 + i) * t)
        run = (GOLF + effects.CoulombFriction("omega", level=0.05)).simulate(
            t, torque, [0.5 * i, 6.0 - 3 * i], substeps=4
        )
        frame = pd.DataFrame({"trajectory": i, "t": t, "torque": torque})
        frame[["phi", "omega"]] = run.x
        frames.append(frame)
        outputs.append(run.y[:, 0])
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["increment", "correction"])
def test_pipeline_of_two_lines_keeps_the_initial_state(thrown, structure):
    X, y = thrown
    options = {**QUICK, "structure": structure, "max_epochs": 20}
    plain = plain_by_hand(**options).fit(X, y)
    made = make_pgnn_pipeline(GOLF, **options).fit(X, y)
    assert plain.score(X, y) > 0.9
    assert plain.predict(X) == pytest.approx(made.predict(X), abs=1e-6)
    no_starts = X.drop(columns=["phi", "omega"])
    assert plain_by_hand(**options).fit(no_starts, y).score(no_starts, y) < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("build", [make_pgnn_pipeline, lambda _, **n: plain_by_hand(**n)])
@pytest.mark.parametrize("columns", [["t", "torque"], ["t", "torque", "phi", "omega"]])
def test_pipeline_of_arrays(thrown, build, columns):
    X, y = thrown
    table, array = X[columns], X[columns].to_numpy()
    options = {**QUICK, "structure": "increment"}
    net = build(GOLF, **options).fit(array, y)
    named = build(GOLF, **options).fit(table, y)
    assert net.predict(array) == pytest.approx(named.predict(table), abs=1e-9)


@pytest.mark.slow
def test_time_may_stand_anywhere_in_an_array(thrown):
    X, y = thrown
    options = {**QUICK, "structure": "increment"}
    net = plain_by_hand(**options).fit(X[["t", "torque"]].to_numpy(), y)
    moved = plain_by_hand(time_column=1, **options).set_params(physics__time_column=1)
    moved.fit(X[["torque", "t"]].to_numpy(), y)
    expected = net.predict(X[["t", "torque"]].to_numpy())
    assert np.array_equal(moved.predict(X[["torque", "t"]].to_numpy()), expected)


@pytest.mark.filterwarnings("ignore::UserWarning")  # such a model's states cannot be estimated
def test_runaway_prior_reaches_no_scaler(thrown):
    X, y = thrown
    runaway = GOLF.replace(
        equations={**GOLF.equations, "omega": "400*(omega + phi)"}, energy={}, name="runaway"
    )
    net = make_pgnn_pipeline(runaway, **QUICK, structure="increment")
    with pytest.warns(SimulationWarning, match="Remedy"):
        net.fit(X, y)
    with pytest.warns(SimulationWarning, match="Remedy"):
        assert np.isfinite(net.predict(X)).all()


def test_parameters_are_reached_by_name(golf):
    pipeline = make_pgnn_pipeline(GOLF, lambda_phy=0.1, module__neurons=3)
    assert list(pipeline.named_steps) == ["physics", "scale", "network"]
    pipeline.set_params(network__lambda_phy=0.3, network__module__neurons=7)
    params = clone(pipeline)[-1].get_params()
    assert params["lambda_phy"] == 0.3
    assert params["module__neurons"] == 7
    with pytest.raises(TypeError):
        make_pgnn_pipeline(GOLF, 3)


@pytest.mark.slow
def test_verbose_tells_of_every_step_and_phase(golf, capsys):
    make_pgnn_pipeline(GOLF, **QUICK).fit(*golf)
    assert capsys.readouterr().out == ""
    make_pgnn_pipeline(GOLF, verbose=1, **QUICK).fit(*golf)
    printed = capsys.readouterr().out
    for said in ("Processing physics", "single steps", "train_loss", "whole trajectories"):
        assert said in printed


@pytest.mark.slow
def test_memory_keeps_the_simulation(golf, tmp_path):
    X, y = golf
    pipeline = make_pgnn_pipeline(GOLF, memory=str(tmp_path), structure="increment", **QUICK)
    first = pipeline.fit(X, y).predict(X)
    assert list(tmp_path.rglob("output.pkl"))
    kept = make_pgnn_pipeline(GOLF, structure="increment", **QUICK).fit(X, y)
    assert np.array_equal(clone(pipeline).fit(X, y).predict(X), first)
    assert np.array_equal(kept.predict(X), first)


@pytest.mark.slow
def test_scikit_learn_around_it(golf):
    X, y = golf
    pipeline = make_pgnn_pipeline(GOLF, **QUICK)
    scores = cross_val_score(pipeline, X, y, cv=TrajectoryKFold(2))
    assert np.isfinite(scores).all()
    grid = {"network__structure": ["increment", "correction"]}
    search = GridSearchCV(pipeline, grid, cv=TrajectoryKFold(2)).fit(X, y)
    assert search.best_params_ == {"network__structure": "correction"}


LOAD = """
import joblib, numpy as np
best, X = joblib.load("best.joblib")
np.save("found.npy", best.predict(X))
"""


@pytest.mark.slow
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
        n_iter=3, cv=TrajectoryKFold(2), random_state=0,
    ).fit(X, y)  # fmt: skip
    assert np.isfinite(search.best_score_)
    joblib.dump((search.best_estimator_, X), tmp_path / "best.joblib")
    script = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{LOAD}"
    result = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert np.array_equal(np.load(tmp_path / "found.npy"), search.best_estimator_.predict(X))
