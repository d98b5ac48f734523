"""Model files: what goes out comes in again, and every error has its line and column."""

import math
import os
import re
from collections import defaultdict

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sklearn_pgnn.exceptions import ModelError, ModelWarning, UnitWarning
from sklearn_pgnn.physics import Parameter, PhysicsModel, systems
from sklearn_pgnn.physics.effect import Scales
from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.physics.model_file import MAX_BYTES, read_model, write_model

pytestmark = pytest.mark.core

CART = """\
name: cart
states: {x: m, v: m/s}
inputs: {F: N}
parameters:
  m: {value: 2.0, unit: kg, bounds: [0.1, 50]}
  k: 40
equations:
  x: v
  v: "(F - k*x)/m"
"""


@pytest.fixture
def file(tmp_path):
    return tmp_path / "model.yaml"


def read(file, text):
    file.write_text(text, encoding="utf-8")
    return read_model(file)


def refusal(file, text):
    """Return the error's text after the file's name."""
    with pytest.raises(ModelError) as caught:
        read(file, text)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{file}:")
    return message.removeprefix(f"{file}:")


# -- what comes back -------------------------------------------------------------------------------


def base_models():
    return [systems.golf_robot(), systems.servo_valve(True)]


def extensions():
    """Yield every effect on every target; they are built in the tests, for that takes long."""
    for model in base_models():
        for effect in CATALOGUE:
            for target in effect.targets(model):
                yield pytest.param(model, effect, target, id=f"{model.name}-{effect.id}-{target}")


@pytest.mark.parametrize("model", base_models(), ids=lambda model: model.name)
def test_a_system_comes_back_equal(model, file):
    assert model.to_yaml(file) == file.read_text(encoding="utf-8")
    assert PhysicsModel.from_yaml(file) == model


@pytest.mark.parametrize(("model", "effect", "target"), list(extensions()))
def test_an_extended_model_comes_back_equal(model, effect, target, file):
    ones = defaultdict(lambda: 1.0)
    scales = Scales(ones, ones, ones, sample_time=0.01, window=0.5)
    extended = model + effect.starts(target, model, scales)[0]
    extended.to_yaml(file)
    assert PhysicsModel.from_yaml(file) == extended


numbers = st.floats(allow_nan=False, allow_infinity=False)
texts = st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), max_size=20)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(numbers, numbers, texts, texts, st.floats(1e-6, math.inf), st.booleans())
def test_every_number_and_text_comes_back(tmp_path_factory, a, b, name, unit, spread, fixed):
    parameter = Parameter("p", a, unit, (min(a, b), math.inf), fixed, spread)
    model = PhysicsModel(
        {"x": unit}, {"x": "-p*x"}, [parameter], name=name or "model", initial_state={"x": b}
    )
    file = tmp_path_factory.getbasetemp() / "drawn.yaml"
    model.to_yaml(file)
    assert PhysicsModel.from_yaml(file) == model


def test_every_part_comes_back(file):
    model = PhysicsModel(
        name="all: of #it",
        states={"y": "m", "n": "", "null": "1"},
        inputs={"u": "N m", "no": "%"},
        outputs={"seen": "y + u", "on": "2*n"},
        parameters={"m": Parameter("m", 2, "kg", (-math.inf, 3)), "late": 0.1},
        equations={"y": "n", "n": "u/m - no", "null": "-null"},
        inertia={"n": "2*m"},
        energy={"stored": "m*n**2/2", "supplied": "u*n", "dissipated": "0"},
        delays={"u": "late"},
        initial_state={"y": -1e-7},
        columns={"u": "tau_cmd [N m]", "t": "Time"},
    )
    assert read(file, write_model(model)) == model
    assert read_model(file).columns["t"] == "Time"


def test_it_is_written_as_a_person_would():
    model = PhysicsModel(
        name="golf robot",
        states={"phi": "rad", "omega": "rad/s"},
        inputs={"torque": "N m"},
        outputs={"phi_measured": "phi"},
        parameters=[Parameter("J", 0.1445, "kg m^2", (0.01, 1)), Parameter("g", 9.81, fixed=True)],
        equations={"phi": "omega", "omega": "(torque - g*sin(phi))/J"},
        inertia={"omega": "J"},
        columns={"torque": "tau_cmd"},
    )
    assert model.to_yaml() == (
        "version: 1\n"
        "name: golf robot\n"
        "states: {phi: rad, omega: rad/s}\n"
        "inputs: {torque: N m}\n"
        "outputs: {phi_measured: phi}\n"
        "parameters:\n"
        "  J: {value: 0.1445, unit: kg m^2, bounds: [0.01, 1.0]}\n"
        "  g: {value: 9.81, fixed: true}\n"
        "equations:\n"
        "  phi: omega\n"
        '  omega: "(-g*sin(phi) + torque)/J"\n'
        "inertia: {omega: J}\n"
        "columns: {torque: tau_cmd}\n"
    )


