"""What is fitted survives: joblib in another process, deepcopy, clone, skops; to the last bit."""

import copy
import inspect
import pkgutil
import re
import subprocess
import sys
import warnings
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import pytest
import torch
from sklearn.base import clone
from sklearn.linear_model import SGDRegressor

import sklearn_pgnn
from sklearn_pgnn import (
    ConformalRegressor,
    EnsembleRegressor,
    GreyBoxRegressor,
    ModelDiagnosis,
    PGNNLRegressor,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
    SINDYcRegressor,
    effects,
    make_pgnn_pipeline,
    network,
    systems,
)
from sklearn_pgnn.model_selection import TrajectoryKFold, search_space

CART = systems.cart_on_spring()
QUICK = {"max_epochs": 3, "module__neurons": 3, "refine_max_iter": 5, "substeps": 1}
ROOT = Path(sklearn_pgnn.__file__).parents[1]


def records():
    rng = np.random.default_rng(0)
    truth = CART.with_parameters(d=3.0)
    frames, outputs = [], []
    for i in range(3):
        t = np.arange(150) * 0.02
        force = 4 * np.sin(rng.uniform(1, 6) * t)
        run = truth.simulate(t, force, [0.05 * i, 0.0])
        frame = pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": 0.05 * i, "v": 0.0})
        frames.append(frame)
        outputs.append(run.y[:, 0] + 1e-3 * rng.normal(size=t.size))
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


X, Y = records()

EFFECTS = (effects.WrongParameter, effects.QuadraticDrag)
#: every public estimator, small
ESTIMATORS = {
    "PhysicsModelTransformer": PhysicsModelTransformer(CART),
    "PhysicsModelRegressor": PhysicsModelRegressor(CART, search="local"),
    "ResidualRegressor": ResidualRegressor(CART),
    "SINDYcRegressor": SINDYcRegressor(CART),
    "ModelDiagnosis": ModelDiagnosis(CART, targets=["v", "d"], catalogue=EFFECTS, max_causes=1),
    "ConformalRegressor": ConformalRegressor(ResidualRegressor(CART)),
    "EnsembleRegressor": EnsembleRegressor(ResidualRegressor(CART, SGDRegressor()), 2),
    "GreyBoxRegressor": GreyBoxRegressor(CART, depths=["prior", "fitted"]),
    "PGNNLRegressor": PGNNLRegressor(CART, structure="correction", **QUICK),
    "PGNNLRegressor with physics": PGNNLRegressor(
        CART, lambda_phy=0.2, structure="increment", horizon=3, rollout_epochs=1,
        physics_loss=[network.EnergyBalance(), network.Bounds({"x": (-9, 9)})], **QUICK,
    ),
    "PGNNLRegressor, recurrent": PGNNLRegressor(
        CART, module=network.Recurrent, module__neurons=3, max_epochs=2, substeps=1
    ),
    "PGNNLRegressor without a model": PGNNLRegressor(states=["x", "v"], **QUICK),
    "make_pgnn_pipeline": make_pgnn_pipeline(CART, structure="increment", **QUICK),
}  # fmt: skip

