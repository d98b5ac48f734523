"""Causes on stores, terminals and inputs: each is found beside its nearest relatives, or nothing.

The machines are simulated by the integrator of `datasets`, with priors that are up to 5 % off.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems
from sklearn_pgnn.datasets.integrator import integrate

BODY = PhysicsModel(
    {"T": "degC"},
    {"T": "(P + UA*(Ta - T))/C"},
    {
        "C": {"value": 4e3, "unit": "J/K", "spread": 0.3},
        "UA": {"value": 20.0, "unit": "W/K", "spread": 0.3},
    },
    {"P": "W", "Ta": "degC"},
    initial_state={"T": 20.0},
)
WATER = BODY.replace(equations={"T": "UA*(Ta - T)/C"}, inputs={"Ta": "degC"})
CELL = PhysicsModel(
    {"z": ""},
    {"z": "I/Q"},
    {
        "Q": {"value": 7e3, "unit": "A s", "spread": 0.05},
        "R0": {"value": 0.02, "unit": "Ohm", "spread": 0.3},
        "c0": {"value": 3.2, "unit": "V", "fixed": True},
        "c1": {"value": 0.8, "unit": "V", "fixed": True},
    },
    {"I": "A"},
    {"V": "c0 + c1*z + R0*I"},
    initial_state={"z": 0.6},
)
LAMP = PhysicsModel(
    {"v": "V"},
    {"v": "(K*duty - v)/tau"},
    {
        "K": {"value": 0.014, "bounds": [1e-3, 0.2], "spread": np.inf},
        "tau": {"value": 0.1, "unit": "s", "bounds": [5e-3, 1], "spread": np.inf},
    },
    {"duty": "%"},
)
MOTOR = PhysicsModel(
    {"w": "rad/s", "T": "K"},
    {"w": "(Kt*(u - Kt*w)/R - b*w)/J", "T": "((u - Kt*w)**2/R - h*T)/Cth"},
    {
        "R": {"value": 1.2, "spread": 0.05},
        "Kt": {"value": 0.08, "spread": 0.05},
        "J": 4e-4,
        "b": 2e-4,
        "Cth": 8.0,
        "h": 0.6,
    },
    {"u": "V"},
    inertia={"w": "J"},
)
COIL = PhysicsModel(
    {"i": "A", "v": "V"},
    {"i": "(u - R*i - v)/L", "v": "i/Cp"},
    {
        "R": {"value": 2.0, "spread": 0.1},
        "L": {"value": 0.05, "spread": 0.1},
        "Cp": {"value": 2e-3, "spread": 0.1},
    },
    {"u": "V"},
    {"current": "i"},
)


class Rig(NamedTuple):
    """A machine, how its inputs are drawn (lowest, highest, samples a level), step and noise."""

    model: PhysicsModel
    levels: tuple
    step: float
    noise: float
    samples: int = 400


HEATED = Rig(BODY, ((0, 800, 50), (0, 20, 90)), 10.0, 0.05)
KILN = Rig(BODY, ((0, 16_000, 50), (10, 30, 90)), 10.0, 0.5)
COOLED = Rig(WATER, ((0, 40, 80),), 10.0, 0.02)
CYCLED = Rig(CELL, ((-3, 3, 60),), 5.0, 1e-3, 600)
LIT = Rig(LAMP, ((0, 100, 40),), 0.02, 0.01, 600)
DRIVEN = Rig(MOTOR, ((-12, 12, 60),), 0.05, 0.05, 1200)
SWITCHED = Rig(COIL, ((-12, 12, 50),), 0.004, 0.01, 1000)
PUSHED = Rig(systems.cart_on_spring(), ((-8, 8, 60),), 0.01, 1e-3, 1000)

STORES = [
    "second_store",
    "store_between",
    "power_loss",
    "radiation_loss",
    "coefficient_by_direction",
    "sensor_lag",
    "actuator_lag",
    "wrong_parameter",
]
CURVES = [
    "input_power",
    "input_curve",
    "input_saturation",
    "input_dead_zone",
    "parameter_saturation",
    "parameter_slope",
    "sensor_curvature",
]
DEPENDENT = [
    "parameter_slope",
    "parameter_saturation",
    "parameter_drift",
    "coefficient_by_direction",
    "actuator_lag",
    "wrong_parameter",
]
TERMINALS = [
    "relaxation_branch",
    "two_relaxation_branches",
    "second_store",
    "actuator_lag",
    "leak",
    "sensor_gain",
    "coefficient_by_direction",
    "wrong_parameter",
]
SPRINGS = [
    "maxwell_branch",
    "linear_stiffness",
    "viscous_friction",
    "hysteresis",
    "cubic_stiffness",
]

HIDDEN = [
    (HEATED, effects.SecondStore("T", 1 / 400, 900.0), STORES),
    (HEATED, effects.StoreBetween("T(Ta)", 600.0, 3.0), STORES),
    (HEATED, effects.PowerLoss("T(Ta)", 2e-4, 0.8), STORES),
    (KILN, effects.RadiationLoss("T(Ta)", 2e-11), STORES),
    (COOLED, effects.CoefficientByDirection("UA", -0.5), [*STORES, "sensor_bias"]),
    (HEATED, effects.SensorLag("T", 60.0), STORES),
    (CYCLED, effects.RelaxationBranch("V(I)", 0.01, 80.0), TERMINALS),
    (CYCLED, effects.TwoRelaxationBranches("V(I)", 0.006, 0.01, 15.0, 12.0), TERMINALS),
    (LIT, effects.InputPower("duty", -0.4, 50.0), CURVES),
    (LIT, effects.InputCurve("duty", -0.7, 0.8, 25.0, 60.0), CURVES),
    (LIT, effects.ParameterSaturation("tau(duty)", 0.02), DEPENDENT),
    (DRIVEN, effects.ParameterSlope("R(T)", 0.004), DEPENDENT),
    (SWITCHED, effects.ParameterSaturation("L(i)", 0.3), DEPENDENT),
    (PUSHED, effects.MaxwellBranch("v", 30.0, 0.3), SPRINGS),
]


def diagnose(rig, truth, catalogue, seed):
    """Return the diagnosis of four records of a machine, and a prior whose numbers are off."""
    rng, t = np.random.default_rng(seed), rig.step * np.arange(rig.samples)
    u = np.empty((4, t.size, len(rig.levels)))
    for j, (low, high, held) in enumerate(rig.levels):
        drawn = rng.uniform(low, high, (4, t.size // held + 1))
        u[..., j] = np.repeat(drawn, held, axis=1)[:, : t.size]
    _, y = integrate(truth, t, u, substeps=8)
    y = y + rig.noise * rng.normal(size=y.shape)
    signals = {name: u[..., j].ravel() for j, name in enumerate(rig.model.inputs)}
    X = pd.DataFrame({"trajectory": np.repeat(range(4), t.size), "t": np.tile(t, 4), **signals})
    off = {
        name: parameter.value * (1 + rng.uniform(-0.05, 0.05))
        for name, parameter in rig.model.parameters.items()
        if not parameter.fixed
    }
    prior = rig.model.with_parameters(**off)
    y = pd.DataFrame(np.concatenate(y), columns=list(truth.outputs))
    return ModelDiagnosis(prior, catalogue=catalogue).fit(X, y)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "effect", "catalogue"), HIDDEN, ids=lambda each: getattr(each, "id", None)
)
def test_what_is_hidden_is_named_beside_its_relatives(rig, effect, catalogue):
    diagnosis = diagnose(rig, rig.model + effect, catalogue, seed=11)
    (cause,) = diagnosis.causes_
    others = {(rival.effect, rival.target) for rival in cause.confused_with}
    assert (effect.id, effect.target) in {(cause.effect, cause.target), *others}
    if cause.effect == effect.id:
        size = effect.size_field()
        assert cause.parameters[size].value == pytest.approx(getattr(effect, size), rel=0.15)
    assert not others or effect.id == "coefficient_by_direction"


@pytest.mark.slow
@pytest.mark.parametrize("known", [0.02, 0.03, 0.04])
def test_what_was_known_of_a_coefficient_may_be_its_value_in_either_direction(known):
    """20 mOhm in charge and 40 mOhm in discharge; the prior has one of them, or the mean."""
    truth = CELL.with_parameters(R0=0.04) + effects.CoefficientByDirection("R0", -0.5)
    steps = ((-3, 3, 37),)  # some within a window
    rig = CYCLED._replace(model=CELL.with_parameters(R0=known), levels=steps)
    (cause,) = diagnose(rig, truth, TERMINALS, seed=11).causes_
    assert cause.effect == "coefficient_by_direction"
    assert cause.parameters["change"].value == pytest.approx(-0.5, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "catalogue"),
    [
        (HEATED, STORES),
        (COOLED, STORES),
        (CYCLED, TERMINALS),
        (LIT, CURVES),
        (LIT, DEPENDENT),
        (DRIVEN, DEPENDENT),
        (SWITCHED, DEPENDENT),
        (PUSHED, SPRINGS),
    ],
)
def test_where_nothing_is_hidden_nothing_is_named(rig, catalogue):
    diagnosis = diagnose(rig, rig.model, catalogue, seed=12)
    assert not diagnosis.causes_
    assert diagnosis.verdict_ == "model_adequate"
