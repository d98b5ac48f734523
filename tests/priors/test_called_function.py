"""A function that cannot be followed is a model, too: slower, and no worse."""

import math
import pickle

import cloudpickle
import numpy as np
import pytest
from sklearn.base import clone

from sklearn_pgnn import PhysicsModelRegressor, effects
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.export import to_c, to_casadi, to_modelica
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
        to_casadi,
        to_modelica,
    ],
)
def test_what_needs_equations_says_so(write):
    with pytest.raises(ModelError, match=r"calls called, a function without one. Remedy"):
        write(CALLED)