MODEL = "sklearn_pgnn.physics.model.PhysicsModel"
TRANSFORMER = "sklearn_pgnn.preprocessing.physics_model_transformer.PhysicsModelTransformer"
SKORCH = {
    "functools.partial",
    "skorch.dataset.Dataset",
    "skorch.history.History",
    "skorch.setter.optimizer_setter",
    "torch.nn.modules.loss.MSELoss",
    "torch.optim.adam.Adam",
    "torch.utils.data.dataloader.DataLoader",
}
CORES = "sklearn_pgnn.estimators.network.cores"
PLAIN = SKORCH | {
    MODEL,
    "sklearn_pgnn.estimators.network.batches.TensorBatches",
    "sklearn_pgnn.estimators.pgnnl.PGNNLRegressor",
    "sklearn_pgnn.simulation.network_run.NetworkStep",
}
LOSS = "sklearn_pgnn.estimators.network.physics_loss"
GUIDED = PLAIN | {
    f"{LOSS}.EnergyBalance",
    f"{LOSS}.PhysicsLoss",
    f"{LOSS}._Energy",
    f"{LOSS}._Energy.surplus",
}
FEED_FORWARD = f"{CORES}.FeedForward"
RESULTS = ("Gain", "NamedCause", "RetunedParameter", "Rival", "Tried")
#: what `skops.io.loads` must be told to trust, by estimator
TRUSTED = {
    "PhysicsModelTransformer": {MODEL, TRANSFORMER},
    "PhysicsModelRegressor": {
        MODEL,
        "sklearn_pgnn.estimators.physics_model_regressor.PhysicsModelRegressor",
        "sklearn_pgnn.simulation.uncertainty.Estimate",
    },
    "ResidualRegressor": {
        MODEL,
        "sklearn_pgnn.estimators.residual_regressor.ResidualRegressor",
    },
    "SINDYcRegressor": {MODEL, "sklearn_pgnn.estimators.sindyc.SINDYcRegressor"},
    "ModelDiagnosis": {
        MODEL,
        "sklearn_pgnn.diagnosis.free_run.FreeRunError",
        "sklearn_pgnn.diagnosis.model_diagnosis.ModelDiagnosis",
        "sklearn_pgnn.record_quality.finding.Finding",
        "sklearn_pgnn.experiment_design.separation.Experiment",
        "sklearn_pgnn.experiment_design.separation.Separation",
        "sklearn_pgnn.experiment_design.separation.Wave",
        "sklearn_pgnn.estimation.candidate.Candidate",
        "sklearn_pgnn.estimation.problem.EstimationProblem",
        "sklearn_pgnn.diagnosis.unexplained.MissingPart",
        "sklearn_pgnn.diagnosis.verdict.Remaining",
        "sklearn_pgnn.diagnosis.structure.Structure",
        "sklearn_pgnn.physics.scales.Scales",
        "sklearn_pgnn.physics.effects.formula.Formula",
        "sklearn_pgnn.simulation.state_estimate.StateEstimator",
        "sklearn_pgnn.simulation.smoothed_output.SmoothedOutput",
        "sklearn_pgnn.simulation.state_sources.Source",
        "sklearn_pgnn.simulation.state_sources.TakenState",
        "sklearn_pgnn.simulation.window_fit.ParameterPrior",
        "sklearn_pgnn.estimation.fitted_records.DiagnosisRecords",
        "sklearn_pgnn.estimation.fitted_records.FittedWindows",
        *(f"sklearn_pgnn.diagnosis.result.{name}" for name in RESULTS),
        "sklearn_pgnn.simulation.uncertainty.Estimate",
        "sklearn_pgnn.simulation.windows.ShootingWindows",
        *(f"{effect.__module__}.{effect.__name__}" for effect in EFFECTS),
    },
    "ConformalRegressor": {
        MODEL,
        "sklearn_pgnn.estimators.residual_regressor.ResidualRegressor",
        "sklearn_pgnn.prediction.conformal_regressor.ConformalRegressor",
    },
    "EnsembleRegressor": {
        MODEL,
        "sklearn_pgnn.estimators.residual_regressor.ResidualRegressor",
        "sklearn_pgnn.prediction.ensemble_regressor.EnsembleRegressor",
    },
    "GreyBoxRegressor": {
        MODEL,
        "sklearn_pgnn.estimators.physics_model_regressor.PhysicsModelRegressor",
        "sklearn_pgnn.grey_box.depth.FittedDepth",
        "sklearn_pgnn.grey_box.grey_box_regressor.GreyBoxRegressor",
        "sklearn_pgnn.simulation.uncertainty.Estimate",
    },
    "PGNNLRegressor": GUIDED | {FEED_FORWARD},
    "PGNNLRegressor with physics": GUIDED
    | {FEED_FORWARD, f"{LOSS}.Bounds", f"{LOSS}._state_excess"},
    "PGNNLRegressor, recurrent": GUIDED | {f"{CORES}.Recurrent"},
    "PGNNLRegressor without a model": PLAIN | {FEED_FORWARD},
    "make_pgnn_pipeline": GUIDED
    | {
        FEED_FORWARD,
        TRANSFORMER,
        "sklearn_pgnn.pipeline.NamedColumns",
        "sklearn_pgnn.pipeline.simulated_columns",
    },
}