# -- what may be written ---------------------------------------------------------------------------


def test_a_file_says_what_the_constructor_says(file):
    assert read(file, CART) == PhysicsModel(
        name="cart",
        states={"x": "m", "v": "m/s"},
        inputs={"F": "N"},
        parameters={"m": Parameter("m", 2, "kg", (0.1, 50)), "k": 40},
        equations={"x": "v", "v": "(F - k*x)/m"},
    )


def test_states_inputs_and_outputs_may_be_lists(file):
    model = read(file, "states: [x, v]\ninputs: [F]\noutputs: [x]\nequations: {x: v, v: F}\n")
    assert dict(model.states) == {"x": "", "v": ""}
    assert dict(model.inputs) == {"F": ""}
    assert list(model.outputs) == ["x"]


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("1e-3", 1e-3),
        ("'1e-3'", 1e-3),
        ('"0.001"', 1e-3),
        ("1E3", 1e3),
        ("+5", 5),
        ("{value: 1e-3}", 1e-3),
        ("{value: '2.5', bounds: ['1e-3', .inf]}", 2.5),
        ("{value: -1, bounds: [-.inf, 0.]}", -1),
    ],
)
def test_a_number_may_be_written_in_any_way(file, written, value):
    model = read(file, f"states: {{x: m}}\nequations: {{x: -p}}\nparameters:\n  p: {written}\n")
    assert model.parameters["p"].value == value


def test_empty_sections_and_units_are_none(file):
    model = read(file, "states: {x: , v: ~}\ninputs:\nequations: {x: v, v: 0}\ncolumns: {}\n")
    assert dict(model.states) == {"x": "", "v": ""}


def test_a_byte_order_mark_and_comments_are_skipped(file):
    file.write_text("# a cart\n" + CART, encoding="utf-8-sig")
    assert read_model(str(file)).name == "cart"


def test_spread_and_fixed_are_read(file):
    parameter = read(
        file,
        "states: [x]\nequations: {x: p}\nparameters: {p: {value: 1, spread: .inf, fixed: True}}",
    ).parameters["p"]
    assert parameter.spread == math.inf
    assert parameter.fixed is True


# -- what is refused -------------------------------------------------------------------------------


