"""A model is a value: equal or not, never changed, and nothing of it is lost on the way."""

import copy
import math
import pickle
from dataclasses import FrozenInstanceError
from functools import partial

import joblib
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics import Parameter, PhysicsModel, effects, systems
from sklearn_pgnn.physics.spread_ends import at_spread_ends

pytestmark = pytest.mark.core

SYSTEMS = (
    systems.golf_robot(),
    systems.servo_valve(),
    systems.servo_valve(limits=True),
    systems.two_tanks(),
    systems.cart_on_spring(),
)
EXTENDED = [
    pytest.param(model, kind, target, id=f"{model.name}-{kind.id}-{target}")
    for model in SYSTEMS
    for kind in effects.CATALOGUE
    for target in kind.targets(model)
]


def cart(**changes):
    said = {
        "states": {"x": "m", "v": "m/s"},
        "inputs": {"F": "N"},
        "parameters": {"m": {"value": 2.0, "unit": "kg", "bounds": [0.1, 50]}, "k": 40.0},
        "equations": {"x": "v", "v": "(F - k*x)/m"},
    }
    return PhysicsModel(**(said | changes))


def refusal(**changes):
    with pytest.raises(ModelError) as refused:
        cart(**changes)
    return str(refused.value)


# -- a value ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", SYSTEMS, ids=lambda model: model.name)
def test_copies_are_equal(model, tmp_path):
    joblib.dump(model, tmp_path / "model")
    copies = (
        PhysicsModel.from_dict(model.to_dict()),
        pickle.loads(pickle.dumps(model)),
        joblib.load(tmp_path / "model"),
        copy.copy(model),
        copy.deepcopy(model),
        model.replace(),
        model.with_parameters(),
    )
    for same in copies:
        assert same == model
        assert hash(same) == hash(model)
        assert same.equations == model.equations
        assert list(same.parameters.values()) == list(model.parameters.values())
    assert len({model, *copies}) == 1


@pytest.mark.parametrize(("model", "kind", "target"), EXTENDED)
def test_an_extended_model_survives_pickling(model, kind, target):
    extended = model + kind(target)
    assert extended != model
    assert pickle.loads(pickle.dumps(extended)) == extended
    assert pickle.loads(pickle.dumps(extended)).equations == extended.equations


def test_a_model_without_parameters_is_one():
    model = PhysicsModel({"x": ""}, {"x": "-x"})
    assert pickle.loads(pickle.dumps(model)) == model


def test_models_that_say_the_same_are_equal_however_they_say_it():
    x, v, F, k, m = sympy.symbols("x v F k m")
    assert cart(equations={"v": (F - k * x) / m, "x": v}) == cart()
    assert cart(parameters=[Parameter("m", 2, "kg", (0.1, 50)), Parameter("k", 40)]) == cart()
    assert cart(outputs={"x": "x", "v": "v"}, name="model") == cart()


@pytest.mark.parametrize(
    "changes",
    [
        {"name": "another"},
        {"states": {"v": "m/s", "x": "m"}},
        {"states": {"x": "mm", "v": "m/s"}},
        {"inputs": {"F": "kN"}},
        {"outputs": {"x": "x"}},
        {"outputs": {"v": "v", "x": "x"}},
        {"equations": {"x": "v", "v": "(F - k*x)/m + 1e-300"}},
        {"parameters": {"k": 40.0, "m": {"value": 2.0, "unit": "kg", "bounds": [0.1, 50]}}},
        {"parameters": {"m": 2.0, "k": 40.0}},
        {"inertia": {"v": "m"}},
        {"energy": {"stored": "m*v**2/2"}},
        {"delays": {"F": "k"}},
        {"initial_state": {"x": 1e-300}},
        {"columns": {"F": "force"}},
    ],
    ids=str,
)
def test_models_that_differ_are_not_equal(changes):
    assert cart(**changes) != cart()


def test_a_model_is_equal_to_no_other_thing():
    assert cart() != "cart"
    assert (cart() == 1) is False


def test_frozen():
    model = cart()
    with pytest.raises(FrozenInstanceError):
        model.name = "mine"
    with pytest.raises(TypeError):
        model.parameters["k"] = Parameter("k", 1)
    with pytest.raises(TypeError):
        model.states["x"] = "km"
    with pytest.raises(FrozenInstanceError):
        model.parameters["k"].value = 1.0


