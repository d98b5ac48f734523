"""Records of one machine that differ: hidden, and required to be found; nothing where none do."""

import re
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
from schemas import faults

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.diagnosis import result
from sklearn_pgnn.estimation.progress import Progress, TimeIsUp
from sklearn_pgnn.estimation.record_groups import Group, mark
from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.inspection import simulated_records
from sklearn_pgnn.physics.effects.differences import ParameterDifference, mark_at, where_of
from sklearn_pgnn.trajectories import read_records

CART = PhysicsModel(
    name="cart",
    states={"x": "m", "v": "m/s"},
    inputs={"F": "N"},
    outputs={"x_m": "x"},
    parameters={
        "m": {"value": 2.1, "unit": "kg", "bounds": [0.5, 10], "spread": 0.2},
        "d": {"value": 1.4, "unit": "N s/m", "bounds": [0, 20], "spread": 0.5},
        "k": {"value": 52.0, "unit": "N/m", "bounds": [5, 200], "spread": 0.2},
    },
    equations={"x": "v", "v": "(F - d*v - k*x)/m"},
    inertia={"v": "m"},
)
NOISE = 2e-4
CANDIDATES = (
    effects.CoulombFriction,
    effects.ViscousFriction,
    effects.CubicStiffness,
    effects.InputGain,
    effects.SensorBias,
    effects.WrongParameter,
)


def records(seed, change, others, n_records=6, rig=CART):
    """Return records of the machine with other parameters, or another zero, in some of them.

    The change may be a function of the number of the record.
    """
    of = change if callable(change) else lambda _: change
    random, tables, measured = np.random.default_rng(seed), [], []
    t = np.arange(0, 8, 0.02)
    for r in range(n_records):
        waves = random.uniform(0.3, 2.5, 3), random.uniform(0, 2 * np.pi, 3)
        F = 4 * np.sin(2 * np.pi * np.outer(t, waves[0]) + waves[1]).sum(axis=1)
        values = {"m": 2.0, "d": 1.6, "k": 50.0} | (of(r) if r in others else {})
        zero = values.pop("zero", 0.0)
        run = rig.with_parameters(**values).simulate(t, F, substeps=4)
        tables.append(pd.DataFrame({"trajectory": f"run_{r}", "t": t, "F": F}))
        measured.append(run.y[:, 0] + zero + NOISE * random.normal(size=t.size))
    return pd.concat(tables, ignore_index=True), np.concatenate(measured)


def with_onset(seed, change, since, until=None, record=1, n_records=3):
    """Return records of which one is of a machine that changes at some time, or from then on."""
    X, y = records(seed, {}, (), n_records)
    rows = np.flatnonzero(X["trajectory"] == f"run_{record}")
    t, F = X["t"].to_numpy()[rows], X["F"].to_numpy()[rows]
    usual, ((name, value),) = CART.with_parameters(m=2.0, d=1.6, k=50.0), change.items()
    other = ParameterDifference(f"{name}(in_run)", value - usual.parameters[name].value)
    rig = usual.replace(inputs={**CART.inputs, "in_run": ""}) + other
    run = rig.simulate(t, np.column_stack([F, mark_at(t, since, until)]), substeps=4)
    y[rows] = run.y[:, 0] + NOISE * np.random.default_rng(seed).normal(size=t.size)
    return X, y


def named(diagnosis):
    return [(cause.effect, cause.target) for cause in diagnosis.causes_]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "others", "n_records", "cause"),
    [
        ({"m": 2.5}, (1, 4), 6, ("parameter_difference", "m(in_run_1__run_4)")),
        ({"k": 43.0}, (3,), 8, ("parameter_difference", "k(in_run_3)")),
        ({"d": 2.6}, (0, 2, 5), 6, ("parameter_difference", "d(in_run_0__run_2__run_5)")),
    ],
)
def test_what_differs_is_named_with_its_records(change, others, n_records, cause):
    X, y = records(11, change, others, n_records)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    assert named(diagnosis) == [cause]
    assert diagnosis.verdict_ == "cause_named"
    assert diagnosis.remaining_.kind == "noise"
    (column,) = diagnosis.groups_
    assert diagnosis.to_dict()["groups"] == {column: list(diagnosis.groups_[column])}
    (estimate,) = diagnosis.causes_[0].parameters.values()
    name, value = next(iter(change.items()))
    usual = {"m": 2.0, "d": 1.6, "k": 50.0}[name]
    expected = value - usual
    assert estimate.low <= expected <= estimate.high


@pytest.mark.slow
def test_an_onset_within_windows_as_long_as_the_records_is_found():
    X, y = with_onset(31, {"d": 2.4}, 3.3, n_records=6)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES, window_length=8.0).fit(X, y)
    ((effect, target),) = named(diagnosis)
    assert effect == "parameter_difference"
    assert target.startswith("d(in_run_1__since_")
    assert diagnosis.causes_[0].onset.value == pytest.approx(3.3, abs=0.03 * 8.0)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "step"), [("d", 0.25), ("k", -1.5), ("zero", 0.001)])
