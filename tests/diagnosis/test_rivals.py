"""Laws of rivals: what is not refuted and as simple, what resembles a cause or is the same."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sledge import SLEDGE

from sklearn_pgnn import effects
from sklearn_pgnn.diagnosis import rivals
from sklearn_pgnn.diagnosis.rivals import find_rivals, likelier, not_refuted
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.physics.effects.wiring import ReversedTerm

CAUSE = effects.ConstantLoad("v")
LIKE = effects.CoulombFriction("v")  # as many parameters
DRAG = effects.QuadraticDrag("v")
DEARER = effects.StribeckFriction("v")
SAME = effects.InputBias("F")
FITTER = SimpleNamespace(problem=SimpleNamespace(prior=SLEDGE))
CRITERION = SelectionCriterion(alpha=0.01, smallest_share=0.05, n_candidates=20)


def trial_of(*causes):
    hypothesis = Hypothesis()
    for cause in causes:
        hypothesis = hypothesis.plus(cause)
    return SimpleNamespace(hypothesis=hypothesis, fit=SimpleNamespace(model=None, objective=1.0))


def rivals_of(evidence, resembling=(), beside=(), equal=(), falls=(), worse=(), cause=CAUSE):
    """Return the rivals of a cause and what is likelier, given how surely the cause is."""
    trials = {other: trial_of(*beside, other) for other in evidence}
    over = {id(trial): evidence[other] for other, trial in trials.items()}
    compare = SimpleNamespace(
        separation=lambda trial, final: over[id(trial)],
        refutes=lambda final, trial: over[id(trial)] > CRITERION.to_refute,
        stands_in_free_run=lambda trial: trial.hypothesis.causes[-1] not in falls,
        runs_surely_worse=lambda final, trial: trial.hypothesis.causes[-1] in worse,
        only_begins=lambda final, trial: False,
    )
    ladder = SimpleNamespace(
        in_place=lambda final, cause: list(trials.values()),
        fitter=FITTER,
        candidates=(CAUSE, LIKE, DRAG, DEARER),
        same={**dict.fromkeys(evidence, ()), CAUSE: (SAME,), LIKE: (SAME,), DRAG: (), DEARER: ()},
    )
    final = trial_of(*beside, cause)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rivals, "resemble", lambda problem, model, cause, other: other in resembling)
        patch.setattr(rivals, "_is_same", lambda fitter, rest, cause, other: other in equal)
        near = not_refuted(compare, ladder, final, cause)
        first = [trial.hypothesis.causes[-1] for trial in likelier(FITTER, final, near)]
        return find_rivals(ladder, final, cause, near), first


@given(st.floats(-100, 100))
def test_what_is_not_refuted_is_a_rival_or_likelier_than_the_cause(evidence):
    found, first = rivals_of({LIKE: evidence})
    assert bool(found) is (evidence <= CRITERION.to_refute)
    assert bool(first) is (evidence < 0.0)
    assert all(value == max(evidence, 0.0) for _, value in found)


def test_the_likeliest_is_tried_first():
    assert rivals_of({LIKE: -1.0, DRAG: -7.0, DEARER: -90.0})[1] == [DRAG, LIKE]


@pytest.mark.parametrize(("objective", "first"), [(99.0, [LIKE]), (99.99, []), (101.0, [])])
def test_of_two_that_nothing_separates_the_one_that_fits_all_records_better_is_first(
    objective, first
):
    final, trial = trial_of(CAUSE), trial_of(LIKE)
    final.fit.objective, trial.fit.objective = 100.0, objective
    assert [t.hypothesis.causes[-1] for t in likelier(FITTER, final, [(trial, 0.0)])] == first
    assert likelier(FITTER, final, [(trial, 1e-3)]) == []


@pytest.mark.parametrize(
    "stand_in",
    [effects.SensorBias("v"), effects.SensorRectification("v"), effects.ParameterDrift("d")],
)
def test_an_effect_of_the_plant_comes_before_one_of_a_sensor_that_does_as_well(stand_in):
    plant, sensor = trial_of(CAUSE), trial_of(stand_in)
    plant.fit.objective = 103.0
    sensor.fit.objective = 100.0  # it fits a little better, as what is bent to the records does
    assert likelier(FITTER, sensor, [(plant, 0.0)]) == [plant]
    assert likelier(FITTER, plant, [(sensor, 0.0)]) == []
    assert likelier(FITTER, sensor, [(plant, 1e-3)]) == []  # where records tell, they decide
    assert likelier(FITTER, plant, [(sensor, -1e-3)]) == [sensor]


@pytest.mark.parametrize(("name", "is_said"), [("d", False), ("m", True)])
def test_the_sign_of_a_term_and_that_of_its_parameter_are_no_rivals(name, is_said):
    """The sign of m turns two terms, that of d only the one."""
    turned, value = ReversedTerm("-d*v/m in v"), effects.WrongParameter(name)
    for cause, other in ((turned, value), (value, turned)):
        found, first = rivals_of({other: -1.0}, cause=cause)
        assert bool(found) is bool(first) is is_said


def test_what_takes_more_parameters_is_no_rival_however_near():
    assert rivals_of({DEARER: 0.0}) == ([], [])


@pytest.mark.parametrize("than", ["falls", "worse"])
def test_what_the_free_run_speaks_against_is_no_rival_however_near_over_windows(than):
    assert rivals_of({LIKE: -300.0, DRAG: 1.0}, **{than: (LIKE,)}) == ([(DRAG, 1.0)], [])


def test_what_is_the_same_as_a_rival_is_one_too_with_the_same_evidence():
    assert rivals_of({LIKE: 1.0})[0] == [(LIKE, 1.0), (SAME, 1.0)]


def test_what_is_too_small_to_be_told_from_another_resembles_it():
    assert rivals_of({}, resembling=(LIKE,))[0] == [(LIKE, 0.0), (SAME, 0.0)]
    assert rivals_of({LIKE: 3.0}, resembling=(LIKE,))[0][0] == (LIKE, 3.0)  # it was fitted
    assert rivals_of({}, resembling=(LIKE,), beside=(LIKE,))[0] == []  # it is a cause already


def test_what_is_the_same_beside_the_others_is_a_rival_that_no_evidence_is_against():
    assert rivals_of({}, equal=(DRAG,))[0] == [(DRAG, 0.0)]
    assert rivals_of({DRAG: 2.0}, equal=(DRAG,))[0] == [(DRAG, 2.0)]