def test_what_a_model_is_made_of_may_change_later():
    states, parameters = {"x": "m"}, {"k": 1.0}
    model = PhysicsModel(states, {"x": "-k*x"}, parameters)
    states["y"], parameters["k"] = "m", 2.0
    assert list(model.states) == ["x"]
    assert model.parameters["k"].value == 1.0


def test_with_parameters_leaves_the_original_alone():
    model, before = cart(), cart().to_dict()
    changed = model.with_parameters(k=41.0, m=Parameter("m", 3.0, fixed=True))
    assert model.to_dict() == before
    assert changed.parameters["k"] == Parameter("k", 41.0)
    assert changed.free_parameters == ("k",)
    assert changed.equations == model.equations


@given(value=st.floats(0.1, 50), low=st.floats(-1e9, 0.1), high=st.floats(50, 1e9))
def test_a_parameter_keeps_every_digit(value, low, high):
    model = cart(parameters={"m": {"value": value, "bounds": [low, high]}, "k": 1 / value})
    again = PhysicsModel.from_dict(model.to_dict())
    assert again.parameters == model.parameters
    assert again.parameters["m"] == Parameter("m", value, bounds=(low, high))


@settings(max_examples=50)
@given(st.permutations(["m", "k", "d"]), st.permutations(["x", "v"]))
def test_order_is_kept(parameters, states):
    model = PhysicsModel(
        states=dict.fromkeys(states, ""),
        parameters=dict.fromkeys(parameters, 1.0),
        equations={"x": "v", "v": "-(k*x + d*v)/m"},
    )
    again = pickle.loads(pickle.dumps(model))
    assert list(again.parameters) == parameters
    assert list(again.equations) == list(again.outputs) == list(again.states) == states


def test_an_effect_gives_a_new_model():
    model, before = cart(), cart().to_dict()
    extended = model + effects.CoulombFriction("v")
    assert model.to_dict() == before
    assert extended.to_dict() != before
    with pytest.raises(TypeError):
        model + 1


# -- what a person reads ---------------------------------------------------------------------------


def test_text_and_latex():
    assert cart().to_text() == "x' = v\nv' = (F - k*x)/m"
    assert cart().to_latex() == (
        "\\begin{aligned}\n\\dot{x} &= v \\\\\n\\dot{v} &= \\frac{F - k x}{m}\n\\end{aligned}"
    )
    assert repr(cart()) == "<PhysicsModel 'model': x, v>"


def test_units():
    model = cart(outputs={"seen": "x", "felt": "F - k*x"})
    units = {name: model.unit(name) for name in ("x", "v", "F", "m", "k", "seen", "felt")}
    assert units == {"x": "m", "v": "m/s", "F": "N", "m": "kg", "k": "", "seen": "m", "felt": ""}


def test_a_velocity_is_found_by_its_position():
    assert cart().kinematic_pairs == {"v": "x"}


