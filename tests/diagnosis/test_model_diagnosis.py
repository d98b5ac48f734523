"""A diagnosis finds what a seed has hidden, and nothing where nothing is.

The machine is simulated by the integrator of `datasets`, which is not the package's own; the
diagnosis sees the records and a prior whose parameters are up to 7 % off.
"""

import copy
import itertools
import json
import pickle
import re
import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from sklearn.base import clone

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems
from sklearn_pgnn.datasets import make_hidden_effect, make_two_tanks
from sklearn_pgnn.diagnosis.verdict import Remaining
from sklearn_pgnn.estimation.equivalence import are_equivalent
from sklearn_pgnn.estimation.possible_causes import possible_causes
from sklearn_pgnn.estimation.same_in_equations import same_causes, same_parameter
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.inspection.words import remaining_sentence, separation_sentence, verdict_sentence

RECORDS = {"n_records": 6, "sample_rate": 100.0}
SEED = 7
#: effects that take long to look at: they have a memory, or many starts
LONG = (
    effects.Cogging,
    effects.Hysteresis,
    effects.PeriodicDisturbance,
    effects.EndStop,
    effects.RateLimit,
    effects.InputBacklash,
    effects.InputRateLimit,
    effects.ParameterDrift,
)
#: effects with a state of their own
MEMORIES = (
    effects.Hysteresis,
    effects.InputBacklash,
    effects.ActuatorLag,
    effects.InputRateLimit,
)
RIGS = {
    systems.cart_on_spring: {"n_records": 4, "sample_rate": 100.0},
    systems.two_tanks: {
        "n_records": 4,
        "duration": 600.0,
        "sample_rate": 1.0,
        "noise": 0.01,
        "excitation": ("multisine", "chirp"),
        "amplitude": 2.7,
    },
}


def expected_name(model, effect):
    """Return what must be named: the parameter, if one already describes the effect."""
    parameter = same_parameter(model, effect)
    return (effect.id, effect.target) if parameter is None else ("wrong_parameter", parameter)


def names(cause):
    """Return a cause and all that it is confused with."""
    return {(cause.effect, cause.target), *((o.effect, o.target) for o in cause.confused_with)}


def groups_of(prior, effect):
    """Return what is the same as an effect, as it stands and where parameters are re-tuned."""
    others = possible_causes(prior, effects.CATALOGUE)
    cause, truth = type(effect)(effect.target), expected_name(prior, effect)
    classes = [{(c.id, c.target) for c in (k, *v)} for k, v in same_causes(prior, others).items()]
    same = {truth}.union(*(each for each in classes if truth in each))
    tuned = {(each.id, each.target) for each in others if are_equivalent(prior, cause, each)}
    return same, same | tuned


def holds(found, value):
    """Return whether an interval holds a value; one of a thousand right ones does not."""
    reach = 3.3 / 1.96 * (found.high - found.low) / 2
    return abs(found.value - value) <= reach


def assert_size(cause, effect):
    """Check that a cause's intervals hold the numbers that were hidden."""
    for field, found in cause.parameters.items():
        assert holds(found, getattr(effect, field)), (cause.effect, field, found, effect)


def diagnose(hidden, **options):
    return ModelDiagnosis(hidden.prior, **options).fit(hidden.X, hidden.y)


@pytest.fixture(scope="module")
def friction():
    hidden = make_hidden_effect(effect="coulomb_friction", random_state=SEED, **RECORDS)
    return hidden, diagnose(hidden)


#: with the Coulomb friction above one of every kind; `benchmarks/validation` hides all of them
HIDDEN = (
    "asymmetric_friction",
    "quadratic_drag",
    "cubic_stiffness",
    "constant_load",
    "cogging",
    "end_stop",
    "hysteresis",
    "periodic_disturbance",
    "rate_limit",
    "load_friction",
    "input_dead_zone",
    "asymmetric_dead_zone",
    "input_saturation",
    "input_delay",
    "input_rate_limit",
    "sensor_bias",
    "sensor_saturation",
    "wrong_parameter",
    "parameter_drift",
)


