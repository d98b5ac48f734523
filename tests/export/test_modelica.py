"""The text of Modelica says what the model says, as another reader understands it."""

import casadi
import numpy as np
import pymoca.parser
import pytest
from pymoca.backends.casadi.api import transfer_model
from rubbing_machines import stacked_blocks

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export import to_casadi, to_modelica

CART = systems.cart_on_spring()
TANKS = systems.two_tanks() + effects.Overflow("x1", limit=7.0, steepness=1.0, share=0.6)
ODD = PhysicsModel(
    {"der": "m", "time": ""},
    {"der": "-der**3/(1 + exp(-μ))**2 + max(der, time, t, 0.1)", "time": "sqrt(abs(u)) - time*pi"},
    {"μ": 0.3, "end": 1e-9},
    {"u": 'a"b'},
    outputs={"der": "der + end*tanh(u)", "model": "(1 + time**2)**(-2)"},
    name="model",
)


def residual(model, folder, monkeypatch, x, u, t):
    """Return rates and outputs as pymoca reads them."""
    # pymoca asks CasADi for an operator under its name in Python 2
    monkeypatch.setattr(casadi.MX, "__div__", casadi.MX.__truediv__, raising=False)
    text = to_modelica(model, name="exported")
    (folder / "exported.mo").write_text(text, encoding="utf-8")
    read = transfer_model(str(folder), "exported", {})
    rates = [state.symbol for state in read.der_states]
    values = {p.symbol.name(): p.value for p in read.parameters}
    given = {s.symbol.name(): value for s, value in zip(read.states, x, strict=True)}
    given |= {s.symbol.name(): value for s, value in zip(read.inputs, u, strict=True)}
    known = casadi.symvar(casadi.veccat(*read.equations))
    seen = [s for s in known if s.name() in {str(o) for o in read.outputs}]
    unknown = casadi.veccat(*rates, *seen)
    numbers = {**values, **given, "time": t}
    others = [s for s in known if s.name() in numbers]
    equations = casadi.veccat(*read.equations)
    matrix = casadi.jacobian(equations, unknown)
    solved = -casadi.solve(matrix, casadi.substitute(equations, unknown, 0))
    function = casadi.Function("solved", others, [solved])
    return function(*(numbers[s.name()] for s in others)).full().ravel()


@pytest.mark.parametrize(
    "model", [CART, TANKS, ODD, CART + effects.Hysteresis("v", 3.0, 0.02)], ids=lambda m: m.name
)
def test_another_reader_finds_the_same_rates_and_outputs(model, tmp_path, monkeypatch):
    random = np.random.default_rng(0)
    for t in (0.0, 2.0):
        x, u = random.uniform(0.1, 2, len(model.states)), random.uniform(0.1, 2, len(model.inputs))
        found = residual(model, tmp_path, monkeypatch, x, u, t)
        expected = [part.full().ravel() for part in to_casadi(model)(x, u, [], t)]
        assert np.allclose(found, np.concatenate(expected), rtol=1e-12)


@pytest.mark.parametrize(
    "effect",
    [effects.InputDelay("force", 0.05), effects.ActuatorLag("force", 0.1)],
    ids=lambda effect: effect.id,
)
def test_late_and_settled_inputs_are_text_that_can_be_parsed(effect):
    text = to_modelica(CART + effect)
    assert pymoca.parser.parse(text) is not None
    late, settled = "delay(force, tau_force)", "initial equation\n  force_lagged = force;"
    assert (late in text) != (settled in text)


def test_dry_friction_is_rounded_off_or_refused():
    robot = systems.golf_robot()
    with pytest.raises(ModelError, match=r"'omega' sticks in dry friction.*to_fmu"):
        to_modelica(robot)
    text = to_modelica(robot, friction_width=0.01)
    assert "tanh(100.0*omega)" in text
    assert pymoca.parser.parse(text) is not None
    with pytest.raises(OptionError, match="a speed above 0"):
        to_modelica(robot, friction_width=-1.0)


def test_friction_between_two_bodies_is_rounded_off_over_their_difference():
    text = to_modelica(stacked_blocks(), friction_width=0.01)
    assert text.count("tanh(100.0*v1 - 100.0*v2)") == 2
    with pytest.raises(ModelError, match="'v2' sticks in dry friction"):
        to_modelica(stacked_blocks())


def test_what_is_no_model_is_refused():
    with pytest.raises(OptionError, match="expected a PhysicsModel"):
        to_modelica("robot")