def numbers(estimator):
    """Return the predictions, or the transformation, of an estimator for X."""
    says = getattr(estimator, "predict", None) or estimator.transform
    return np.asarray(says(X), dtype=float)


@pytest.fixture(scope="module")
def fitted():
    """Return every estimator, fitted."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # short records: convergence, poor excitation
        return {name: clone(each).fit(X, Y) for name, each in ESTIMATORS.items()}


def run_elsewhere(script, folder):
    """Run a script in a fresh process, in a folder."""
    path = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
    result = subprocess.run(
        [sys.executable, "-c", path + script], cwd=folder, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr


LOAD_ALL = """
import joblib, numpy as np
fitted, X = joblib.load("fitted.joblib")
found = {}
for name, each in fitted.items():
    says = getattr(each, "predict", None) or each.transform
    found[name] = np.asarray(says(X), dtype=float)
np.savez("found.npz", **found)
"""


def test_every_public_estimator_is_here():
    public = {
        name
        for name in sklearn_pgnn.__all__
        if inspect.isclass(getattr(sklearn_pgnn, name))
        and hasattr(getattr(sklearn_pgnn, name), "fit")
    }
    public.remove("FleetDiagnosis")  # predicts nothing: tests/fleet
    assert public <= {type(each).__name__ for each in ESTIMATORS.values()}


@pytest.mark.slow
def test_another_process_gives_the_same(fitted, tmp_path):
    joblib.dump((fitted, X), tmp_path / "fitted.joblib")
    run_elsewhere(LOAD_ALL, tmp_path)
    found = np.load(tmp_path / "found.npz")
    assert set(found) == set(fitted)
    for name, each in fitted.items():
        assert np.array_equal(found[name], numbers(each), equal_nan=True), name


@pytest.mark.parametrize("name", ESTIMATORS)
def test_copy_gives_the_same(fitted, name):
    expected = numbers(fitted[name])
    assert np.isfinite(expected).any()
    assert np.array_equal(numbers(copy.deepcopy(fitted[name])), expected, equal_nan=True)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ESTIMATORS)
def test_clone_learns_the_same(fitted, name):
    fresh = clone(fitted[name])
    with pytest.raises(Exception, match=r"not fitted|fit.* first|not initialized"):
        numbers(fresh)
    assert np.array_equal(numbers(fresh.fit(X, Y)), numbers(fitted[name]), equal_nan=True)


@pytest.mark.parametrize("name", TRUSTED)
def test_skops_asks_for_the_types_that_the_documentation_lists(fitted, name):
    io = pytest.importorskip("skops.io")
    assert set(io.get_untrusted_types(data=io.dumps(fitted[name]))) <= TRUSTED[name]


def test_the_documentation_lists_these_types():
    page = (Path(__file__).parents[1] / "docs" / "networks.rst").read_text(encoding="utf-8")
    section = page[page.index(".. _persistence:") : page.index("References\n----------")]
    listed = set(
        re.findall(r"``((?:sklearn_pgnn|skorch|torch|functools|sklearn)\.[\w.]+)``", section)
    )
    own = {f"{type(each).__module__}.{type(each).__name__}" for each in ESTIMATORS.values()}
    own |= {TRANSFORMER, *(f"{effect.__module__}.{effect.__name__}" for effect in EFFECTS)}
    assert set().union(*TRUSTED.values()) - own <= listed
    for name in listed:  # nothing that has moved on
        assert pkgutil.resolve_name(name) is not None


LOAD_TRUSTED = """
import joblib, numpy as np, skops.io
data, trusted, X = joblib.load("data.joblib")
found = {}
for name in data:
    each = skops.io.loads(data[name], trusted=sorted(trusted[name]))
    says = getattr(each, "predict", None) or each.transform
    found[name] = np.asarray(says(X), dtype=float)
