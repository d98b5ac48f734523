"""Systems of python-control behave as the simulation does."""

import control
import numpy as np
import pytest

from sklearn_pgnn import effects, systems
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export import to_control

CART = systems.cart_on_spring()
STICKING = CART + effects.CoulombFriction("v", 3.0)
STEP = 0.02
T = np.arange(500) * STEP
U = 4 * np.sin(0.7 * T) + 2 * np.sin(3.1 * T)


def respond(system, start=(0.0, 0.0), u=U, **options):
    return control.input_output_response(system, T, u, start, **options)


def test_it_has_the_names_of_the_model():
    system = to_control(systems.golf_robot(), 0.01)
    assert system.name == "golf_robot"
    assert (system.state_labels, system.input_labels) == (["phi", "omega"], ["torque"])
    assert system.output_labels == ["phi_measured"]
    assert system.dt == 0.01
    assert to_control(CART, name="cart").name == "cart"


@pytest.mark.parametrize("model", [CART, CART + effects.Hysteresis("v", 3.0, 0.02)], ids=str)
def test_the_response_is_that_of_the_simulation(model):
    start = np.zeros(len(model.states))
    found = respond(to_control(model), start, solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-10})
    expected = model.simulate(T, U, start, hold="foh", substeps=20).x
    assert np.abs(found.states.T - expected).max() < 1e-5


def test_linearised_it_is_the_exact_state_space():
    m, k, d = (CART.parameters[name].value for name in "mkd")
    linear = to_control(CART).linearize([0.1, 0.0], 0.0)
    assert np.allclose(linear.A, [[0, 1], [-k / m, -d / m]])
    assert np.allclose(linear.B, [[0], [1 / m]])
    assert np.allclose(linear.C, [[1, 0]])
    poles = control.ss(to_control(CART).linearize([0, 0], 0)).poles()
    assert np.allclose(np.abs(poles), np.sqrt(k / m))


def test_parameters_are_those_of_the_model_and_may_be_changed():
    heavy = CART.with_parameters(m=5.0)
    for interval in (None, STEP):
        changed = respond(to_control(CART, interval), params={"m": 5.0})
        assert np.allclose(changed.outputs, respond(to_control(heavy, interval)).outputs)


@pytest.mark.parametrize(
    "model",
    [
        STICKING,
        CART + effects.InputDelay("force", delay=0.05),
        CART + effects.InputDelay("force", delay=0.003),
        CART + effects.PeriodicDisturbance("v", 1.0, 0.5, 2.0),
        CART.replace(inputs={}, equations={"x": "v", "v": "-k*x/m"}, initial_state={"x": 1.0},
                     energy={}, inertia={}),
    ],
    ids=["sticks", "late", "a little late", "in time", "no input"],
)  # fmt: skip
def test_in_discrete_time_it_is_the_simulation_itself(model):
    system = to_control(model, STEP)
    start = np.zeros(len(system.state_labels))
    start[:2] = list(model.initial_state.values())
    u = U - U[0] if model.inputs else None
    found = respond(system, start, 0 if u is None else u)
    run = model.simulate(T, u)
    assert np.allclose(found.states[:2].T, run.x, rtol=0, atol=1e-10)
    assert np.allclose(found.outputs.ravel(), run.y[:, 0], rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("model", "interval", "what"),
    [
        (STICKING, None, r"'v' sticks in dry friction.*interval=0\.01"),
        (CART + effects.InputDelay("force", 0.1), None, r"'force' is delayed.*interval=0\.01"),
        (CART.replace(simulation={"hold": "foh"}), 0.01, "linearly interpolated.*'zoh'"),
    ],
)
def test_what_it_cannot_express_is_refused_with_the_remedy(model, interval, what):
    with pytest.raises(ModelError, match=what):
        to_control(model, interval)


@pytest.mark.parametrize(("model", "interval"), [("robot", None), (CART, 0), (CART, "fast")])
def test_what_is_no_model_or_no_interval_is_refused(model, interval):
    with pytest.raises(OptionError, match=r"expected (a PhysicsModel|the sample interval)"):
        to_control(model, interval)
