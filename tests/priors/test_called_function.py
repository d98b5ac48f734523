"""A function that cannot be followed is a model, too: slower, and no worse."""

import math
import pickle

import cloudpickle
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from sklearn_pgnn import ModelDiagnosis, PGNNLRegressor, PhysicsModelRegressor, effects
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.export import to_c, to_casadi, to_control, to_fmu, to_modelica, to_onnx
from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.priors import from_function

SETTINGS = {
    "states": {"phi": "rad", "omega": "rad/s"},
    "inputs": {"torque": "N m"},
    "parameters": {"J": 0.1, "d": 0.02},
    "inertia": {"omega": "J"},
    "outputs": {"angle": "phi"},
}
T = np.arange(0, 1, 0.02)
U = np.sin(3 * T)


def called(t, x, u, p):
    phi, omega = x
    push = u[0] if u[0] > 0 else 0.5 * u[0]
    return [omega, (push - p["d"] * omega) / p["J"] - 9.81 * math.sin(phi)]


def followed(t, x, u, p):
    phi, omega = x
    push = np.where(u[0] > 0, u[0], 0.5 * u[0])
    return [omega, (push - p["d"] * omega) / p["J"] - 9.81 * np.sin(phi)]


CALLED = from_function(called, trace=False, **SETTINGS)
FOLLOWED = from_function(followed, trace=True, **SETTINGS)


def test_its_equations_say_what_is_called_and_what_it_depends_on():
    assert CALLED.to_text().splitlines() == [
        "phi' = omega",
        "omega' = called[omega](phi, omega, torque; J, d)",
    ]
    assert CALLED.kinematic_pairs == FOLLOWED.kinematic_pairs
    assert CALLED.is_autonomous


@pytest.mark.parametrize(
    "effect",
    [
        None,
        effects.CoulombFriction("omega", level=0.05),
        effects.InputBias("torque", bias=0.1),
        effects.SensorBias("angle", bias=0.1),
        effects.InputDelay("torque", delay=0.05),
    ],
    ids=lambda effect: getattr(effect, "id", "none"),
)
def test_it_simulates_as_its_equations_would(effect):
    one, other = (model if effect is None else model + effect for model in (CALLED, FOLLOWED))
    wrt = ("J", "d") if effect is None else tuple(one.parameters)
    found, expected = (model.simulate(T, U, wrt=wrt) for model in (one, other))
    np.testing.assert_allclose(found.y, expected.y, atol=1e-12)
    np.testing.assert_allclose(found.sensitivities, expected.sensitivities, rtol=1e-5, atol=1e-7)


@pytest.mark.slow
def test_outputs_are_called_too():
    def seen(t, x, u, p):
        return {"height": 1 - math.cos(x[0]), "power": x["omega"] * u["torque"]}

    found = from_function(followed, trace=False, **{**SETTINGS, "outputs": seen}).simulate(T, U)
    expected = FOLLOWED.replace(outputs={"height": "1 - cos(phi)", "power": "omega*torque"})
    np.testing.assert_allclose(found.y, expected.simulate(T, U).y, atol=1e-12)


def test_it_is_fitted():
    X = np.column_stack([T, U])
    truth = CALLED.with_parameters(J=0.15, d=0.05).simulate(T, U).y
    found = PhysicsModelRegressor(CALLED).fit(X, truth)
    assert found.model_.parameters["J"].value == pytest.approx(0.15, rel=1e-3)


def test_it_is_a_value():
    assert from_function(called, trace=False, **SETTINGS) == CALLED
    assert pickle.loads(pickle.dumps(CALLED)) == CALLED
    assert clone(PhysicsModelRegressor(CALLED)).model == CALLED
    assert CALLED != FOLLOWED
    by_table = [
        from_function(lambda t, x, u, p, s=s: [s * abs(x[0])], {"y": "V"}, trace=False)
        for s in (1.0, 2.0)
    ]
    assert by_table[0] != by_table[1]
    for model in by_table:
        assert cloudpickle.loads(cloudpickle.dumps(model)) == model


@pytest.mark.parametrize(
    "write",
    [
        lambda model: model.to_yaml(),
        lambda model: to_c(model, interval=0.01),
        lambda model: to_fmu(model, "a.fmu", interval=0.01),
        lambda model: to_onnx(network_of(model)),
        to_casadi,
        to_modelica,
    ],
    ids=["YAML", "C", "FMU", "ONNX", "CasADi", "Modelica"],
)
def test_what_needs_equations_says_so(write):
    with pytest.raises(ModelError, match=r"calls opaque functions \(called\). Remedy"):
        write(CALLED)


def network_of(model):
    X = np.column_stack([T, U])
    network = PGNNLRegressor(model, structure="correction", max_epochs=1, refine=None)
    return network.fit(X, model.simulate(T, U).y)


def test_a_system_of_python_control_calls_it():
    one, other = (to_control(model) for model in (CALLED, FOLLOWED))
    point = 0.3, np.array([0.2, -0.1]), np.array([0.4])
    np.testing.assert_allclose(one.dynamics(*point), other.dynamics(*point), atol=1e-12)
    np.testing.assert_allclose(one.output(*point), other.output(*point), atol=1e-12)
    one, other = (to_control(model, 0.02) for model in (CALLED, FOLLOWED))
    np.testing.assert_allclose(one.dynamics(*point), other.dynamics(*point), atol=1e-12)


def test_causes_that_read_equations_are_not_offered():
    # a call is linear in no parameter, and has no addend that drives it
    offered = {effect.id: effect.targets(CALLED) for effect in CATALOGUE}
    told = {effect.id: effect.targets(FOLLOWED) for effect in CATALOGUE}
    for cause in ("parameter_slope", "parameter_saturation", "load_friction"):
        assert offered[cause] == ()
    assert told["load_friction"]
    assert offered["coulomb_friction"] == told["coulomb_friction"]


@pytest.mark.slow
def test_a_diagnosis_on_two_cores_names_what_it_lacks():
    truth, rng = FOLLOWED + effects.CoulombFriction("omega", level=0.05), np.random.default_rng(0)
    rows = []
    for k in range(2):
        u = np.repeat(rng.uniform(-0.5, 0.5, 20), 10)
        t = np.arange(u.size) * 0.01
        y = truth.simulate(t, u).y[:, 0] + rng.normal(scale=1e-4, size=t.size)
        rows.append(np.column_stack([np.full(t.size, k), t, u, y]))
    table = pd.DataFrame(np.concatenate(rows), columns=["trajectory", "t", "torque", "angle"])
    candidates = ["coulomb_friction", "viscous_friction", "input_bias"]
    diagnosis = ModelDiagnosis(CALLED, catalogue=candidates, n_jobs=2)
    diagnosis.fit(table[["trajectory", "t", "torque"]], table[["angle"]])
    assert [cause.effect for cause in diagnosis.causes_] == ["coulomb_friction"]
