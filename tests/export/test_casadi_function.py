"""Functions of CasADi give the numbers of the simulation."""

import numpy as np
import pytest
from rubbing_machines import stacked_blocks

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export import to_casadi

CART = systems.cart_on_spring()
STICKING = CART + effects.CoulombFriction("v", 2.0)
STEP = 0.02
T = np.arange(400) * STEP
U = 4 * np.sin(0.7 * T) + 2 * np.sin(3.1 * T)


def run(function, model, straight=False):
    """Step a function along the input."""
    x = np.zeros(function.size1_in(0))
    x[: len(model.states)] = list(model.initial_state.values())
    states, outputs = [], []
    for k, t in enumerate(T):
        u = [U[k]] if model.inputs else []
        ahead = [[U[min(k + 1, len(U) - 1)]]] if straight else []
        following, y = function(x, u, *ahead, [], t)
        states.append(x[: len(model.states)])
        outputs.append(y.full().ravel())
        x = following.full().ravel()
    return np.array(states), np.array(outputs)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize(
    "model",
    [
        CART,
        CART + effects.Hysteresis("v", 3.0, 0.02),
        CART + effects.InputSaturation("force", 2.0),
        CART + effects.PeriodicDisturbance("v", 1.0, 0.5, 2.0),
        CART + effects.InputDelay("force", 0.05),
        PhysicsModel(
            {"x": "m"},
            {"x": "sign(sin(t)) - x - floor(3*x)/9 + atan2(x, 2) + abs(x)**1.5*pi/50 + exp(1)"},
        ),
    ],
    ids=["plain", "hysteresis", "saturation", "in time", "late", "functions"],
)
def test_the_next_sample_is_that_of_the_simulation(model, hold):
    model = model.replace(simulation={"hold": hold, "substeps": 2})
    straight = bool(model.inputs) and hold == "foh"
    states, outputs = run(to_casadi(model, STEP), model, straight)
    expected = model.simulate(T, U if model.inputs else None)
    assert np.allclose(states, expected.x, rtol=0, atol=1e-11)
    assert np.allclose(outputs, expected.y, rtol=0, atol=1e-11)


def test_rates_and_their_derivatives_are_exact():
    rates = to_casadi(CART, free=("k",))
    jacobian = rates.jacobian()
    m, k, d = (CART.parameters[name].value for name in "mkd")
    parts = jacobian([0.3, 0.0], [1.0], [k], 0.0, [], [])
    assert np.allclose(rates([0.3, 0.2], [1.0], [7.0], 0)[0].full()[1], (1 - 2.1 - 0.2 * d) / m)
    assert np.allclose(parts[0].full(), [[0, 1], [-k / m, -d / m]])
    assert rates.name_in() == ["x", "u", "p", "t"]
    assert rates.name_out() == ["rate", "y"]


def test_dry_friction_is_rounded_off_over_the_width():
    exact = STICKING.simulate(T, U).x
    errors = []
    for width in (0.1, 0.01):
        function = to_casadi(STICKING, STEP, friction_width=width, substeps=50)
        errors.append(np.abs(run(function, STICKING)[0] - exact).max())
    assert errors[1] < 0.3 * errors[0] < 0.3 * np.abs(exact).max()


@pytest.mark.parametrize(
    ("model", "what"),
    [
        (STICKING, r"'v' has dry friction.*friction_width=0\.01"),
        (CART + effects.InputDelay("force", 0.1), r"'force' is delayed.*interval=0\.01"),
    ],
)
def test_what_it_cannot_express_is_refused_with_the_remedy(model, what):
    with pytest.raises(ModelError, match=what):
        to_casadi(model)


@pytest.mark.parametrize(
    ("model", "options", "what"),
    [
        ("robot", {}, "expected a PhysicsModel"),
        (CART, {"interval": 0}, "expected the sample interval"),
        (CART, {"free": ("q",)}, "'q' is no parameter"),
        (STICKING, {"friction_width": 0.0}, "expected a speed above 0"),
        (CART, {"interval": 0.1, "substeps": 0}, "expected an integer"),
    ],
)
def test_options_that_are_none_are_refused(model, options, what):
    with pytest.raises(OptionError, match=what):
        to_casadi(model, **options)


def test_friction_between_two_bodies_is_rounded_off_over_their_difference():
    rate = to_casadi(stacked_blocks(), friction_width=0.01)([0.02, 0.01], [5.0], [], 0.0)[0]
    between, below = 3.0 * np.tanh(1.0), np.tanh(1.0)
    expected = [5.0 - between, (between - below) / 2]
    assert rate.full().ravel() == pytest.approx(expected, rel=1e-12)