def assert_named(hidden, diagnosis):
    """Check that a diagnosis names what is hidden, with its size, and leaves only noise."""
    assert len(diagnosis.causes_) == 1, diagnosis.causes_
    (cause,) = diagnosis.causes_
    same, tuned = groups_of(hidden.prior, hidden.effect)
    if cause.effect == "hysteretic_spring":  # where the force levels off this is the same law
        same, tuned = (
            {("hysteretic_spring", target) for _, target in each} for each in (same, tuned)
        )
    assert same <= names(cause) <= tuned
    assert diagnosis.verdict_ == ("ambiguous" if cause.is_open else "cause_named")
    if (cause.effect, cause.target) == (hidden.effect.id, hidden.effect.target):
        assert_size(cause, hidden.effect)
    gain = diagnosis.gain_["phi_measured"]
    assert gain.extended < 1.05 * gain.noise


@pytest.mark.slow
@pytest.mark.parametrize("effect", HIDDEN)
def test_a_hidden_effect_is_named(effect):
    hidden = make_hidden_effect(effect=effect, random_state=SEED, **RECORDS)
    assert_named(hidden, diagnose(hidden))


@pytest.mark.slow
def test_hidden_friction_is_named(friction):
    assert_named(*friction)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_named_where_nothing_is_hidden(seed):
    hidden = make_hidden_effect(effect=None, random_state=seed, **RECORDS)
    diagnosis = diagnose(hidden)
    assert diagnosis.verdict_ == "model_adequate"
    assert diagnosis.causes_ == ()
    assert same_structure(diagnosis.extended_model_, hidden.prior)


@pytest.mark.slow
@pytest.mark.parametrize("system", [systems.cart_on_spring, systems.two_tanks])
def test_nothing_is_named_on_other_machines_either(system):
    hidden = make_hidden_effect(system(), None, random_state=SEED, **RIGS[system])
    assert diagnose(hidden).causes_ == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "kinds",
    [
        ("input_dead_zone", "stribeck_friction"),
        ("actuator_lag", "constant_load"),
        ("coulomb_friction", "input_bias"),
        ("sensor_bias", "coulomb_friction"),
        ("input_saturation", "quadratic_drag", "coulomb_friction"),
    ],
    ids=" and ".join,
)
def test_several_hidden_effects_are_named_and_no_other(kinds):
    cart = systems.cart_on_spring()
    hidden = make_hidden_effect(cart, kinds, random_state=SEED, **RIGS[systems.cart_on_spring])
    diagnosis = diagnose(hidden, catalogue=[e for e in effects.CATALOGUE if e not in LONG])
    truth = {expected_name(hidden.prior, effect) for effect in hidden.effects}
    groups = [names(cause) for cause in diagnosis.causes_]
    assert len(groups) == len(kinds), groups
    assert [len(truth & group) for group in groups] == [1] * len(kinds), groups
    assert truth <= set().union(*groups)
    hidden_as = {(effect.id, effect.target): effect for effect in hidden.effects}
    for cause in diagnosis.causes_:
        if (cause.effect, cause.target) in hidden_as:
            assert_size(cause, hidden_as[cause.effect, cause.target])


@pytest.mark.slow
@pytest.mark.parametrize(
    "kinds",
    list(itertools.permutations(["input_saturation", "actuator_lag"])),
    ids=" then ".join,
)
def test_an_input_may_saturate_before_or_behind_its_lag(kinds):
    oven = PhysicsModel(
        {"T": "K"}, {"T": "(P - L*T)/C"}, {"C": 500.0, "L": 4.0}, {"P": "W"}, {"T": "T"}
    )
    hidden = make_hidden_effect(
        oven,
        kinds,
        n_records=4,
        duration=2000.0,
        sample_rate=0.25,
        amplitude=60.0,
        noise=0.05,
        random_state=SEED,
    )
    of_inputs = [effect for effect in effects.CATALOGUE if effect.targets(oven) == ("P",)]
    diagnosis = diagnose(hidden, catalogue=of_inputs)
    assert {cause.effect for cause in diagnosis.causes_} == set(kinds)
    true = oven
    for effect in hidden.effects:
        true = true + effect
    assert same_structure(diagnosis.extended_model_, true)


