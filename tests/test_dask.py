"""What goes through joblib runs on a cluster as here, also where a worker is lost."""

import os
import signal
from functools import partial

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.model_selection import GridSearchCV
from sledge import SLEDGE as CART

from sklearn_pgnn import (
    ModelDiagnosis,
    PGNNLRegressor,
    PhysicsModelRegressor,
    effects,
)
from sklearn_pgnn.estimation import fits_ahead
from sklearn_pgnn.model_selection import TrajectoryKFold

distributed = pytest.importorskip("distributed")

run_batch = fits_ahead._run
CATALOGUE = (effects.CoulombFriction, effects.QuadraticDrag)


def records(level, n_records=4, seed=0):
    """Record a cart with dry friction: columns trajectory, time and force."""
    rng, t = np.random.default_rng(seed), np.arange(0, 20, 0.05)
    rig, X, y = CART + effects.CoulombFriction("v", level=level), [], []
    for i in range(n_records):
        force = 2 * np.sin((0.5 + 0.2 * i) * t) + np.sin(1.9 * t)
        X.append(np.column_stack([np.full(t.size, i), t, force]))
        y.append(rig.simulate(t, force).y + 1e-3 * rng.standard_normal((t.size, 1)))
    return np.concatenate(X), np.concatenate(y)


def table(X):
    """Return the columns as a frame, which names its trajectories."""
    return pd.DataFrame(X, columns=["trajectory", "t", "F"])


def die_once(lost):
    """End the process, unless another one has left the file behind and died."""
    try:
        os.close(os.open(lost, os.O_CREAT | os.O_EXCL))
        os.kill(os.getpid(), signal.SIGKILL)
    except FileExistsError:
        pass


def run_or_die(lost, *of_batch):
    """Fit a hypothesis in a worker, the first of which dies."""
    die_once(lost)
    return run_batch(*of_batch)


def diagnose(level, lost=None):
    """Diagnose records; the first worker that is told of a file dies once, and leaves it behind."""
    if lost is not None:
        die_once(lost)
    X, y = records(level)
    diagnosis = ModelDiagnosis(CART, catalogue=CATALOGUE).fit(table(X), y)
    return diagnosis.to_dict()


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.mark.slow
def test_diagnoses_are_complete_and_the_same_where_a_worker_is_lost(client, tmp_path):
    levels = [0.3, 0.4, 0.5]
    here = [diagnose(level) for level in levels]
    with joblib.parallel_config(backend="dask"):
        there = joblib.Parallel()(
            joblib.delayed(partial(diagnose, lost=str(tmp_path / "lost")))(x) for x in levels
        )
    assert (tmp_path / "lost").exists()
    assert [str(each) for each in there] == [str(each) for each in here]


@pytest.mark.slow
def test_the_hypotheses_of_a_diagnosis_are_fitted_on_a_cluster_also_where_a_worker_is_lost(
    client, tmp_path, monkeypatch
):
    monkeypatch.setattr(fits_ahead, "WORTH_STARTING", -1.0)
    monkeypatch.setattr(fits_ahead, "WORTH", -1.0)
    monkeypatch.setattr(fits_ahead, "_run", partial(run_or_die, str(tmp_path / "lost")))
    here = diagnose(0.4)
    assert not (tmp_path / "lost").exists()
    with joblib.parallel_config(backend="dask"):
        there = diagnose(0.4)
    assert (tmp_path / "lost").exists()
    assert str(there) == str(here)


@pytest.mark.slow
def test_a_search_over_folds_finds_the_same_on_a_cluster(client):
    X, y = records(0.4)
    search = GridSearchCV(
        PhysicsModelRegressor(CART + effects.CoulombFriction("v", level=0.1)),
        {"substeps": [1, 2]}, cv=TrajectoryKFold(2),
    )  # fmt: skip
    here = search.fit(table(X), y).cv_results_["mean_test_score"]
    with joblib.parallel_config(backend="dask"):
        there = search.fit(table(X), y).cv_results_["mean_test_score"]
    assert np.array_equal(here, there)


@pytest.mark.slow
def test_detectability_is_the_same_on_a_cluster(client):
    X, y = records(0.4)
    diagnosis = ModelDiagnosis(CART, catalogue=CATALOGUE).fit(table(X), y)
    here = diagnosis.detectability(n_repeats=20).to_frame()
    with joblib.parallel_config(backend="dask"):
        there = diagnosis.detectability(n_repeats=20).to_frame()
    assert here.equals(there)


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2])
def test_a_network_trains_here_and_to_the_same_weights(client, threads):
    torch = pytest.importorskip("torch")
    X, y = records(0.4)
    frame, had = table(X).assign(v=y[:, 0]), torch.get_num_threads()
    settings = {"max_epochs": 2, "module__neurons": 2, "refine_max_iter": 3, "substeps": 1}

    def moves(dask_scheduler):
        return len(dask_scheduler.transition_log)

    def predict():
        network = PGNNLRegressor(CART, random_state=0, **settings)
        return network.fit(frame, y).predict(frame)

    torch.set_num_threads(threads)
    try:
        here = predict()
        with joblib.parallel_config(backend="dask"):
            before_it = client.run_on_scheduler(moves)
            there = predict()
            assert client.run_on_scheduler(moves) == before_it
    finally:
        torch.set_num_threads(had)
    assert np.array_equal(here, there)
