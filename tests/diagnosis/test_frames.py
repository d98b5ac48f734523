"""The findings of a diagnosis as tables: what a program reads is what the diagnosis holds."""

import math
from types import SimpleNamespace

import pytest
from rubbing_sledge import fresh_fitter
from sledge import SLEDGE, rough_sledge

from sklearn_pgnn.diagnosis import NamedCause, Rival
from sklearn_pgnn.diagnosis.frames import causes_frame
from sklearn_pgnn.diagnosis.result import retuned_parameters
from sklearn_pgnn.simulation.uncertainty import Estimate

pytestmark = pytest.mark.core


@pytest.mark.slow
def test_the_causes_have_a_row_a_parameter():
    diagnosis, _, _ = rough_sledge()
    (row,) = diagnosis.causes_frame().to_dict("records")
    (cause,) = diagnosis.causes_
    level = cause.parameters["level"]
    assert (row["cause"], row["effect"], row["target"]) == (1, "coulomb_friction", "v")
    assert (row["parameter"], row["unit"]) == ("level", level.unit)
    assert [row[name] for name in ("value", "low", "high")] == [level.value, level.low, level.high]
    assert (row["gain_percent"], row["probability"]) == (cause.gain, cause.probability)


def test_a_cause_without_parameters_and_one_with_rivals_have_rows_too():
    cause = NamedCause("sensor_rectification", "v", {}, 50.0, (Rival("input_bias", "F", 0.3),))
    (row,) = causes_frame(SimpleNamespace(causes_=(cause,))).to_dict("records")
    assert row["parameter"] == ""
    assert math.isnan(row["value"])
    assert row["confused_with"] == "input_bias of F"
    assert causes_frame(SimpleNamespace(causes_=())).empty


@pytest.mark.slow
def test_the_parameters_say_what_changed():
    diagnosis, _, _ = rough_sledge()
    table = diagnosis.parameters_frame()
    assert list(table.index) == list(diagnosis.parameters_) == ["m", "d"]
    for name, p in diagnosis.parameters_.items():
        row = table.loc[name]
        assert row["change_percent"] == pytest.approx(100 * (p.value - p.prior) / p.prior)
        assert row["changed"] == (not row["low"] <= row["prior"] <= row["high"])


def test_the_gain_has_windows_and_free_run():
    diagnosis, _, _ = rough_sledge()
    row = diagnosis.gain_frame().loc["v"]
    assert row["prior"] == diagnosis.gain_["v"].prior
    assert row["free_run_extended"] == diagnosis.free_run_["v"].extended
    assert row["extended"] < row["refitted"] < row["prior"]


def test_a_cause_prints_itself_in_a_line():
    parameters = {"bias": Estimate(0.30081, 0.29, 0.31, "N")}
    rivals = (Rival("constant_load", "v", 0.5),)
    cause = NamedCause("input_bias", "F", parameters, 90.0, rivals, probability=0.5)
    said = "<NamedCause input_bias on F: bias 0.3008 N, probability 0.5, confused with 1>"
    assert repr(cause) == said


def test_a_parameter_that_was_held_may_be_anywhere_in_its_bounds():
    """A cause stands in its place: the records say nothing of it, and it has not changed."""
    fitter = fresh_fitter()
    fit = fitter.base().fit
    table = retuned_parameters(fitter.problem, fit, {"m": 0.1})
    value, bounds = fit.model.parameters["m"].value, SLEDGE.parameters["d"].bounds
    assert table["m"].low < value < table["m"].high
    assert (table["d"].low, table["d"].high, table["d"].changed) == (*bounds, False)