np.savez("found.npz", **found)
"""


@pytest.mark.slow
def test_skops_loads_the_same_in_another_process(fitted, tmp_path):
    io = pytest.importorskip("skops.io")
    assert set(TRUSTED) == set(ESTIMATORS)
    data = {name: io.dumps(each) for name, each in fitted.items()}
    joblib.dump((data, TRUSTED, X), tmp_path / "data.joblib")
    run_elsewhere(LOAD_TRUSTED, tmp_path)
    found = np.load(tmp_path / "found.npz")
    for name, each in fitted.items():
        assert np.array_equal(found[name], numbers(each), equal_nan=True), name


def test_skops_keeps_all_that_a_diagnosis_says(fitted):
    io = pytest.importorskip("skops.io")
    diagnosis = fitted["ModelDiagnosis"]
    assert diagnosis.causes_ or diagnosis.discrepancy_
    assert {tried.effect for tried in diagnosis.candidates_} == {effect.id for effect in EFFECTS}
    loaded = io.loads(io.dumps(diagnosis), trusted=sorted(TRUSTED["ModelDiagnosis"]))
    assert loaded.candidates_ == diagnosis.candidates_
    assert loaded.to_dict() == diagnosis.to_dict()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_search_survives(tmp_path):
    """A fitted search, with the estimators in it."""
    skopt = pytest.importorskip("skopt")
    pipeline = make_pgnn_pipeline(CART, structure="increment", **QUICK)
    space = search_space(pipeline, layers=None, structure=None, horizon=None)
    search = skopt.BayesSearchCV(pipeline, space, n_iter=2, cv=TrajectoryKFold(3), random_state=0)
    search.fit(X, Y)
    joblib.dump(({"search": search}, X), tmp_path / "fitted.joblib")
    run_elsewhere(LOAD_ALL, tmp_path)
    expected = numbers(search)
    assert np.array_equal(np.load(tmp_path / "found.npz")["search"], expected)
    assert np.array_equal(numbers(copy.deepcopy(search)), expected)
    assert np.array_equal(numbers(clone(search).fit(X, Y)), expected)


NETWORKS = [name for name in ESTIMATORS if name.startswith("PGNNL")]


@pytest.mark.parametrize("name", NETWORKS)
def test_loaded_network_is_whole(fitted, name):
    """It tells its history, its residuals and its steps, and it can be trained on."""
    before = torch.random.get_rng_state()
    net = copy.deepcopy(fitted[name])
    assert torch.equal(torch.random.get_rng_state(), before)
    assert net.history[:, "train_loss"] == fitted[name].history[:, "train_loss"]
    assert net.free_run_error_ == fitted[name].free_run_error_
    if net.model is not None:
        assert np.array_equal(
            net.physics_residual(X), fitted[name].physics_residual(X), equal_nan=True
        )
    if net.module is not network.Recurrent:
        forces = X["force"][:20]
        found = [[each.step(u) for u in forces] for each in (net.stepper(), fitted[name].stepper())]
        assert np.array_equal(*found)
    original = numbers(net)
    net.partial_fit(X, Y)
    assert len(net.history) > len(fitted[name].history)
    assert np.array_equal(numbers(fitted[name]), original)


def test_unfitted_network_is_copied_as_it_is():
    net = copy.deepcopy(PGNNLRegressor(CART, **QUICK))
    assert not net.initialized_
    assert np.isfinite(numbers(net.fit(X, Y))).all()


def test_network_of_independent_rows_survives():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(100, 3))
    net = PGNNLRegressor(max_epochs=3).fit(A, A[:, :2])
    assert np.array_equal(copy.deepcopy(net).predict(A), net.predict(A))