def cart_with(old, new):
    assert old in CART
    return CART.replace(old, new)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "(F - k*x)/m",
            "(F - k*q)/m",
            "9:3: equations.v: unknown name 'q'; known names are F, k, m, v, x (column 8).",
        ),
        ("(F - k*x)/m", "__import__('os')", "9:3: equations.v: '__import__' is not one of the"),
        ("(F - k*x)/m", "F.real", "9:3: equations.v: 'F.real' is not allowed"),
        ("x: v\n", "x: v +\n", "8:3: equations.x: 'v +' is not an arithmetic expression"),
        ("x: v\n", "x:\n", "8:3: equations.x: expected text, got nothing."),
        ("x: v\n", "x: [v]\n", "8:6: equations.x: expected text, got a list."),
        ("x: v\n", "", "7:1: equations: the equation of state 'x' is missing."),
        ("x: v\n", "x: v\n  w: 1\n", "9:3: equations: unknown name 'w'; expected one of x, v."),
        (
            "value: 2.0",
            "value: 200",
            "5:3: parameter 'm': expected a value within its bounds [0.1, 50], got 200.",
        ),
        ("value: 2.0", "value: two", "5:14: parameters.m.value: expected a number, got 'two'."),
        ("value: 2.0", "value: true", "5:14: parameters.m.value: expected a number, got 'true'."),
        ("value: 2.0", "value: .nan", "5:3: parameter 'm': expected a finite value, got nan."),
        ("value: 2.0, ", "", "5:3: parameters.m: expected a value, got none."),
        ("k: 40", "k: stiff", "6:6: parameters.k: expected a number, got 'stiff'."),
        ("k: 40", "k:", "6:3: parameters.k: expected a number, got nothing."),
        ("k: 40", "k: [40]", "6:6: parameters.k: expected a number, got a list."),
        ("k: 40", "F: 40", "6:3: parameter 'F': the name is taken by an input."),
        ("k: 40", "sin: 40", "6:3: parameter 'sin' is reserved; choose another name."),
        ("k: 40", "_k: 40", "6:3: parameter '_k' is reserved; choose another name."),
        ("k: 40", "k-1: 40", "6:3: parameter 'k-1' is not a name; use letters, digits and"),
        ("k: 40", "m: 40", "6:3: 'm' is here twice; first in line 5."),
        (
            "unit: kg",
            "units: kg",
            "5:19: parameters.m: unknown key 'units'; expected value, unit, bounds, fixed, spread.",
        ),
        ("[0.1, 50]", "[0.1]", "5:37: parameters.m.bounds: expected [low, high], got 1 numbers."),
        ("[0.1, 50]", "[a, 50]", "5:38: parameters.m.bounds: expected a number, got 'a'."),
        ("[0.1, 50]", "50", "5:37: parameters.m.bounds: expected a list, got '50'."),
        ("unit: kg", "fixed: 1", "5:26: parameters.m.fixed: expected true or false, got '1'."),
        ("unit: kg", "spread: 0", "5:3: parameter 'm': expected a spread > 0, got 0."),
        ("name: cart", "title: cart", "1:1: unknown key 'title'; expected name, states, inputs,"),
        ("name: cart", "name: cart\nversion: 2", "2:10: version: expected 1, got '2'. Remedy: a"),
        ("name: cart", "name: [cart]", "1:7: name: expected text, got a list."),
        ("name: cart", "name: cart\nname: c", "2:1: 'name' is here twice; first in line 1."),
        ("{F: N}", "{F: N, F: kN}", "3:16: 'F' is here twice; first in line 3."),
        ("{F: N}", "[F, F]", "3:13: 'F' is here twice."),
        ("{F: N}", "F", "3:9: inputs: expected names and values, got 'F'."),
        ("{F: N}", "{[F]: N}", "3:10: expected a name, got a list."),
        ("{F: N}", "{t: N, F: N}", "3:10: input 't' is reserved; choose another name."),
        ("{F: N}", "{F: !!python/name:os.system ''}", "3:10: inputs.F: expected a unit, got"),
        (
            "{F: N}",
            "!!python/object:os.system {}",
            "3:9: inputs: expected names and values, got the tag",
        ),
        ("{F: N}", "{F: &n N, G: *n}", "3:13: inputs.G: expected a unit, got an alias."),
        ("{x: m, v: m/s}", "{x: m, v: m/s", "3:7: expected YAML: "),
        ("{x: m, v: m/s}", "", "2:1: expected 'states', got none."),
        ("inputs:", "inputs: {F: N}\ndelays: {F: late}\n#", "4:10: delays: 'F' expects a param"),
        (
            "inputs:",
            "delays: {G: m}\ninputs:",
            "3:10: delays: unknown name 'G'; expected one of",
        ),
        ("inputs:", "inertia: {w: m}\ninputs:", "3:11: inertia: unknown name 'w'; expected one"),
        ("inputs:", "inertia: {v: q}\ninputs:", "3:11: inertia.v: unknown name 'q'; known names"),
        (
            "inputs:",
            "energy: {lost: m}\ninputs:",
            "3:10: energy: unknown name 'lost'; expected",
        ),
        ("inputs:", "outputs: {y: q}\ninputs:", "3:11: outputs.y: unknown name 'q'; known names"),
        ("inputs:", "outputs: {_y: x}\ninputs:", "3:11: output '_y' is reserved; choose another"),
        ("inputs:", "columns: {G: g}\ninputs:", "3:11: columns: unknown name 'G'; expected one of"),
        ("inputs:", "columns: {F: v}\ninputs:", "3:11: columns.F: the column 'v' has the name of"),
        (
            "inputs:",
            "initial_state: {x: .inf}\ninputs:",
            "3:20: initial_state.x: expected a finite number, got inf.",
        ),
        ("inputs:", "initial_state: {w: 1}\ninputs:", "3:17: initial_state: unknown name 'w';"),
        ("equations:", "energy:", "1:1: expected 'equations', got none."),
    ],
)
def test_an_error_has_its_line_and_column(file, old, new, said):
    message = refusal(file, cart_with(old, new))
    assert message.startswith(said), message


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "1:1: expected a model, got an empty file."),
        ("# nothing\n", "1:1: expected a model, got an empty file."),
        ("3\n", "1:1: expected a model, got '3'."),
        ("t,F\n" + "0.1,2\n" * 99, "1:1: expected a model, got 't,F " + "0.1,2 " * 9 + "0. ...'."),
        ("- a\n", "1:1: expected a model, got a list."),
        ("a: b\n---\nc: d\n", "2:1: expected YAML: but found another document."),
        ("a: [b\n", "2:1: expected YAML: "),
        ("a: *b\n", "1:4: expected YAML: found undefined alias 'b'."),
        ("a: \x01\n", "1:1: expected YAML: ReaderError."),
        ("[" * 3000, "1:1: expected YAML: RecursionError."),
        ("&a [*a]\n", "1:1: expected a model, got a list."),
        ("a: 1\n#" + MAX_BYTES * "-", f"1:1: expected at most {MAX_BYTES} bytes, got more."),
    ],
    ids=range(12),
)
def test_what_is_no_model_file_is_refused(file, text, said):
    assert refusal(file, text) == said or refusal(file, text).startswith(said)


