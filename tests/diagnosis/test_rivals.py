"""Laws of rivals: what is not refuted and as simple, what resembles a cause or is the same."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn import effects
from sklearn_pgnn.diagnosis import rivals
from sklearn_pgnn.diagnosis.rivals import find_rivals
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.hypothesis import Hypothesis

CAUSE = effects.ConstantLoad("v")
LIKE = effects.CoulombFriction("v")  # as many parameters
DRAG = effects.QuadraticDrag("v")
DEARER = effects.StribeckFriction("v")
SAME = effects.InputBias("F")
CRITERION = SelectionCriterion(alpha=0.01, smallest_share=0.05, n_candidates=20)


def trial_of(*causes):
    hypothesis = Hypothesis()
    for cause in causes:
        hypothesis = hypothesis.plus(cause)
    return SimpleNamespace(hypothesis=hypothesis, fit=SimpleNamespace(model=None))


def rivals_of(evidence, resembling=(), beside=(), equal=(), falls=(), worse=()):
    """Return the rivals of a cause, given the evidence for it over each other."""
    trials = {other: trial_of(*beside, other) for other in evidence}
    over = {id(trial): evidence[other] for other, trial in trials.items()}
    compare = SimpleNamespace(
        evidence=lambda trial, final: over[id(trial)],
        refutes=lambda final, trial: over[id(trial)] > CRITERION.to_refute,
        stands_in_free_run=lambda trial: trial.hypothesis.causes[-1] not in falls,
        runs_worse=lambda final, trial: trial.hypothesis.causes[-1] in worse,
    )
    ladder = SimpleNamespace(
        in_place=lambda final, cause: list(trials.values()),
        fitter=SimpleNamespace(problem=None),
        candidates=(CAUSE, LIKE, DRAG, DEARER),
        same={CAUSE: (SAME,), LIKE: (SAME,), DRAG: (), DEARER: ()},
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rivals, "resemble", lambda problem, model, cause, other: other in resembling)
        patch.setattr(rivals, "_is_same", lambda fitter, rest, cause, other: other in equal)
        return find_rivals(compare, ladder, trial_of(*beside, CAUSE), CAUSE)


@pytest.mark.slow
@given(st.floats(-100, 100))
def test_a_rival_is_what_the_cause_does_not_refute(evidence):
    found = rivals_of({LIKE: evidence})
    assert bool(found) is (evidence <= CRITERION.to_refute)
    assert all(value == evidence for _, value in found)


def test_what_takes_more_parameters_is_no_rival_however_near():
    assert rivals_of({DEARER: 0.0}) == []


@pytest.mark.parametrize("than", ["falls", "worse"])
def test_what_the_free_run_speaks_against_is_no_rival_however_near_over_windows(than):
    assert rivals_of({LIKE: -300.0, DRAG: 1.0}, **{than: (LIKE,)}) == [(DRAG, 1.0)]


def test_what_is_the_same_as_a_rival_is_one_too_with_the_same_evidence():
    assert rivals_of({LIKE: 1.0}) == [(LIKE, 1.0), (SAME, 1.0)]


@given(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
def test_rivals_are_ordered_by_the_evidence_against_them(one, other):
    found = [value for _, value in rivals_of({LIKE: one, DRAG: other})]
    assert found == sorted([one, one, other])


def test_what_is_too_small_to_be_told_from_another_resembles_it():
    assert rivals_of({}, resembling=(LIKE,)) == [(LIKE, 0.0), (SAME, 0.0)]
    assert rivals_of({LIKE: -3.0}, resembling=(LIKE,))[0] == (LIKE, -3.0)  # it was fitted
    assert rivals_of({}, resembling=(LIKE,), beside=(LIKE,)) == []  # it is a cause already


def test_what_is_the_same_beside_the_others_is_a_rival_that_no_evidence_is_against():
    assert rivals_of({}, equal=(DRAG,)) == [(DRAG, 0.0)]
    assert rivals_of({DRAG: 2.0}, equal=(DRAG,)) == [(DRAG, 2.0)]
