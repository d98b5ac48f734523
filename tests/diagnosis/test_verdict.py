"""Laws of the verdict: what is missing, and what is left, by numbers anyone can check."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from sklearn_pgnn.cli.screen import COLOURS
from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.diagnosis.verdict import VERDICTS, Remaining, describe_remaining, verdict_of
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals
from sklearn_pgnn.inspection import words
from sklearn_pgnn.inspection.report import finding

pytestmark = pytest.mark.core

SHARE = 0.05


def described(left, white, structure=None, nothing=False, free_run=(0, 0), uncertain=(0, 0)):
    """Describe what is left of two outputs, given its squares and their white part."""
    counts, times = np.array(white, dtype=float), np.ones(2)
    windows, whole = (Residuals(np.array(s, dtype=float), counts, times) for s in (left, free_run))
    held_out = HeldOut(windows, whole, 0.0, np.ones((1, 1, 2)), uncertain=np.array(uncertain))
    fitter = SimpleNamespace(
        held_out=lambda trial: held_out,
        predicts_nothing=lambda trial, smallest_share: nothing,
        squares_by_output=lambda trial: np.array(left, dtype=float),
        white_squares=lambda trial: np.array(white, dtype=float),
        problem=SimpleNamespace(prior=SimpleNamespace(outputs={"x": "x", "y": "y"})),
    )
    return describe_remaining(fitter, None, structure, SelectionCriterion(0.01, SHARE, 50))


@pytest.mark.parametrize(("uncertain", "much"), [(0, True), (400, False)])
def test_a_free_run_far_from_the_records_is_not_adequate_unless_the_fit_is_as_uncertain(
    uncertain, much
):
    remaining = described((100, 100), (100, 100), free_run=(900, 100), uncertain=(uncertain, 0))
    assert remaining.kind == "noise"
    assert remaining.is_much == much
    verdict = verdict_of(search_result([]), remaining, has_formula=False)
    assert verdict == ("nothing_found" if much else "model_adequate")


@pytest.mark.parametrize(
    ("left", "white", "kind"),
    [
        ((100, 100), (100, 100), "noise"),
        ((100, 100), (104, 98), "noise"),
        ((100, 100), (100, 94), "disturbance"),
        ((900, 100), (100, 100), "disturbance"),
    ],
)
def test_what_is_left_is_noise_if_it_is_white_up_to_the_smallest_share(left, white, kind):
    for structure in (None, Structure()):
        assert described(left, white, structure).kind == kind


def test_what_depends_on_the_records_is_structure_however_white_it_is():
    remaining = described((100, 100), (100, 100), Structure("v", 0.9, 0.0, ("v", "F")))
    assert (remaining.kind, remaining.law.depends_on) == ("structure", ("v", "F"))


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_what_is_left_is_told_in_multiples_of_its_white_part_whatever_the_units(unit):
    remaining = described((unit * 900, 100), (unit * 100, 100))
    assert remaining.times_noise == pytest.approx({"x": 3.0, "y": 1.0})
    assert remaining.kind == "disturbance"


@pytest.mark.parametrize("structure", [None, Structure("v", 0.9)])
@pytest.mark.parametrize("left", [100, 900])
def test_what_predicts_nothing_is_told_however_little_is_left_in_short_windows(structure, left):
    assert described((left, 100), (100, 100), structure, nothing=True).predicts_nothing
    assert not described((left, 100), (100, 100), structure).predicts_nothing


def search_result(rivals, complete=True, outside=0.0):
    """Return what a search has named, given what may stand in the place of each cause."""
    steps = [object() for _ in rivals]
    return SimpleNamespace(
        steps=steps,
        rivals=dict(enumerate(rivals)),
        complete=complete,
        outside=dict.fromkeys(range(len(rivals)), outside),
    )


KINDS = ("noise", "disturbance", "structure")


@pytest.mark.parametrize(("kind", "has_formula"), [*itertools.product(KINDS, (False, True))])
def test_what_is_named_is_said_however_much_is_left(kind, has_formula):
    remaining = Remaining(kind, {})
    assert verdict_of(search_result([[]]), remaining, has_formula) == "cause_named"
    assert verdict_of(search_result([[], ["other"]]), remaining, has_formula) == "ambiguous"
    unnamed = search_result([[]], outside=0.6)
    assert verdict_of(unnamed, remaining, has_formula) == "ambiguous"


@pytest.mark.parametrize(
    ("kind", "has_formula", "verdict"),
    [
        ("noise", False, "model_adequate"),
        ("disturbance", False, "model_adequate"),
        ("structure", False, "unexplained"),
        ("noise", True, "unexplained"),
        ("structure", True, "unexplained"),
    ],
)
def test_where_nothing_is_named_only_structure_or_its_formula_is_unexplained(
    kind, has_formula, verdict
):
    assert verdict_of(search_result([]), Remaining(kind, {}), has_formula) == verdict


@pytest.mark.parametrize(("kind", "complete"), [*itertools.product(KINDS, (False, True))])
def test_no_model_is_adequate_that_predicts_nothing(kind, complete):
    remaining = Remaining(kind, {}, predicts_nothing=True)
    assert verdict_of(search_result([], complete), remaining, False) == "predicts_nothing"


@pytest.mark.parametrize("times", [2.1, np.inf, np.nan])
def test_no_model_is_adequate_that_leaves_more_than_twice_the_noise(times):
    left = Remaining("disturbance", {"x": 1.0, "y": times})
    assert verdict_of(search_result([]), left, False) == "nothing_found"


@pytest.mark.parametrize("rivals", [[[]], [[], ["other"]]])
@pytest.mark.parametrize("kind", KINDS)
def test_what_an_unfinished_search_holds_is_provisional(kind, rivals):
    assert verdict_of(search_result(rivals, complete=False), Remaining(kind, {}), False) == (
        "provisional"
    )


@pytest.mark.parametrize(
    ("kind", "verdict"), [("noise", "model_adequate"), ("disturbance", "provisional")]
)
def test_a_search_that_was_ended_calls_no_model_adequate_that_leaves_more_than_noise(kind, verdict):
    assert verdict_of(search_result([], complete=False), Remaining(kind, {}), False) == verdict


def test_every_verdict_has_words_of_its_own():
    for said in (finding._FOUND, words._SAID, COLOURS):
        assert set(said) == set(VERDICTS)
    assert len(set(VERDICTS.values())) == len(VERDICTS)