@pytest.mark.slow
def test_a_lag_much_shorter_than_a_sample_may_be_the_delay_that_is_named():
    lag = effects.ActuatorLag("force", 0.004)
    rig = RIGS[systems.cart_on_spring]
    hidden = make_hidden_effect(
        systems.cart_on_spring(), lag, noise=1e-4, substeps=8, random_state=SEED, **rig
    )
    diagnosis = diagnose(hidden, catalogue=(effects.InputDelay, effects.ActuatorLag))
    (cause,) = diagnosis.causes_
    assert names(cause) == {("input_delay", "force"), ("actuator_lag", "force")}
    assert cause.equivalent == ()
    assert abs(cause.parameters["delay"].value / lag.time_constant - 1) < 0.05
    (separation,) = diagnosis.separations_
    assert "a higher sampling rate" in separation_sentence(separation)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "factors"),
    [
        (systems.two_tanks, {"k1": 1.5}),
        (systems.cart_on_spring, {"k": 1.4, "m": 0.7}),
    ],
)
def test_wrong_parameters_are_named_and_no_structure(system, factors):
    model = system()
    wrong = [
        effects.WrongParameter(name, factor * model.parameters[name].value)
        for name, factor in factors.items()
    ]
    hidden = make_hidden_effect(model, wrong, random_state=SEED, **RIGS[system])
    diagnosis = diagnose(hidden)
    found = {(cause.effect, cause.target) for cause in diagnosis.causes_}
    assert found == {("wrong_parameter", name) for name in factors}
    for effect in wrong:
        value = diagnosis.extended_model_.parameters[effect.target].value
        assert abs(value / effect.value - 1) < 0.05
        (cause,) = (c for c in diagnosis.causes_ if c.target == effect.target)
        assert_size(cause, effect)


@pytest.mark.slow
def test_records_without_noise_are_judged_too():
    hidden = make_hidden_effect(effect=None, noise=0.0, random_state=SEED, **RECORDS)
    assert diagnose(hidden).verdict_ == "model_adequate"


def same_structure(one, other):
    return dict(one.equations) == dict(other.equations) and dict(one.outputs) == dict(other.outputs)


@pytest.mark.slow
@pytest.mark.parametrize("parameter", ["J", "d"])
def test_a_wrong_parameter_is_named_as_one(parameter):
    golf = systems.golf_robot()
    value = 1.6 * golf.parameters[parameter].value
    hidden = make_hidden_effect(
        golf, effects.WrongParameter(parameter, value), random_state=SEED, **RECORDS
    )
    diagnosis = diagnose(hidden)
    assert [(c.effect, c.target) for c in diagnosis.causes_] == [("wrong_parameter", parameter)]
    found = diagnosis.causes_[0].parameters["value"]
    assert abs(found.value / value - 1) < 0.05
    assert diagnosis.parameters_[parameter].changed


@pytest.mark.slow
def test_a_cause_is_found_where_only_one_of_two_states_is_measured():
    hidden = make_two_tanks(random_state=SEED)
    diagnosis = diagnose(hidden)
    assert [c.effect for c in diagnosis.causes_] == [hidden.effect.id]


@pytest.mark.slow
def test_the_size_of_a_cause_is_found(friction):
    hidden, diagnosis = friction
    level = diagnosis.causes_[0].parameters["level"]
    assert abs(level.value / hidden.effect.level - 1) < 0.1
    assert level.low < level.value < level.high
    assert level.high - level.low < 0.3 * hidden.effect.level
    assert level.unit == "N m"


@pytest.mark.slow
def test_causes_that_cannot_be_told_apart_are_said_to_be_confused():
    load = effects.ConstantLoad("omega", load=0.05)
    hidden = make_hidden_effect(effect=load, random_state=SEED, **RECORDS)
    diagnosis = diagnose(hidden)
    assert diagnosis.verdict_ == "ambiguous"
    assert {("constant_load", "omega"), ("input_bias", "torque")} <= names(diagnosis.causes_[0])