# -- what a model cannot say -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"states": {}}, "expected at least one state, got none."),
        ({"states": ["x", "v"]}, "states: expected names and values, got ['x', 'v']."),
        ({"states": None}, "states: expected names and values, got None."),
        (
            {"equations": {"x": "v"}},
            "equations: the equation of state 'v' is missing.",
        ),
        (
            {"equations": {"x": "v", "v": "0", "w": "0"}},
            "equations: unknown name 'w'; expected one of x, v.",
        ),
        ({"equations": "v"}, "equations: expected names and values, got 'v'."),
        (
            {"equations": {"x": "v", "v": "F/M"}},
            "equations.v: unknown name 'M'; known names are F, k, m, v, x (column 3).",
        ),
        (
            {"equations": {"x": "v", "v": "x*sympy"}},
            "equations.v: unknown name 'sympy'; known names are F, k, m, v, x (column 3).",
        ),
        (
            {"equations": {"x": "v", "v": sympy.Symbol("q")}},
            "equations.v: unknown name 'q'; known names are F, k, m, v, x (column 1).",
        ),
        ({"outputs": {"y": "2*z"}}, "outputs.y: unknown name 'z'; known names are F, k, m, v, x"),
        (
            {"outputs": {"2y": "x"}},
            "output '2y' is not a name; use letters, digits and",
        ),
        ({"inputs": {"v": "N"}}, "input 'v': the name is taken by a state."),
        ({"parameters": {"F": 1.0}}, "parameter 'F': the name is taken by an input."),
        (
            {"states": {"x y": "m"}},
            "state 'x y' is not a name; use letters, digits and",
        ),
        ({"states": {"lambda": "m"}}, "state 'lambda' is not a name"),
        ({"states": {1: "m"}}, "state 1 is not a name"),
        ({"states": {"t": "s"}}, "state 't' is reserved; choose another name."),
        ({"inputs": {"sin": ""}}, "input 'sin' is reserved; choose another name."),
        ({"parameters": {"_k": 1.0}}, "parameter '_k' is reserved; choose another name."),
        ({"parameters": {"__class__": 1.0}}, "parameter '__class__' is reserved"),
        ({"inertia": {"w": "m"}}, "inertia: unknown name 'w'; expected one of x, v."),
        (
            {"energy": {"kinetic": "m*v**2/2"}},
            "energy: unknown name 'kinetic'; expected one of stored, supplied, dissipated.",
        ),
        ({"delays": {"x": "k"}}, "delays: unknown name 'x'; expected one of F."),
        ({"delays": {"F": "T"}}, "delays: 'F' expects a parameter, got 'T'."),
        ({"initial_state": {"q": 1.0}}, "initial_state: unknown name 'q'; expected one of x, v."),
        (
            {"initial_state": {"x": "far"}},
            "initial_state.x: expected a finite number, got 'far'.",
        ),
        (
            {"initial_state": {"x": math.nan}},
            "initial_state.x: expected a finite number, got nan.",
        ),
        (
            {"columns": {"force": "f"}},
            "columns: unknown name 'force'; expected one of t, trajectory, F, x, v.",
        ),
        ({"columns": {"F": 3}}, "columns.F: expected a column's name, got 3."),
        (
            {"columns": {"F": "x"}},
            "columns.F: the column 'x' has the name of another quantity; rename one of them.",
        ),
        (
            {"parameters": [Parameter("k", 1), Parameter("k", 2)]},
            "expected every parameter once, got the same name twice.",
        ),
        (
            {"parameters": (Parameter(name, 1) for name in "kk")},
            "expected every parameter once, got the same name twice.",
        ),
        ({"parameters": ["k"]}, "parameters: expected Parameter objects, got 'k'."),
        (
            {"parameters": {"k": Parameter("c", 1)}},
            "parameter 'c' is listed under another name, 'k'.",
        ),
        (
            {"parameters": {"k": {"val": 1}}},
            "parameter 'k': expected 'value' and optionally ['bounds', 'fixed', 'spread', 'unit'], "
            "got ['val'].",
        ),
        (
            {"parameters": {"k": {"value": 3, "bounds": [5, 9]}}},
            "parameter 'k': expected a value within its bounds [5, 9], got 3.",
        ),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_refused(changes, message):
    got = refusal(**changes)
    assert got[: len(message)] == message


def test_two_spellings_of_one_name_are_one():
    message = refusal(parameters={"\u00b5": 1.0, "\u03bc": 1.0})
    assert message == "parameter '\u03bc': the name is taken by a parameter."


def test_an_error_knows_its_entry():
    for changes, where in (
        ({"equations": {"x": "v", "v": "q"}}, ("equations", "v")),
        ({"parameters": {"k": {"value": 3, "bounds": [5, 9]}}}, ("parameters", "k")),
        ({"states": {"t": "s"}}, ("states", "t")),
        ({"delays": {"F": "T"}}, ("delays", "F")),
        ({"columns": {"q": "f"}}, ("columns", "q")),
    ):
        with pytest.raises(ModelError) as refused:
            cart(**changes)
        assert refused.value.where == where
        assert pickle.loads(pickle.dumps(refused.value)).where == where


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"states": {"x": ""}}, "equations: the equation of state 'x' is missing."),
        ({}, "expected the key 'states', got none."),
        (
            {"states": {"x": ""}, "equations": {"x": "0"}, "color": "red"},
            "unknown key 'color'; expected one of states, equations, parameters, inputs, outputs, "
            "name, inertia, forces, capacity, flows, energy, delays, initial_state, settled, "
            "columns, channels, simulation, let, ports.",
        ),
    ],
)
def test_plain_data_that_is_no_model(data, message):
    with pytest.raises(ModelError) as refused:
        PhysicsModel.from_dict(data)
    assert str(refused.value) == message


