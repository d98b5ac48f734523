"""What was judged is what is handed over: the model file's free run is the report's number."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from sklearn_pgnn import (
    ModelDiagnosis,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    effects,
    systems,
)
from sklearn_pgnn.cli.output import strict_json
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.inspection.report import render_report
from sklearn_pgnn.physics.effects.formula import Formula

STATES = ["x", "v"]
GROUND = {"window_length": 3.0, "noise_std": [1e-3]}


def oscillator(**changes):
    """A lightly damped oscillator; its records have about nine samples a period."""
    said = {
        "states": {"x": "m", "v": "m/s"},
        "inputs": {"F": "N"},
        "parameters": {"m": {"value": 1.0, "fixed": True}, "d": 0.2, "k": 39.5},
        "equations": {"x": "v", "v": "(F - d*v - k*x)/m"},
        "outputs": {"position": "x"},
        "inertia": {"v": "m"},
    }
    return PhysicsModel(**(said | changes))


def smooth_records(n_records, *, starts, n_samples=400, seed=0):
    """Records under a smooth force, simulated finely, that begin in motion."""
    rng, rig = np.random.default_rng(seed), oscillator() + effects.CubicStiffness("v", 40.0)
    tables, outputs = [], []
    for record in range(n_records):
        fine = np.arange(20 * n_samples) / 180.0
        rates = rng.uniform(0.5, 6.0, 12)[:, None] * fine + rng.uniform(0, 6, 12)[:, None]
        force = 0.4 * np.sin(rates).sum(axis=0)
        run = rig.simulate(fine, force, starts[record])
        tables.append(
            pd.DataFrame(
                {"trajectory": record, "t": fine[::20], "F": force[::20], "x": np.nan, "v": np.nan}
            )
        )
        outputs.append(run.y[::20, 0])
    y = np.concatenate(outputs)
    return pd.concat(tables, ignore_index=True), y + 1e-3 * rng.standard_normal(y.size)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture(scope="module")
def one_record():
    """One record that begins in motion; nothing tells where."""
    X, y = smooth_records(1, starts=[[0.1, 0.0]], n_samples=800)
    prior = oscillator().with_parameters(k=39.0, d=0.22)
    return X, y, ModelDiagnosis(prior, catalogue=[effects.CubicStiffness], **GROUND).fit(X, y)


@pytest.fixture(scope="module")
def told_records():
    """Two records whose first rows tell where they begin."""
    starts = [[0.3, 0.0], [-0.2, 0.5]]
    X, y = smooth_records(2, starts=starts)
    X.loc[~X["trajectory"].duplicated(), STATES] = starts
    prior = oscillator(simulation={"hold": "foh", "substeps": 4}).with_parameters(k=38.0)
    return X, y, ModelDiagnosis(prior, catalogue=[effects.CubicStiffness], **GROUND).fit(X, y)


@pytest.mark.slow
def test_the_models_carry_what_they_were_judged_with(one_record):
    diagnosis = one_record[2]
    said = {"hold": "foh", "substeps": diagnosis.substeps_}
    assert diagnosis.hold_ == "foh"
    assert dict(diagnosis.extended_model_.simulation) == said
    assert dict(diagnosis.refitted_model_.simulation) == said
    assert dict(diagnosis.model.simulation) == {}
    assert diagnosis.to_dict()["substeps"] == diagnosis.substeps_


@pytest.mark.slow
def test_the_file_alone_gives_the_reports_number(one_record, tmp_path):
    X, y, diagnosis = one_record
    diagnosis.extended_model_.to_yaml(tmp_path / "extended_model.yaml")
    model = PhysicsModel.from_yaml(tmp_path / "extended_model.yaml")
    stated = diagnosis.to_dict()["free_run"]["position"]["extended"]
    assert stated < 4e-3
    assert rms(model.simulate(X["t"], X["F"]).y[:, 0] - y) == pytest.approx(stated, rel=1e-9)
    transformer = PhysicsModelTransformer(model, outputs=["position"], append=False)
    assert rms(transformer.fit_transform(X)["position_phy"] - y) == pytest.approx(stated, rel=1e-9)
    assert rms(diagnosis.predict(X) - y) == pytest.approx(stated, rel=1e-9)


def test_the_other_models_give_theirs_from_starts_of_their_own(one_record):
    X, y, diagnosis = one_record
    stated, starts = diagnosis.free_run_["position"], diagnosis.records_.starts
    options = {"hold": diagnosis.hold_, "substeps": diagnosis.substeps_}
    prior = diagnosis.model.simulate(X["t"], X["F"], starts["prior"][0], **options)
    assert rms(prior.y[:, 0] - y) == pytest.approx(stated.prior, rel=1e-9)
    refitted = diagnosis.refitted_model_.simulate(X["t"], X["F"])
    assert rms(refitted.y[:, 0] - y) == pytest.approx(stated.refitted, rel=1e-9)
    assert stated.extended < stated.refitted < stated.prior


@pytest.mark.slow
def test_records_that_tell_their_starts_give_the_reports_number(told_records, tmp_path):
    X, y, diagnosis = told_records
    diagnosis.extended_model_.to_yaml(tmp_path / "extended_model.yaml")
    model = PhysicsModel.from_yaml(tmp_path / "extended_model.yaml")
    stated = diagnosis.free_run_["position"].extended
    assert diagnosis.initial_states_.tolist() == [[0.3, 0.0], [-0.2, 0.5]]
    assert dict(model.initial_state) == dict(diagnosis.model.initial_state)
    simulated = PhysicsModelTransformer(model, outputs=["position"], append=False).fit_transform(X)
    assert rms(simulated["position_phy"] - y) == pytest.approx(stated, rel=1e-9)
    errors = [
        model.simulate(rows["t"], rows["F"], rows[STATES].iloc[0]).y[:, 0] - y[rows.index]
        for _, rows in X.groupby("trajectory")
    ]
    assert rms(np.concatenate(errors)) == pytest.approx(stated, rel=1e-9)


@pytest.mark.slow
def test_what_the_prior_says_is_believed(told_records):
    X, y, diagnosis = told_records
    assert (diagnosis.hold_, diagnosis.substeps_) == ("foh", 4)
    told = ModelDiagnosis(diagnosis.model, catalogue=(), hold="zoh", substeps=2).fit(X, y)
    assert (told.hold_, told.substeps_) == ("zoh", 2)
    assert dict(told.extended_model_.simulation) == {"hold": "zoh", "substeps": 2}


def test_starts_that_nothing_tells_are_told_by_the_diagnosis(one_record):
    diagnosis = one_record[2]
    (start,) = diagnosis.to_dict()["initial_states"]
    assert start["trajectory"] == "0"
    assert start["state"] == dict(diagnosis.extended_model_.initial_state)
    assert list(start["state"].values()) == pytest.approx([0.1, 0.0], abs=0.05)


def test_the_user_guides_last_line_goes_on_as_the_diagnosis_judged(one_record):
    """Its error on another record is not that of a fit with inputs held."""
    X, y, diagnosis = one_record
    model = diagnosis.extended_model_.replace(simulation={"hold": "foh", "substeps": 4})
    tuned = PhysicsModelRegressor(model, window_length="trajectory", search="local").fit(X, y)
    assert (tuned.hold_, tuned.substeps_) == ("foh", 4)
    test, truth = smooth_records(1, starts=[[0.1, 0.0]], n_samples=300, seed=1)
    test.loc[0, STATES] = [0.1, 0.0]
    told = clone(tuned).set_params(hold="zoh").fit(X, y)
    error = rms(tuned.predict(test) - truth)
    assert error < 3e-3
    assert error < 0.2 * rms(told.predict(test) - truth)


@pytest.mark.slow
def test_a_formula_without_a_name_is_handed_over_with_its_setting():
    cart = systems.cart_on_spring().replace(simulation={"hold": "foh", "substeps": 3})
    hidden = make_hidden_effect(
        cart, Formula("v", ("v*x**2",), (-24.0,)), random_state=1, n_records=5, sample_rate=100.0
    )
    diagnosis = ModelDiagnosis(hidden.prior, catalogue=[effects.CubicStiffness]).fit(
        hidden.X, hidden.y
    )
    assert diagnosis.discrepancy_.effect.terms == ("v*x**2",)
    assert dict(diagnosis.discrepancy_.model.simulation) == {"hold": "foh", "substeps": 3}


def test_a_free_run_that_runs_away_is_null_and_has_words():
    """An unstable machine that is held by its controller: windows can follow it, no free run."""
    fall = PhysicsModel(
        {"x": "m"}, {"x": "a*x**3 + u"}, {"a": {"value": 40.0, "fixed": True}}, {"u": "m/s"}
    )
    rng, t = np.random.default_rng(0), np.arange(2000) / 200
    x, u = [0.0], []
    for wish in np.repeat(rng.uniform(-0.6, 0.6, 100), 20):
        u.append(8.0 * (wish - x[-1]) - 40.0 * x[-1] ** 3)
        x.append(fall.simulate(t[:2], [u[-1], 0.0], [x[-1]], substeps=4).x[-1, 0])
    y = np.array(x[:-1]) + 5e-3 * rng.standard_normal(t.size)
    diagnosis = ModelDiagnosis(fall, catalogue=()).fit(np.c_[t, u], y)
    assert diagnosis.free_run_["x"].extended == np.inf
    assert json.loads(strict_json(diagnosis))["free_run"]["x"]["extended"] is None
    assert "diverges" in render_report(diagnosis)


def test_the_report_and_the_terminal_state_the_number(one_record, capsys):
    from sklearn_pgnn.cli.screen import print_diagnosis

    diagnosis = one_record[2]
    stated = f"{diagnosis.free_run_['position'].extended:.3g}"
    row = re.search(r"<td>free run</td>.*?</tr>", render_report(diagnosis), re.DOTALL)
    assert f">{stated} <b>" in row.group()
    print_diagnosis(diagnosis, Path("out"), quiet=False)
    said = capsys.readouterr().out
    assert "Error in free run, every record from its own start" in said
    assert stated in said.split("free run")[1]