@pytest.mark.slow
def test_the_extended_model_is_a_model_that_simulates_the_machine(friction):
    hidden, diagnosis = friction
    assert diagnosis.score(hidden.X, hidden.y) > 0.999
    assert isinstance(diagnosis.extended_model_, PhysicsModel)
    refitted = ModelDiagnosis(diagnosis.refitted_model_)
    assert refitted.model == diagnosis.refitted_model_


@pytest.mark.slow
def test_the_dictionary_is_strict_json(friction):
    _, diagnosis = friction
    data = json.loads(json.dumps(diagnosis.to_dict(), allow_nan=False))
    assert data["verdict"] == "cause_named"
    assert data["causes"][0]["effect"] == "coulomb_friction"
    assert set(data["gain"]["phi_measured"]) >= {"prior", "refitted", "extended", "noise"}


@pytest.mark.slow
def test_the_dictionary_says_none_wherever_a_number_is_not_finite(friction):
    lost = copy.deepcopy(friction[1])
    lost.remaining_ = Remaining("structure", {"phi_measured": np.inf})
    lost.initial_states_[0, 0] = np.nan
    data = json.loads(json.dumps(lost.to_dict(), allow_nan=False))
    assert data["remaining"]["times_noise"] == {"phi_measured": None}
    assert next(iter(data["initial_states"][0]["state"].values())) is None


@pytest.mark.slow
def test_a_fitted_diagnosis_survives_pickle_copy_and_clone(friction):
    hidden, diagnosis = friction
    expected = diagnosis.predict(hidden.X)
    for copied in (pickle.loads(pickle.dumps(diagnosis)), copy.deepcopy(diagnosis)):
        np.testing.assert_array_equal(copied.predict(hidden.X), expected)
        assert copied.to_dict() == diagnosis.to_dict()
    assert clone(diagnosis).model == hidden.prior


@pytest.mark.slow
def test_fit_changes_nothing_it_was_given(friction):
    hidden, diagnosis = friction
    before = hidden.X.copy(), hidden.y.copy(), hidden.prior.to_dict()
    ModelDiagnosis(hidden.prior, targets=["omega"], max_causes=1).fit(hidden.X, hidden.y)
    assert before[0].equals(hidden.X)
    assert before[1].equals(hidden.y)
    assert before[2] == hidden.prior.to_dict()
    assert diagnosis.get_params()["model"] is hidden.prior


@pytest.mark.slow
def test_the_catalogue_and_the_targets_can_be_narrowed(friction):
    hidden, _ = friction
    diagnosis = diagnose(hidden, catalogue=[effects.CoulombFriction, effects.InputBias])
    candidates = [(tried.effect, tried.target) for tried in diagnosis.candidates_]
    assert candidates == [("coulomb_friction", "omega"), ("input_bias", "torque")]


@pytest.mark.slow
def test_of_an_effect_that_the_model_was_extended_by_a_number_may_be_wrong():
    golf = systems.golf_robot()
    hidden = make_hidden_effect(golf, "coulomb_friction", random_state=SEED, **RECORDS)
    prior = hidden.prior + replace(hidden.effect, level=1.5 * hidden.effect.level)
    friction = [
        kind for kind in effects.CATALOGUE if kind.__module__ == effects.CoulombFriction.__module__
    ]
    diagnosis = ModelDiagnosis(prior, catalogue=[*friction, effects.WrongParameter])
    (cause,) = diagnosis.fit(hidden.X, hidden.y).causes_
    assert (cause.effect, cause.target) == ("wrong_parameter", "Fc_omega")
    assert abs(cause.parameters["value"].value / hidden.effect.level - 1) < 0.1


def test_too_little_data_is_refused():
    golf = systems.golf_robot()
    t = np.arange(10) * 0.01
    with pytest.raises(
        RecordError, match=r"at least 80 measured samples .* got 10 samples, enough for 0"
    ):
        ModelDiagnosis(golf).fit(np.column_stack([t, np.sin(t)]), np.sin(t))