def test_with_parameters_refuses():
    with pytest.raises(ModelError, match=r"^unknown parameter 'q'; the model has m, k\.$"):
        cart().with_parameters(q=1.0)
    with pytest.raises(ModelError, match=r"'m': expected a value within its bounds \[0\.1, 50\]"):
        cart().with_parameters(m=51.0)


# -- a parameter -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"value": "a lot"}, "expected numbers for value, spread and bounds [low, high], got"),
        ({"value": None}, "expected numbers for value, spread and bounds [low, high], got None"),
        ({"value": 1, "bounds": (0,)}, "expected numbers for value, spread and bounds"),
        ({"value": 1, "bounds": 3}, "expected numbers for value, spread and bounds"),
        ({"value": math.inf}, "expected a finite value, got inf."),
        ({"value": math.nan}, "expected a finite value, got nan."),
        ({"value": 2, "bounds": (0, 1)}, "expected a value within its bounds [0, 1], got 2."),
        ({"value": 1, "bounds": (2, 0)}, "expected a value within its bounds [2, 0], got 1."),
        ({"value": 1, "bounds": (0, math.nan)}, "expected a value within its bounds [0, nan]"),
        ({"value": 1, "spread": 0}, "expected a spread > 0, got 0."),
        ({"value": 1, "spread": math.nan}, "expected a spread > 0, got nan."),
        ({"value": 1, "fixed": "no"}, "expected true or false for fixed, got 'no'."),
    ],
)
def test_a_parameter_refuses(said, message):
    with pytest.raises(ModelError) as refused:
        Parameter("J", **said)
    assert str(refused.value).startswith(f"parameter 'J': {message}")
    assert refused.value.where == ("parameters", "J")


def test_a_value_just_outside_is_told_apart_from_its_bound():
    with pytest.raises(ModelError, match=r"\[0, 1\], got 1\.0000001\.$"):
        Parameter("J", 1.0000001, bounds=(0, 1))


def test_a_parameter_is_a_value():
    assert Parameter("J", 1) == Parameter("J", 1.0, "", (-math.inf, math.inf))
    assert hash(Parameter("J", 1)) == hash(Parameter("J", 1.0))
    assert Parameter("J", 1, bounds=[0, 2]).with_value(2) == Parameter("J", 2.0, bounds=(0, 2))
    assert Parameter("J", 1, unit=None).unit == ""


def test_a_bound_on_the_rate_does_not_part_a_position_from_its_velocity():
    cart = systems.cart_on_spring()
    slow = cart + effects.RateLimit("x", limit=2.0)
    assert slow.equations["x"] != cart.equations["x"]
    assert slow.kinematic_pairs == cart.kinematic_pairs == {"v": "x"}


def tank(a=None, b=None, c=None):
    flow = partial(Parameter, value=2.0)
    parameters = {"a": a or flow("a"), "b": b or flow("b"), "c": c or flow("c")}
    return PhysicsModel({"h": "m"}, {"h": "a*u - b*h - c*h**2"}, parameters, {"u": "V"})


@pytest.mark.parametrize("value", [1.8, 2.2])
def test_either_end_counts(value):
    assert at_spread_ends(tank(), tank().with_parameters(b=value)) == ("b",)


def test_what_stays_inside_is_none():
    assert at_spread_ends(tank(), tank().with_parameters(a=2.19, b=1.81)) == ()


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        (Parameter("a", 2.0, bounds=(1.9, 2.1)), 2.1),
        (Parameter("a", 2.0, bounds=(1.8, 5.0)), 1.8),
        (Parameter("a", 2.0, bounds=(0.0, 5.0), spread=math.inf), 5.0),
        (Parameter("a", 0.0), 0.0),
    ],
    ids=["bounds within the spread", "a bound at its end", "no spread", "a share of zero"],
)
def test_an_end_that_no_spread_makes_is_none(parameter, value):
    model = tank(a=parameter)
    assert at_spread_ends(model, model.with_parameters(a=value)) == ()
