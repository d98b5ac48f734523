"""The colours of a report: green only where nothing is to be looked at."""

import math
from copy import copy
from dataclasses import replace

import pytest
from situations import situation

from sklearn_pgnn.diagnosis import Remaining, Rival, Structure
from sklearn_pgnn.inspection.numbers import times
from sklearn_pgnn.inspection.report.parameters import parameter_facts
from sklearn_pgnn.inspection.report.tiles import make_tiles
from sklearn_pgnn.record_quality.finding import Finding

pytestmark = pytest.mark.core


def states(diagnosis):
    return [tile.state for tile in make_tiles(diagnosis)]


@pytest.mark.parametrize("name", ["adequate", "retuned", "named"])
def test_what_is_in_order_is_green(name):
    assert states(situation(name)) == ["good"] * 4


def test_a_cause_that_records_cannot_tell_is_amber_with_its_rivals():
    left, sure, records, parameters = make_tiles(situation("ambiguous"))
    assert [t.state for t in (left, sure, records, parameters)] == ["good", "look", "good", "good"]
    assert "constant load on v" in sure.text
    assert "input bias of F" in sure.text


def test_what_only_a_formula_describes_is_amber_and_parameters_are_those_beside_it():
    diagnosis = situation("unexplained")
    left, sure = make_tiles(diagnosis)[:2]
    assert (left.state, sure.state, sure.headline) == ("good", "look", "a formula, no cause")
    assert left.headline == f"{times(diagnosis.discrepancy_.error)} noise"
    assert parameter_facts(diagnosis).at_limit == ()


def test_what_neither_name_nor_formula_describes_is_red():
    diagnosis = copy(situation("unexplained"))
    diagnosis.discrepancy_ = None
    diagnosis.gain_ = {"v": replace(diagnosis.gain_["v"], formula=math.nan)}
    assert states(diagnosis)[:2] == ["bad", "bad"]


def test_a_parameter_at_its_limit_is_amber():
    diagnosis = copy(situation("adequate"))
    (free,) = (f for f in diagnosis.records_.fits["extended"].freedoms if f.name == "m")
    found = replace(diagnosis.parameters_["m"], value=free.high)
    diagnosis.parameters_ = {**diagnosis.parameters_, "m": found}
    assert parameter_facts(diagnosis).at_limit == ("m",)
    assert states(diagnosis)[3] == "look"


def test_faults_of_the_records_are_amber():
    diagnosis = situation("bad")
    assert diagnosis.data_quality_
    assert states(diagnosis)[2] == "look"


def test_parameters_that_moved_only_together_do_not_contradict_what_that_is_worth():
    for name in ("adequate", "ambiguous"):
        assert make_tiles(situation(name))[3].headline == "as given"
    changed = copy(situation("adequate"))
    gain = changed.gain_["v"]
    changed.gain_ = {"v": replace(gain, prior=20.0 * gain.noise, refitted=2.0 * gain.noise)}
    moved = make_tiles(changed)[3]
    assert moved.headline == "changed jointly"
    assert moved.text.startswith("20.0 × → 2.00 × noise; yet the interval of each")


def test_more_than_twice_the_noise_is_amber_and_red_where_it_is_structure():
    changed = copy(situation("named"))
    gain = changed.gain_["v"]
    changed.gain_ = {"v": replace(gain, extended=2.5 * gain.noise)}
    assert states(changed)[0] == "look"
    changed.remaining_ = Remaining("structure", {"v": 2.5}, Structure("v", 0.9, 0.0, ("F",)))
    assert states(changed)[0] == "bad"


def test_one_doubtful_cause_is_enough():
    changed = copy(situation("named"))
    rival = (Rival("input_bias", "F", 0.3),)
    changed.causes_ = (replace(changed.causes_[0], probability=0.7, confused_with=rival),)
    sure = make_tiles(changed)[1]
    assert (sure.state, sure.headline) == ("look", "70 %")


def test_of_a_provisional_cause_nothing_is_sure():
    changed = copy(situation("named"))
    changed.causes_ = (replace(changed.causes_[0], probability=math.nan, tested=False),)
    changed.tested_ = changed.complete_ = False
    sure = make_tiles(changed)[1]
    assert (sure.state, sure.headline) == ("look", "not tested")


def test_a_fault_of_records_comes_first_in_what_to_do_next():
    from sklearn_pgnn.inspection.report.finding import next_step

    changed = copy(situation("named"))
    assert "Expect threshold 0.5" in next_step(changed)
    changed.data_quality_ = (Finding("clipping", "v", "v is cut", 3.0, "drive it less"),)
    assert next_step(changed).startswith("Improve the records first (clipping of v): drive it less")