@pytest.mark.slow
@pytest.mark.parametrize("seen", [1, 5])
def test_a_record_of_which_hardly_a_sample_is_seen_does_no_harm(seen):
    hidden = make_hidden_effect(
        systems.cart_on_spring(), "input_bias", random_state=SEED, **RIGS[systems.cart_on_spring]
    )
    y = hidden.y.copy()
    y.iloc[seen : (hidden.X["trajectory"] == 0).sum()] = np.nan
    diagnosis = ModelDiagnosis(hidden.prior, catalogue=[effects.InputBias]).fit(hidden.X, y)
    assert [cause.effect for cause in diagnosis.causes_] == ["input_bias"]


def test_an_output_that_never_changes_is_refused():
    golf = systems.golf_robot()
    t = np.arange(100) * 0.01
    with pytest.raises(RecordError, match=r"'phi_measured': expected a signal that changes"):
        ModelDiagnosis(golf).fit(np.column_stack([t, np.sin(t)]), np.zeros(100))


@pytest.mark.slow
def test_an_interval_tells_how_far_the_held_friction_of_the_model_may_be_off():
    hidden = make_hidden_effect(
        systems.cart_on_spring(),
        effects.AsymmetricFriction("v", 1.0, 1.5, 0.3, 0.8),
        n_records=4,
        sample_rate=100,
        random_state=3,
    )
    diagnosis = ModelDiagnosis(hidden.prior, catalogue=(effects.AsymmetricFriction,))
    (cause,) = diagnosis.fit(hidden.X, hidden.y).causes_
    d = hidden.prior.parameters["d"]
    by_held = 1.96 * d.spread * d.value / np.sqrt(3)
    for name in ("viscous_forward", "viscous_backward"):
        found = cause.parameters[name]
        assert found.low <= getattr(hidden.effect, name) <= found.high
        assert by_held < (found.high - found.low) / 2 < 1.5 * by_held
    level = cause.parameters["level_forward"]
    assert (level.high - level.low) / 2 < 0.05


@pytest.fixture(scope="module", params=["zoh", "foh"])
def smooth_input(request):
    """A hardening spring seen eight times a period, under an input that is smooth between."""
    cart = systems.cart_on_spring().with_parameters(m=1.0, d=1.0, k=400.0)
    rng, t = np.random.default_rng(SEED), np.arange(1500) / 25
    waves = rng.uniform(0.5, 5.0, 25)[:, None] * t + rng.uniform(0, 1, 25)[:, None]
    F = 8 * np.sin(2 * np.pi * waves).sum(axis=0)
    rig = cart + effects.CubicStiffness("v", stiffness=2000.0)
    q = rig.simulate(t, F, substeps=20, hold=request.param).y
    q += 1e-3 * rng.standard_normal(q.shape)
    prior = cart.with_parameters(k=380.0, d=1.05)
    catalogue = [effects.CubicStiffness, effects.InputDelay]
    return request.param, ModelDiagnosis(prior, catalogue=catalogue).fit(np.c_[t, F], q)


@pytest.mark.slow
def test_records_tell_how_inputs_run_between_samples(smooth_input):
    hold, diagnosis = smooth_input
    assert diagnosis.hold_ == hold
    assert [cause.effect for cause in diagnosis.causes_] == ["cubic_stiffness"]
    assert diagnosis.causes_[0].parameters["stiffness"].value == pytest.approx(2000, rel=0.02)


def test_an_unknown_hold_is_refused():
    hidden = make_hidden_effect(n_records=2, duration=3, sample_rate=50, random_state=0)
    with pytest.raises(ValueError, match="hold: expected one of auto, zoh, foh, got 'linear'"):
        ModelDiagnosis(hidden.prior, hold="linear").fit(hidden.X, hidden.y)


def leaned_on():
    """Records of a cart that somebody leans on, now more, now less; its model is right."""
    cart = systems.cart_on_spring()
    rng, t = np.random.default_rng(SEED), np.arange(0, 20, 0.02)
    lean = PhysicsModel(
        dict(cart.states),
        {"x": "v", "v": "(force + lean - k*x - d*v)/m"},
        {name: p.value for name, p in cart.parameters.items()},
        {"force": "N", "lean": "N"},
        {"position": "x"},
    )
    X, y = [], []
    for record in range(4):
        force = np.repeat(rng.uniform(-15, 15, 40), 25)
        slow = lfilter([np.sqrt(1 - 0.98**2)], [1, -0.98], rng.standard_normal(t.size))
        run = lean.simulate(t, np.c_[force, 0.5 * slow], substeps=4)
        X.append(pd.DataFrame({"trajectory": record, "t": t, "force": force}))
        y.append(run.y + 1e-3 * rng.standard_normal(run.y.shape))
    return cart, pd.concat(X), np.concatenate(y)


