"""Causes that are confused: recognised as the same, or told apart by the experiment proposed."""

import json

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems
from sklearn_pgnn.cli.screen import print_diagnosis
from sklearn_pgnn.estimation.equivalence import are_equivalent
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.experiment_design.separation import are_same, put_in_place, waves
from sklearn_pgnn.trajectories import read_records

NOISE = 4e-3


def cart():
    return PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(b*F - k*x - d*v)/m"},
        {"m": 2.0, "d": 1.0, "k": 10.0, "b": {"value": 1.0, "spread": 0.5}},
        {"F": "N"},
        {"position": "x"},
        inertia={"v": "m"},
    )


def measure(machine, inputs, t, seed=0):
    """Return a table of records under some inputs."""
    rng, tables = np.random.default_rng(seed), []
    for record, u in enumerate(inputs):
        x = machine.simulate(t, u, substeps=8).check().y[:, 0]
        x = x + NOISE * rng.standard_normal(t.size)
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "F": u, "position": x}))
    return pd.concat(tables, ignore_index=True)


def diagnose(table, catalogue):
    model = cart().replace(parameters={**cart().parameters, "b": {"value": 1.0, "fixed": True}})
    diagnosis = ModelDiagnosis(model, catalogue=catalogue)
    return diagnosis.fit(table[["trajectory", "t", "F"]], table["position"])


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (effects.InputBias("F"), effects.ConstantLoad("v"), True),
        (effects.LinearStiffness("v"), effects.WrongParameter("k"), True),
        (effects.WrongParameter("b"), effects.WrongParameter("m"), True),
        (effects.ViscousFriction("v"), effects.WrongParameter("d"), True),
        (effects.SensorBias("position"), effects.ConstantLoad("v"), True),
        (effects.SensorGain("position"), effects.InputGain("F"), True),
        (effects.InputBias("F"), effects.CoulombFriction("v"), False),
        (effects.CoulombFriction("v"), effects.InputDeadZone("F"), False),
        (effects.CoulombFriction("v"), effects.StribeckFriction("v"), False),
        (effects.CubicStiffness("v"), effects.LinearStiffness("v"), False),
        (effects.InputDelay("F"), effects.ActuatorLag("F"), False),
    ],
)
def test_causes_that_are_the_same_in_the_equations_are_recognised(one, other, same):
    assert are_equivalent(cart(), one, other) is same
    assert are_equivalent(cart(), other, one) is same


@pytest.mark.parametrize("friction", [False, True])
def test_a_biased_sensor_is_a_load_unless_it_moves_a_kink(friction):
    wheel = PhysicsModel({"w": "rad/s"}, {"w": "(M - d*w)/J"}, {"J": 1.0, "d": 0.5}, {"M": "N m"})
    wheel = wheel + effects.CoulombFriction("w", level=0.2) if friction else wheel
    bias, load = effects.SensorBias("w"), effects.ConstantLoad("w")
    assert are_equivalent(wheel, bias, load, retuned=False) is not friction


def test_a_gain_of_sensor_or_input_is_the_same_beside_friction():
    """Dry friction keeps its sign in any unit, and its level is fitted anew."""
    motor = PhysicsModel({"w": "1/s"}, {"w": "u - w"}, inputs={"u": "V"}, outputs={"y": "w"})
    rubbing = motor + effects.CoulombFriction("w", level=0.3)
    gains = effects.SensorGain("y"), effects.InputGain("u")
    assert are_equivalent(rubbing, *gains, retuned=False, beside=("Fc_w",))
    assert not are_equivalent(rubbing, *gains, retuned=False)


def test_two_parameters_that_the_equations_tell_apart_are_not_the_same():
    golf = systems.golf_robot()
    wrong = effects.WrongParameter
    assert not are_equivalent(golf, wrong("J"), effects.CoulombFriction("omega"))
    assert are_equivalent(golf, effects.InputBias("torque"), effects.ConstantLoad("omega"))


@pytest.mark.slow
def test_what_the_prior_cannot_tell_apart_another_cause_may():
    t = np.arange(0, 8, 0.02)
    inputs = [20 * np.sin((1 + r) * t) + 8 * np.sin((3 + r) * t) for r in range(4)]
    rig = cart() + effects.CubicStiffness("v", stiffness=10.0)
    rig = rig + effects.SensorBias("position", bias=0.2)
    diagnosis = diagnose(measure(rig, inputs, t), (effects.CubicStiffness, effects.SensorBias))
    assert {cause.effect for cause in diagnosis.causes_} == {"cubic_stiffness", "sensor_bias"}
    bias, load = effects.SensorBias("position"), effects.ConstantLoad("v")
    assert are_equivalent(diagnosis.model, bias, load)
    assert not are_same(diagnosis.records_, bias, load)


@pytest.fixture(scope="module")
def loaded():
    t = np.arange(0, 8, 0.02)
    inputs = [3 * np.sin((1 + r) * t) + np.sin((3 + r) * t) for r in range(4)]
    table = measure(cart() + effects.ConstantLoad("v", load=1.0), inputs, t)
    return diagnose(table, (effects.ConstantLoad, effects.InputBias, effects.SensorBias))


