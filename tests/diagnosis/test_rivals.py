"""Laws of rivals: what is not refuted and as simple, or the same, or is not in the catalogue."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.diagnosis import rivals
from sklearn_pgnn.diagnosis.outside import OPEN, other_places
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


CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - k*x)/m"},
    {"m": 2.0, "d": 0.5, "k": 8.0},
    {"F": "N"},
    {"x": "x", "speed": "v"},
    inertia={"v": "m"},
)


def test_only_a_sensor_and_time_have_other_places_in_the_plant():
    places = {
        cause: other_places(CART, cause)
        for cause in (
            effects.SensorBias("speed", 0.1),
            effects.SensorCurvature("x", 0.1),
            effects.ParameterDrift("d", 0.1),
            effects.CoulombFriction("v", 0.1),
            effects.InputBias("F", 0.1),
            effects.WrongParameter("m"),
        )
    }
    assert list(places.values()) == [("v",), ("v",), ("v",), (), (), ()]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_a_cause_beside_which_only_noise_is_left_keeps_its_probability(noise):
    rig = SLEDGE + effects.CoulombFriction("v", 0.4)
    found = ModelDiagnosis(SLEDGE).fit(*drive(rig, noise=noise * NOISE))
    (cause,) = found.causes_
    assert (cause.effect, found.verdict_) == ("coulomb_friction", "cause_named")
    assert cause.outside < 1e-3
    assert cause.probability > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [effects.ConstantLoad("v", 2.0), effects.SensorBias("x", -0.25)])
def test_of_a_load_on_a_spring_and_a_bias_the_load_comes_first_and_the_bias_is_its_rival(hidden):
    """Over the spring's zero the two are the same in the equations, whatever is recorded."""
    cart = CART.replace(outputs={"x": "x"})
    rng, t = np.random.default_rng(3), np.arange(500) * 0.02
    X, y = [], []
    for record in range(3):
        force = 9 * np.sin((0.8 + 0.3 * record) * t + record) + 4 * np.sin((2.3 + record) * t)
        X.append(pd.DataFrame({"trajectory": record, "t": t, "F": force}))
        y.append((cart + hidden).simulate(t, force).y[:, 0] + 2e-3 * rng.normal(size=t.size))
    catalogue = ("sensor_bias", "constant_load", "coulomb_friction")
    found = ModelDiagnosis(cart, catalogue=catalogue).fit(pd.concat(X), np.concatenate(y))
    (cause,) = found.causes_
    assert (cause.effect, found.verdict_) == ("constant_load", "ambiguous")
    (rival,) = cause.confused_with
    assert rival.effect == "sensor_bias"
    assert cause.probability + rival.probability + cause.outside == pytest.approx(1.0)
    told = found.to_dict()["causes"][0]
    shares = [told["probability"], told["outside_catalogue"]]
    shares += [each["probability"] for each in told["confused_with"]]
    assert sum(shares) == pytest.approx(1.0)


@pytest.mark.slow
def test_a_true_sensor_effect_is_not_doubted_for_a_law_of_the_plant():
    rig = SLEDGE + effects.SensorSaturation("v", upper=0.9, lower=-0.9)
    X, y = drive(rig)
    found = ModelDiagnosis(SLEDGE, catalogue=("sensor_saturation", "sensor_curvature")).fit(X, y)
    assert found.causes_[0].effect == "sensor_saturation"
    assert found.causes_[0].outside < OPEN


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_no_name_is_sure_beside_which_much_is_left_that_no_name_covers(seed):
    """A drag that turns with the speed: no power of it, no dry friction, no sensor."""
    rig = PhysicsModel(
        {"v": "m/s"}, {"v": "(F - d*v - 0.8*sin(4*v))/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"}
    )
    catalogue = ("sensor_curvature", "sensor_saturation", "parameter_drift", "input_gain")
    found = ModelDiagnosis(SLEDGE, catalogue=catalogue).fit(*drive(rig, seed=seed))
    assert found.remaining_.is_much or not found.causes_
    assert all(cause.probability < 0.9 for cause in found.causes_)
    assert found.verdict_ in ("ambiguous", "unexplained", "nothing_found")
