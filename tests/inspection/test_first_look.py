"""A first look at a model and records: what is there, and what looks wrong."""

import numpy as np
import pandas as pd
import pytest
from sledge import NOISE, SLEDGE, drive, rough_sledge

from sklearn_pgnn import systems
from sklearn_pgnn.inspection import first_look

pytestmark = pytest.mark.core


def test_a_model_that_fits_has_no_warning():
    X, y = drive(SLEDGE)
    look = first_look(SLEDGE, X, y)
    assert look.warnings == ()
    assert [record.samples for record in look.records] == [500] * 4
    assert [record.duration for record in look.records] == pytest.approx([9.98] * 4)
    assert min(record.fit["v"] for record in look.records) > 99
    (output,) = look.outputs
    assert output.fit > 99
    assert NOISE < output.error < 2 * NOISE
    assert output.noise == pytest.approx(NOISE, rel=0.2)
    assert repr(look) == "<FirstLook at 'model': fit v 100 %; warnings: 0>"


def test_ranges_and_what_is_missing_are_counted():
    X, y = drive(SLEDGE)
    y.loc[3:7, "v"] = np.nan
    force, speed = first_look(SLEDGE, X, y).quantities
    assert (force.role, force.unit, force.missing) == ("input", "N", 0)
    assert (force.low, force.high) == (X["F"].min(), X["F"].max())
    assert (speed.role, speed.missing) == ("output", 5)


@pytest.mark.parametrize(("name", "unit", "n_told"), [("in_flow", "l/s", 1), ("in_run_1", "", 0)])
def test_an_input_that_never_changes_is_told_unless_it_marks_a_group(name, unit, n_told):
    X, y = drive(SLEDGE)
    model = SLEDGE.replace(inputs={**SLEDGE.inputs, name: unit})
    warnings = first_look(model, X.assign(**{name: 0.0}), y).warnings
    assert sum(f"input {name!r} is 0" in said for said in warnings) == n_told


def test_a_gap_is_told_with_its_place():
    X, y = drive(SLEDGE, n_records=1)
    X.loc[300:, "t"] += 1.5
    (said,) = first_look(SLEDGE, X, y).warnings
    assert "record '0': no sample for 1.52 s from t = 5.98 s on, where others are 0.02 s" in said
    assert "Remedy: " in said


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        (lambda X, y: (X, 3.6 * y), 'columns: {v: "v [km/h]"}'),
        (lambda X, y: (X, -y), 'Remedy: if that is so, write outputs: {v: "-v"} in the model file'),
        (lambda X, y: (X.assign(t=1e3 * X["t"]), y), 'columns: {t: "t [ms]"}'),
        (lambda X, y: (X.assign(t=X["t"] / 60.0), y), 'columns: {t: "t [min]"}'),
    ],
)
def test_another_unit_or_sign_is_told_with_the_line_to_write(change, remedy):
    (said,) = first_look(SLEDGE, *change(*drive(SLEDGE))).warnings
    assert said.startswith("the model follows the records with ")
    assert remedy in said


@pytest.mark.parametrize("scale", [1e-3, 100, 1000])
def test_another_unit_is_recognised_though_the_model_misses_something(scale):
    _, X, y = rough_sledge()
    (said,) = first_look(SLEDGE, X, scale * y).warnings
    assert f"factor {scale:g} on v" in said


@pytest.mark.parametrize("system", [systems.cart_on_spring, systems.two_tanks])
def test_a_gain_that_is_no_unit_is_not_taken_for_one(system):
    model = system()
    t = np.arange(0, 60, 0.1)
    u = 3 + np.sin(0.5 * t) + 0.5 * np.sin(1.7 * t)
    run = model.simulate(t, u, substeps=4).y
    y = run.mean() + 1.4 * (run - run.mean())
    assert not any("follows" in text for text in first_look(model, np.c_[t, u], y).warnings)


def test_a_run_that_diverges_is_said_so():
    model = SLEDGE.replace(equations={"v": "F + 1e3*v**3"})
    X, y = drive(SLEDGE, n_records=1)
    said = " ".join(first_look(model, X, y).warnings)
    assert "became non-finite" in said


def test_the_record_that_the_model_does_not_follow_is_seen():
    X, y = drive(SLEDGE)
    y.loc[X["trajectory"] == X["trajectory"].iloc[-1], "v"] *= -1
    *good, bad = first_look(SLEDGE, X, y).records
    assert min(record.fit["v"] for record in good) > 99
    assert bad.fit["v"] < 0


def test_a_record_that_is_given_twice_is_told():
    X, y = drive(SLEDGE, n_records=2)
    again = X[X["trajectory"] == X["trajectory"].iloc[0]].assign(trajectory="again")
    twice = pd.concat([X, again], ignore_index=True)
    (said,) = first_look(SLEDGE, twice, pd.concat([y, y.loc[again.index]])).warnings
    assert said.startswith("record 'again' has the same values as")
    assert "Remedy: give every record once" in said


def test_a_file_is_said_to_be_in_a_unit_that_exists():
    X, y = drive(SLEDGE)
    model = SLEDGE.replace(states={"v": "mm/s"})
    assert 'columns: {v: "v [m/s]"}' in first_look(model, X, 1e-3 * y).warnings[0]


def test_a_run_that_diverges_tells_nothing_of_units():
    X, y = drive(SLEDGE)
    model = SLEDGE.replace(equations={"v": "F + 1.5*v"})
    (said,) = first_look(model, X, y).warnings
    assert "no better than their mean" in said
