"""The colours of a report: green only where nothing is to be looked at."""

import math
from copy import copy
from dataclasses import replace

import pytest
from situations import situation

from sklearn_pgnn.diagnosis import Remaining, Rival, Structure
from sklearn_pgnn.inspection.numbers import times
from sklearn_pgnn.inspection.report.finding import next_step, title
from sklearn_pgnn.inspection.report.parameters import parameter_facts
from sklearn_pgnn.inspection.report.tiles import make_tiles
from sklearn_pgnn.inspection.yardstick import over_windows
from sklearn_pgnn.record_quality.finding import Finding

pytestmark = pytest.mark.core


def changed(name, **attributes):
    """Return a copy of a situation's diagnosis with other attributes."""
    diagnosis = copy(situation(name))
    vars(diagnosis).update(attributes)
    return diagnosis


def gain_of(name, **in_noise):
    """Return the gain of a situation with other errors, in units of the noise."""
    gain = situation(name).gain_["v"]
    return {"v": replace(gain, **{which: x * gain.noise for which, x in in_noise.items()})}


def states(diagnosis):
    return [tile.state for tile in make_tiles(diagnosis)]


@pytest.mark.parametrize("name", ["adequate", "retuned", "named"])
def test_what_is_in_order_is_green(name):
    assert states(situation(name)) == ["good"] * 2


def test_a_cause_that_records_cannot_tell_is_amber_with_its_rivals():
    assert states(situation("ambiguous")) == ["good", "look"]
    said = make_tiles(situation("ambiguous"))[1].text
    assert "constant load on v" in said
    assert "input bias of F" in said


def test_what_only_a_formula_describes_is_amber_and_parameters_are_those_beside_it():
    diagnosis = situation("unexplained")
    left, sure = make_tiles(diagnosis)
    assert (left.state, sure.state, sure.headline) == ("good", "look", "a formula, no cause")
    assert parameter_facts(diagnosis).at_limit == ()


def test_what_neither_name_nor_formula_describes_is_red():
    gain = gain_of("unexplained", formula=math.nan)
    assert states(changed("unexplained", discrepancy_=None, gain_=gain))[:2] == ["bad", "bad"]


@pytest.mark.parametrize("in_free_run", [{}, {"v": 9.0}])
def test_the_title_of_no_cause_says_the_most_that_is_left(in_free_run):
    left = Remaining("disturbance", {"v": 3.0}, in_free_run=in_free_run)
    found = changed("adequate", verdict_="nothing_found", remaining_=left)
    windows = [errors.extended for errors in over_windows(found).values()]
    most = times(max([*windows, *in_free_run.values()]))
    assert title(found).endswith(f"{most} the noise is left")


def test_a_parameter_at_its_limit_is_amber():
    diagnosis = situation("adequate")
    (free,) = (f for f in diagnosis.records_.fits["extended"].freedoms if f.name == "m")
    found = replace(diagnosis.parameters_["m"], value=free.high)
    pinned = changed("adequate", parameters_={**diagnosis.parameters_, "m": found})
    assert parameter_facts(pinned).at_limit == ("m",)
    assert make_tiles(pinned)[2].text == "m at a limit"
    assert states(pinned)[2] == "look"


def test_faults_of_the_records_are_amber_and_come_first_in_what_to_do_next():
    assert states(situation("bad"))[2] == "look"
    assert "Expect threshold 0.5" in next_step(situation("named"))
    fault = Finding("clipping", "v", "v is cut", 3.0, "drive it less")
    said = next_step(changed("named", data_quality_=(fault,)))
    assert said.startswith("Improve the records first (clipping of v): drive it less")


def test_more_than_twice_the_noise_is_amber_and_red_where_it_is_structure():
    much = {"gain_": gain_of("named", extended=2.5)}
    assert states(changed("named", **much))[0] == "look"
    law = Structure("v", 0.9, 0.0, ("F",))
    left = Remaining("structure", {"v": 2.5}, law)
    assert states(changed("named", **much, remaining_=left))[0] == "bad"


RIVAL = {"probability": 0.7, "confused_with": (Rival("input_bias", "F", 0.3),)}
UNTESTED = {"probability": math.nan, "tested": False}


@pytest.mark.parametrize(("doubt", "headline"), [(RIVAL, "70 %"), (UNTESTED, "provisional")])
def test_one_doubtful_cause_is_enough(doubt, headline):
    (cause,) = (replace(cause, **doubt) for cause in situation("named").causes_)
    found = changed("named", causes_=(cause,), tested_=cause.tested, complete_=cause.tested)
    assert (states(found)[1], make_tiles(found)[1].headline) == ("look", headline)
