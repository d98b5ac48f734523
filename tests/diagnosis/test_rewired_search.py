"""A diagnosis begins from the wiring that the records show, and finds the physics beside it."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.physics.effects.wiring import ExchangedOutputs, InputFactor, ReversedOutput

MOTOR = PhysicsModel(
    {"w": "rad/s"},
    {"w": "(volt - kv*w)/ka"},
    {"kv": {"value": 0.4, "bounds": [0.001, 100]}, "ka": {"value": 0.1, "bounds": [0.001, 100]}},
    {"volt": "V"},
    {"speed": "w"},
    inertia={"w": "ka"},
)
FEW = (
    effects.CoulombFriction,
    effects.SensorGain,
    effects.InputGain,
    effects.InputBias,
    effects.WrongParameter,
)


def diagnosed(rig, model, catalogue=FEW, seed=0):
    """Measure a rig, and diagnose the model on its records."""
    rng, X, y = np.random.default_rng(seed), [], []
    t = 0.02 * np.arange(300)
    for _ in range(4):
        u = np.repeat(rng.uniform(-7, 7, (12, len(rig.inputs))), 25, axis=0)
        X.append(np.column_stack([t, u]))
        y.append(rig.simulate(t, u, substeps=8).y)
    y = np.vstack(y)
    y += 2e-3 * y.std(axis=0) * rng.standard_normal(y.shape)
    return ModelDiagnosis(model, catalogue=catalogue).fit(np.vstack(X), y), np.vstack(X), y


def named(diagnosis):
    return [(cause.effect, cause.target) for cause in diagnosis.causes_]


@pytest.mark.slow
def test_friction_is_found_beside_a_reversed_sensor():
    rig = ReversedOutput("speed").apply(MOTOR + effects.CoulombFriction("w", level=0.6))
    diagnosis, X, y = diagnosed(rig, MOTOR)
    wire, friction = diagnosis.causes_
    either = {(wire.effect, wire.target), *(rival[:2] for rival in wire.confused_with)}
    assert either == {("reversed_output", "speed"), ("reversed_input", "volt")}
    assert (friction.effect, friction.target) == ("coulomb_friction", "w")
    assert wire.probability == pytest.approx(0.5, abs=0.05)
    assert friction.parameters["level"].value == pytest.approx(0.6, rel=0.02)
    assert diagnosis.data_quality_[0].kind == "wiring"
    assert 'outputs: {speed: "-w"}' in diagnosis.data_quality_[0].remedy
    left = np.sqrt(np.mean((diagnosis.predict(X) - y) ** 2)) / y.std()
    assert left < 0.02  # the extended model carries both


@pytest.mark.slow
def test_a_turned_term_is_no_rival_of_its_parameter_below_zero():
    """Without bounds the stiffness may cross zero, which says the same."""
    cart = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(F + k*x - d*v)/m"},
        {"m": 2.0, "k": 9.0, "d": 0.8},
        {"F": "N"},
        {"position": "x"},
        inertia={"v": "m"},
    )
    rig = cart.with_parameters(k=-9.0) + effects.CoulombFriction("v", level=0.8)
    diagnosis, *_ = diagnosed(rig, cart)
    assert named(diagnosis) == [("reversed_term", "k*x/m in v"), ("coulomb_friction", "v")]
    assert diagnosis.verdict_ == "cause_named"


@pytest.mark.slow
def test_exchanged_outputs_are_named_with_nothing_beside():
    pair = PhysicsModel(
        {"a": "K", "b": "K"},
        {"a": "(3*left - a)/T1", "b": "(right - b + c*(a - b))/T2"},
        {"c": 0.5, "T1": 0.2, "T2": 0.4},
        {"left": "kW", "right": "kW"},
        {"near": "a", "far": "b"},
    )
    diagnosis, *_ = diagnosed(ExchangedOutputs("near and far").apply(pair), pair)
    assert named(diagnosis) == [("exchanged_outputs", "near and far")]
    assert max(gain.extended / gain.noise for gain in diagnosis.gain_.values()) < 1.2


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1024.0, 1300.0])
def test_a_large_factor_is_never_confused_with_nothing(factor):
    """The scale of the only sensor is that of the only input, whatever friction lies between."""
    rig = MOTOR + effects.CoulombFriction("w", level=0.6)
    rig = InputFactor(f"{1 / factor:.12g} on volt").apply(rig)
    rig = rig.replace(equations={"w": rig.equations["w"].subs("Fc_w", f"{factor}*Fc_w")})
    diagnosis, *_ = diagnosed(rig, MOTOR)
    scale = next(c for c in diagnosis.causes_ if c.effect != "coulomb_friction")
    kinds = {"sensor_gain", "input_gain", "output_factor", "input_factor"}
    assert {scale.effect, *(rival[0] for rival in scale.confused_with)} <= kinds
    assert scale.confused_with
    assert diagnosis.verdict_ == "ambiguous"


@pytest.mark.parametrize(("unit", "second"), [("ms", 1e-3), ("min", 60.0)])
def test_a_time_in_another_unit_is_named_though_the_model_as_given_is_too_fast_for_its_steps(
    unit, second
):
    """In milliseconds taken for seconds a sample is many time constants: fine steps are its own."""
    rng, t = np.random.default_rng(5), np.tile(2.0 * np.arange(250), 2)
    tank = PhysicsModel(
        {"h": "m"}, {"h": "(q - c*h)/A"}, {"A": 0.05, "c": 6e-4}, {"q": "m^3/s"}, name="tank"
    )
    q = np.repeat(rng.uniform(0.0, 4e-4, size=10), 50)
    parts = [slice(0, 250), slice(250, 500)]
    h = np.vstack([tank.simulate(t[p], q[p], [0.3], substeps=4).y for p in parts])
    X = pd.DataFrame({"trajectory": np.repeat([0, 1], 250), "t": t / second, "q": q})
    y = h[:, 0] + 0.002 * rng.standard_normal(t.size)
    found = ModelDiagnosis(tank, catalogue=("coulomb_friction",)).fit(X, y)
    assert [(cause.effect, cause.target) for cause in found.causes_] == [("other_clock", unit)]


def test_a_sign_that_a_free_parameter_can_take_is_left_to_it():
    """The loss has the wrong sign, and its coefficient may be anything: re-tuning does as well."""
    rng, t = np.random.default_rng(3), 5.0 * np.arange(300)
    right = PhysicsModel({"T": "K"}, {"T": "(q - a*T)/C"}, {"C": 1000.0, "a": 12.0}, {"q": "W"})
    free = {"C": {"value": 900.0, "spread": 0.3}, "a": {"value": 20.0, "spread": np.inf}}
    q = np.repeat(rng.uniform(0.0, 500.0, size=12), 25)
    y = right.simulate(t, q, [5.0], substeps=4).y[:, 0] + 0.05 * rng.standard_normal(t.size)
    signed = PhysicsModel({"T": "K"}, {"T": "(q + a*T)/C"}, free, {"q": "W"})
    found = ModelDiagnosis(signed, catalogue=FEW).fit(np.column_stack([t, q]), y)
    assert (found.verdict_, found.causes_, found.data_quality_) == ("model_adequate", (), ())
    assert found.parameters_["a"].value == pytest.approx(-12.0, rel=0.01)