@pytest.mark.slow
def test_a_slow_disturbance_from_outside_gets_no_name():
    """What a memory explains from a free start in every window, it does not in free run."""
    cart, X, y = leaned_on()
    diagnosis = ModelDiagnosis(cart, catalogue=MEMORIES).fit(X, y)
    assert (diagnosis.verdict_, diagnosis.causes_) == ("nothing_found", ())
    assert diagnosis.remaining_.kind == "disturbance"
    assert "no law that was tried predicts it" in remaining_sentence(diagnosis)


@pytest.mark.slow
def test_play_without_width_is_a_lag_at_its_place_among_the_others():
    """Beside a delay the fit of a lag may end elsewhere; that of the play tells where it is."""
    servo = PhysicsModel({"x": "m"}, {"x": "K*u"}, {"K": 0.1}, {"u": "V"})
    rig = servo + effects.InputDelay("u", 0.06) + effects.ActuatorLag("u", 0.04)
    rig = rig + effects.InputDeadZone("u", 0.5)
    rng, t = np.random.default_rng(1), np.arange(2500) / 50
    u = np.repeat(rng.uniform(-3, 3, 100), 25) + 0.4 * np.sin(3.1 * t)
    x = rig.simulate(t, u, substeps=5).y + 1e-4 * rng.standard_normal((t.size, 1))
    kinds = effects.InputBacklash, effects.InputDeadZone, effects.ActuatorLag, effects.InputDelay
    prior = servo.with_parameters(K=0.095)
    diagnosis = ModelDiagnosis(prior, catalogue=kinds).fit(np.c_[t, u], x)
    found = {cause.effect for cause in diagnosis.causes_}
    assert found == {"input_dead_zone", "actuator_lag", "input_delay"}
    said = verdict_sentence(diagnosis)
    assert re.search(
        "u passes through .*input dead zone of u, .*actuator lag of u.* .the order matters", said
    )


def battery_records(weakest, **start):
    battery = PhysicsModel(
        {"soc": "", "v": "V"},
        {"soc": "-I/Q", "v": "I/C - v/(R*C)"},
        {"R": 0.03, "C": 800.0, "Q": 7200.0},
        {"I": "A"},
        {"U": "3.4 + 0.2*log(soc/(1 - soc)) - v"},
    )
    rng, t = np.random.default_rng(0), np.arange(400.0)
    X = pd.DataFrame({"t": t, "I": np.repeat(rng.uniform(weakest, 4, 40), 10)})
    U = battery.simulate(t, X["I"], [0.7, 0.0]).y + 1e-4 * rng.standard_normal((t.size, 1))
    return battery, X.assign(**start), U


def test_a_model_that_cannot_be_simulated_is_refused_with_a_remedy():
    """No output shows the charge, and there is no voltage of a battery that is emptied further."""
    battery, X, U = battery_records(0.0)
    said = (
        r"(\d+) of \1 windows, first in trajectory '0' from t = 0 s with soc = 0, .*columns soc, v"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(RecordError, match=said):
            ModelDiagnosis(battery, catalogue=()).fit(X, U)


@pytest.mark.parametrize(("weakest", "start"), [(0.0, {"soc": 0.7}), (-3.0, {})])
def test_a_state_that_is_told_makes_it_possible_or_a_record_that_reaches_it(weakest, start):
    """A battery that is charged, too, passes through charges of which there is a voltage."""
    battery, X, U = battery_records(weakest, **start)
    diagnosis = ModelDiagnosis(battery, catalogue=()).fit(X, U)
    assert diagnosis.verdict_ == "model_adequate"
    assert diagnosis.parameters_["Q"].value == pytest.approx(7200, rel=0.01)