@pytest.mark.slow
def test_what_no_experiment_separates_is_said_so(loaded, tmp_path, capsys):
    (cause,) = loaded.causes_
    assert cause.equivalent == tuple((o.effect, o.target) for o in cause.confused_with)
    assert len(cause.equivalent) == 2
    data = json.loads(json.dumps(loaded.to_dict(), allow_nan=False))
    assert [o["equivalent"] for o in data["causes"][0]["confused_with"]] == [True, True]
    assert [s["separable"] for s in data["separations"]] == [False, False]
    loaded.to_html(tmp_path / "report.html")
    text = "No experiment with these inputs and outputs separates"
    assert text in (tmp_path / "report.html").read_text()
    print_diagnosis(loaded, tmp_path, quiet=False)
    assert text in " ".join(capsys.readouterr().out.split())


@pytest.fixture(scope="module")
def slow():
    """Return a machine with a slow actuator, driven too slowly to tell a lag from a delay."""
    t = np.arange(0, 10, 0.02)
    inputs = [6 * np.sin((0.8 + 0.15 * r) * t) for r in range(3)]
    machine = cart() + effects.ActuatorLag("F", time_constant=0.06)
    table = measure(machine, inputs, t)
    return machine, inputs, t, diagnose(table, (effects.InputDelay, effects.ActuatorLag))


@pytest.mark.slow
def test_a_rival_acts_where_it_hinders_no_other_cause():
    """A flow that depends on the level below acts back: the tank above then runs over nowhere."""
    prior, t = systems.two_tanks(), np.arange(600.0)
    pump = 3.0 + np.sin(t / 20)
    y = prior.simulate(t, pump).y
    problem = build_problem(prior, read_records(prior, np.c_[t, pump], y))
    leak, rim, bias = effects.Leak("x1"), effects.Overflow("x1"), effects.InputBias("pump")
    slope = effects.ParameterSlope("k1(x2)")
    assert put_in_place(problem, (leak, rim), leak, slope).order == (rim, slope)
    assert put_in_place(problem, (leak, rim), leak, bias).order == (bias, rim)


def test_the_experiment_proposed_tells_which_it_is(slow):
    machine, inputs, t, diagnosis = slow
    assert diagnosis.verdict_ == "ambiguous"
    (cause,) = diagnosis.causes_
    assert cause.equivalent == ()
    (separation,) = diagnosis.separations_
    assert separation.separable
    best = separation.experiments[0]
    more = [best.signal(t)] * int(best.repeats)
    again = measure(machine, [*inputs, *more], t, seed=1)
    told = diagnose(again, (effects.InputDelay, effects.ActuatorLag))
    assert [(c.effect, c.confused_with) for c in told.causes_] == [("actuator_lag", ())]


@pytest.mark.slow
def test_experiments_are_ranked_and_stay_within_the_range(slow):
    _, inputs, _, diagnosis = slow
    found = diagnosis.separating_experiment().experiments
    order = [(experiment.repeats, -experiment.evidence) for experiment in found]
    assert order == sorted(order)
    top = np.ptp(inputs) / 2
    assert max(experiment.amplitude for experiment in found) <= 1.001 * top
    wide = diagnosis.separating_experiment(reach=1.5).experiments
    assert max(experiment.amplitude for experiment in wide) > 1.2 * top
    assert wide[0].evidence >= found[0].evidence


@pytest.mark.slow
def test_the_report_names_the_experiment(slow, tmp_path):
    *_, diagnosis = slow
    diagnosis.to_html(tmp_path / "report.html")
    report = (tmp_path / "report.html").read_text()
    best = diagnosis.separations_[0].experiments[0]
    assert "To separate " in report
    assert best.excitation in report
    (entry,) = diagnosis.to_dict()["separations"]
    assert entry["separable"] is True
    assert entry["experiments"][0]["excitation"] == best.excitation


@pytest.mark.slow
def test_any_other_cause_can_be_asked_for(slow):
    *_, diagnosis = slow
    (cause,) = diagnosis.causes_
    (other,) = cause.confused_with
    found = diagnosis.separating_experiment((cause.effect, cause.target), other)
    assert (found.cause, found.other) == ((cause.effect, cause.target), other[:2])
    with pytest.raises(ValueError, match=rf"expected one that was named .* got {other.effect}"):
        diagnosis.separating_experiment(other)
    with pytest.raises(ValueError, match=r"cause: expected an effect of the catalogue"):
        diagnosis.separating_experiment(("rust", "F"))


# -- designed excitations are functions of time, whatever they are sampled at ----------------------

DURATION = 12.0
WAVES = waves(1.5, DURATION, 0.02)


@pytest.mark.parametrize("wave", WAVES, ids=str)
def test_a_wave_stays_within_one_and_begins_at_rest(wave):
    values = wave(np.linspace(0.0, DURATION, 601), DURATION)
    assert 0.95 < np.abs(values).max() <= 1.0 + 1e-12
    assert abs(values[0]) < 1e-9


@pytest.mark.parametrize("wave", WAVES, ids=str)
def test_a_wave_is_the_same_at_any_sample_rate_and_in_parts(wave):
    fine = np.linspace(0.0, DURATION, 601)
    whole = wave(fine, DURATION)
    np.testing.assert_array_equal(wave(fine[::10], DURATION), whole[::10])
    np.testing.assert_array_equal(wave(fine[:300], DURATION), whole[:300])


def test_no_wave_is_quicker_than_samples_can_show():
    assert max(wave.high for wave in WAVES) * 0.02 <= 0.5
    assert len(waves(1.5, DURATION, 0.1)) < len(WAVES)