def test_bytes_that_are_no_text_are_refused(file):
    file.write_bytes(b"name: cart\nstates: \xff\xfe\n")
    with pytest.raises(ModelError, match=re.escape(f"{file}:2:1: expected text in UTF-8, got")):
        read_model(file)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(ModelError, match=r"none\.yaml:1:1: expected a model file, got: No such"):
        read_model(tmp_path / "none.yaml")
    with pytest.raises(ModelError, match=r":1:1: expected a model file, got: Is a directory"):
        read_model(tmp_path)


def test_no_tag_makes_an_object(file, tmp_path):
    made = tmp_path / "made"
    refusal(file, f"name: !!python/object/apply:os.mkdir ['{made}']\n")
    assert not made.exists()


def test_nothing_half_written_is_left(file, monkeypatch):
    file.write_text("before")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        systems.golf_robot().to_yaml(file)
    assert file.read_text() == "before"
    assert os.listdir(file.parent) == [file.name]


# -- small files with large demands ----------------------------------------------------------------


def changed(**parts):
    """Return a model file with some parts changed."""
    whole = {
        "states": "{x: m, v: m/s}",
        "inputs": "{F: N}",
        "parameters": "{m: {value: 2.0, unit: kg}}",
        "equations": '{x: v, v: "F/m"}',
    }
    return "".join(f"{part}: {text}\n" for part, text in {**whole, **parts}.items())


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (
            {"equations": '{x: v, v: "((x+v+1)**99+(x-v)**99)**99"}'},
            ":4:19: equations.v: expected an exponent of at most 100, got 9801 (column 1).",
        ),
        (
            {"simulation": "{substeps: 1000000000}"},
            ":5:14: simulation.substeps: expected an integer >= 1 and <= 10000, got 1000000000.",
        ),
        ({"simulation": f"{{substeps: 1{'0' * 30}}}"}, "expected an integer >= 1 and <= 10000"),
        ({"inertia": "{v: 0}"}, ":5:11: inertia.v: expected what a force is divided by, got zero."),
        ({"inertia": "{v: m - m}"}, "inertia.v: expected what a force is divided by, got zero."),
        ({"name": r'"\uD800"'}, ":5:7: name: expected text, got the half of a character."),
        ({"columns": r'{F: "\uDFFF"}'}, "expected text, got the half of a character."),
        ({"name": "n" * 1001}, "name: expected at most 1000 characters, got 1001."),
        ({"inputs": f"{{{'F' * 101}: N}}"}, "expected a name of at most 100 characters, got 101."),
        (
            {"parameters": "{" + ", ".join(f"q{i}: 1" for i in range(25_000)) + "}"},
            "expected at most 50000 derivatives of states by states and parameters, got 50004 "
            "(2 states, 25000 parameters). Remedy: write constants as numbers",
        ),
    ],
)
def test_what_would_take_memory_or_time_or_break_later_is_refused(tmp_path, parts, said):
    path = tmp_path / "model.yaml"
    path.write_text(changed(**parts))
    with pytest.raises(ModelError, match=re.escape(said)):
        PhysicsModel.from_yaml(path)


def test_doubts_about_a_model_are_told_with_their_line(tmp_path):
    pytest.importorskip("pint")
    path = tmp_path / "model.yaml"
    path.write_text(
        changed(
            parameters="\n  m: {value: 2.0, unit: kg}\n  spare: 1.0\n  tau: {value: 1, unit: €€((}",
            delays="{F: tau}",
        )
    )
    with pytest.warns(ModelWarning) as told:
        PhysicsModel.from_yaml(path)
    assert [str(warning.message) for warning in told] == [
        f"{path}:5:3: parameters.spare: no equation uses it. Remedy: write it into an equation, or "
        f"leave it out.",
        f"{path}:6:3: parameters.tau: the unit '€€((' is unknown, and is not checked. Remedy: "
        f"correct it, or leave it out.",
    ]
    assert told[1].category is UnitWarning


def test_many_doubts_of_one_entry_are_a_few_and_a_number(file):
    terms = "+".join(f"sin({i}*x)" for i in range(2, 32))
    text = f"states: {{x: m}}\nequations: {{x: {terms}}}\n"
    with pytest.warns(UnitWarning) as told:
        read(file, text)
    assert len(told) < 10
    assert "equations.x: 55 more of this kind. Remedy: correct the term" in str(told[-1].message)