def test_what_changes_from_record_to_record_is_a_trend(name, step):
    usual = {"d": 1.6, "k": 50.0, "zero": 0.0}[name]
    X, y = records(5, lambda r: {name: usual + step * r}, range(6))
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    target = f"{'x_m' if name == 'zero' else name}(in_sequence)"
    assert named(diagnosis) == [
        ("sensor_bias_difference" if name == "zero" else "parameter_difference", target)
    ]
    assert diagnosis.remaining_.kind == "noise"
    assert diagnosis.groups_ == {"in_sequence": tuple(f"run_{r}" for r in range(6))}
    (estimate,) = diagnosis.causes_[0].parameters.values()
    assert estimate.low <= 5 * step <= estimate.high
    with pytest.warns(RecordWarning, match="from 0 in run_0 to 1 in run_5, got none: .* the last"):
        last = diagnosis.predict(X[X["trajectory"] == "run_5"])
    assert np.std(last.ravel() - y[X["trajectory"] == "run_5"]) < 3.0 * NOISE


@pytest.mark.slow
def test_another_zero_of_a_sensor_is_found():
    X, y = records(11, {"zero": 0.004}, (2, 3))
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    assert named(diagnosis) == [("sensor_bias_difference", "x_m(in_run_2__run_3)")]
    assert diagnosis.causes_[0].parameters["bias"].value == pytest.approx(0.004, rel=0.1)
    marked = simulated_records(diagnosis).groupby("trajectory")["in_run_2__run_3"].mean()
    assert marked[marked > 0.0].to_dict() == {"run_2": 1.0, "run_3": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize(("change", "since"), [({"k": 44.0}, 5.1), ({"d": 2.4}, 3.3)])
def test_what_changes_within_a_record_is_named_with_its_onset(change, since):
    X, y = with_onset(31, change, since)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    ((effect, target),) = named(diagnosis)
    ((name, value),) = change.items()
    what, column = target.rstrip(")").split("(")
    assert (effect, what) == ("parameter_difference", name)
    onset = diagnosis.causes_[0].onset
    assert column.endswith(f"__since_{onset.value:g}".replace(".", "p"))
    assert onset.value == pytest.approx(since, abs=0.03 * 8.0)
    assert onset.low <= since <= onset.high < onset.low + 0.1 * 8.0
    data = {**diagnosis.to_dict(), "version": ""}
    assert data["causes"][0]["onset"]["high"] == onset.high
    assert faults("diagnosis", data) == []
    ends = f"(onset between {onset.low:.5g} and {onset.high:.5g} s)."
    assert diagnosis.causes_[0].summary.endswith(f"in run_1 since {onset.value:g} s {ends}")
    usual = {"d": 1.6, "k": 50.0}[name]
    estimate = diagnosis.causes_[0].parameters["difference"]
    assert estimate.value == pytest.approx(value - usual, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("change", "since"), [({"k": 44.0}, 2.5), ({"d": 3.0}, 1.4)])
def test_what_grows_within_a_record_is_named_with_its_onset(change, since):
    X, y = with_onset(31, change, since, until=7.98)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    ((effect, target),) = named(diagnosis)
    ((name, value),) = change.items()
    onset = diagnosis.causes_[0].onset
    assert effect == "parameter_difference"
    assert target.startswith(f"{name}(in_run_1__since_")
    assert target.endswith("__to_7p98)")
    assert onset.low <= since <= onset.high < onset.low + 0.2 * 8.0
    said = rf"{name} goes from .* to .* in run_1 between .* and 7\.98 s \(onset between .* s\)\."
    assert re.fullmatch(said, diagnosis.causes_[0].summary)
    estimate = diagnosis.causes_[0].parameters["difference"]
    assert estimate.value == pytest.approx(value - {"d": 1.6, "k": 50.0}[name], rel=0.1)


@pytest.mark.slow
def test_a_mass_may_depend_on_what_holds_all_through_a_record():
    load = np.array([0.0, 3.0, 1.0, 2.0, 0.5])
    X, y = records(8, lambda r: {"m": 2.0 + 0.1 * load[r]}, range(5), n_records=5)
    X["load"] = np.repeat(load, len(X) // 5)
    model = CART.replace(inputs={**CART.inputs, "load": "kg"})
    catalogue = (*CANDIDATES, effects.ParameterSlope)
    diagnosis = ModelDiagnosis(model, catalogue=catalogue).fit(X, y)
    assert named(diagnosis) == [("parameter_slope", "m(load)")]
    slope = diagnosis.causes_[0].parameters["slope"]
    assert slope.low <= 0.05 <= slope.high


@pytest.mark.slow
def test_records_whose_sensor_is_as_given_are_not_said_to_differ():
    X, y = records(11, {"zero": 0.004}, (1, 3, 4))
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    column = "in_run_1__run_3__run_4"
    assert named(diagnosis) == [("sensor_bias_difference", f"x_m({column})")]


@pytest.mark.slow
def test_the_detectable_difference_is_found_and_half_of_it_is_not():
    X, y = records(3, {}, ())
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    (row,) = diagnosis.detectability(["parameter_difference"], ["d"]).rows
    assert (row.target, row.parameter, row.unit) == ("d(in_run_5)", "difference", "N s/m")
    truth = diagnosis.extended_model_.parameters["d"].value
    for size, is_found in ((2.0, True), (0.5, False)):
        other = {"d": truth + size * row.smallest}
        usual = {n: diagnosis.extended_model_.parameters[n].value for n in ("m", "d", "k")}
        again = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(
            *records(4, lambda r, o=other, u=usual: {**u, **(o if r == 5 else {})}, range(6))
        )
        expected = [("parameter_difference", "d(in_run_5)")] if is_found else []
        assert named(again) == expected


def test_an_onset_has_no_interval_where_time_is_up(monkeypatch):
    monkeypatch.setattr(result, "onset_interval", Mock(side_effect=TimeIsUp))
    fitter, fit = SimpleNamespace(progress=Progress()), SimpleNamespace(usable=True)
    late = ParameterDifference("k(in_run_1__since_5p1)")
    onset = result._onset(fitter, SimpleNamespace(fit=fit), late)
    assert (onset.value, onset.low, onset.high) == (5.1, -np.inf, np.inf)


@pytest.mark.parametrize(("since", "said"), [(97080.0, "97080"), (3.5561, "3.556"), (0.25, "0.25")])
def test_an_onset_is_told_in_seconds(since, said):
    X, y = records(3, {}, (), n_records=1)
    group = Group((0,), since, None, ParameterDifference, "k", 0.5)
    marked = mark(CART, read_records(CART, X, y), group)
    assert where_of(marked.column) == f"since {said} s"
    assert marked.records[0].u[:, -1].sum() == (X["t"] >= since).sum()


def test_a_trend_rises_in_equal_steps_from_the_first_record_to_the_last():
    X, y = records(3, {}, (), n_records=3)
    group = Group((0, 1, 2), None, None, ParameterDifference, "k", 0.5)
    marked = mark(CART, read_records(CART, X, y), group)
    assert [set(record.u[:, -1]) for record in marked.records] == [{0.0}, {0.5}, {1.0}]
    assert ParameterDifference.title("k(in_sequence)") == "k that changes from record to record"
    other = ParameterDifference("k(in_sequence)", difference=4.0)
    said = other.summarise(marked.model.with_parameters(k=50.0) + other)
    assert said == "k goes from 50 N/m in the first record to 54 N/m in the last."


@pytest.mark.slow
def test_a_difference_is_found_beside_an_effect_that_is_missing():
    rig = CART + effects.CoulombFriction("v", level=0.6)
    X, y = records(12, {"m": 2.4}, (2, 3), rig=rig)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    assert set(named(diagnosis)) == {
        ("coulomb_friction", "v"),
        ("parameter_difference", "m(in_run_2__run_3)"),
    }


@pytest.mark.slow
@pytest.mark.parametrize("seed", [21, 22, 23])
def test_where_nothing_differs_no_difference_is_named(seed):
    X, y = records(seed, {}, ())
    alike = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    assert (named(alike), alike.groups_, alike.verdict_) == ([], {}, "model_adequate")
    X, y = records(seed, {}, (), rig=CART + effects.CoulombFriction("v", level=0.6))
    lacking = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    assert (named(lacking), lacking.groups_) == ([("coulomb_friction", "v")], {})


@pytest.mark.slow
def test_a_prediction_asks_for_the_group():
    X, y = records(13, {"m": 2.6}, (1, 4))
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES).fit(X, y)
    (column,) = diagnosis.groups_
    new, measured = records(14, {"m": 2.6}, (0,), n_records=2)
    known = diagnosis.predict(new.assign(**{column: (new["trajectory"] == "run_0").astype(float)}))
    assert np.sqrt(np.mean((known - measured) ** 2)) < 3 * NOISE
    with pytest.warns(RecordWarning, match=f"expected the column '{column}'.*Remedy: add the col"):
        assumed = diagnosis.predict(new)
    error = (assumed - measured).reshape(2, -1)
    assert np.sqrt(np.mean(error[1] ** 2)) < 3 * NOISE < np.sqrt(np.mean(error[0] ** 2))
