"""Mass matrices and capacities: the rates and mobilities of linear algebra, and write-back."""

import copy
import pickle

import numpy as np
import pytest
import sympy
from machines_in_motion import arm, numbers_of

from sklearn_pgnn.exceptions import ModelError, UnitWarning
from sklearn_pgnn.physics import PhysicsModel, effects
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.mass_matrix import MAX_COUPLED, mobility, solved_rates

pytestmark = pytest.mark.core


def symmetric(n, seed, empty=0.0):
    """A positive definite matrix, some of its entries zero, by symbols and by numbers."""
    rng = np.random.default_rng(seed)
    root = np.tril(rng.normal(size=(n, n)), -1) * (rng.random((n, n)) > empty)
    values = (root + root.T) / n + np.diag(1.0 + rng.random(n))
    values += np.diag(np.abs(values).sum(axis=1))
    names = {}
    rows = []
    for i in range(n):
        row = [symbol(f"m{min(i, j)}{max(i, j)}") if values[i, j] else 0 for j in range(n)]
        names |= {symbol(f"m{i}{j}"): values[i, j] for j in range(i, n) if values[i, j]}
        rows.append(sympy.Tuple(*row))
    return dict(zip("abcdefgh", rows, strict=False)), values, names


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("empty", [0.0, 0.7])
def test_rates_and_columns_are_those_of_linear_algebra(n, empty):
    inertia, matrix, at = symmetric(n, seed=n, empty=empty)
    forces = {name: symbol(f"f_{name}") for name in inertia}
    right = np.random.default_rng(9).normal(size=n)
    at |= dict(zip(forces.values(), right, strict=True))
    solved = solved_rates(inertia, forces)
    rates = [float(solved[name].xreplace(at)) for name in inertia]
    assert rates == pytest.approx(np.linalg.solve(matrix, right), rel=1e-9)
    inverse = np.linalg.inv(matrix)
    columns = mobility(inertia)
    for j, state in enumerate(inertia):
        got = [float(columns[state].get(name, sympy.S.Zero).xreplace(at)) for name in inertia]
        assert got == pytest.approx(inverse[:, j], rel=1e-9, abs=1e-14)


def test_blocks_that_do_not_act_on_each_other_are_solved_by_themselves():
    many = {f"v{i}": sympy.Tuple(*(symbol("m") if i == j else 0 for j in range(20)))
            for i in range(20)}  # fmt: skip
    columns = mobility({name: sympy.Tuple(*map(sympy.sympify, row)) for name, row in many.items()})
    assert columns["v7"] == {"v7": 1 / symbol("m")}


#: the published sizes, see the module: a rate of a planar arm with gravity [characters]
@pytest.mark.parametrize(("links", "longest"), [(2, 500), (3, 3500)])
def test_the_rates_of_an_arm_stay_short(links, longest):
    assert max(len(line) for line in arm(links).to_text().splitlines()) < longest


@pytest.mark.slow
def test_four_links_are_a_model_that_can_be_changed_and_copied():
    model = arm(4)
    bias = effects.InputBias("tau2", 0.3)
    extended = model + bias
    got = numbers_of(extended, list(extended.equations.values()), 0)
    assert np.all(np.isfinite(got))
    assert pickle.loads(pickle.dumps(extended)) == extended


def crane(**changes):
    said = {
        "states": {"x": "m", "q": "rad", "v": "m/s", "w": "rad/s"},
        "inputs": {"F": "N"},
        "parameters": {
            "M": {"value": 5.0, "unit": "kg"},
            "m": {"value": 2.0, "unit": "kg"},
            "l": {"value": 1.5, "unit": "m"},
            "g": {"value": 9.81, "unit": "m/s^2"},
            "d": {"value": 3.0, "unit": "N s/m"},
        },
        "equations": {"x": "v", "q": "w"},
        "inertia": {"v": ["M + m", "m*l*cos(q)"], "w": ["m*l*cos(q)", "m*l**2"]},
        "forces": {"v": "F - d*v + m*l*w**2*sin(q)", "w": "-m*g*l*sin(q)"},
    }
    return PhysicsModel(**(said | changes))


def test_the_mass_matrix_times_the_rates_is_the_forces():
    model = crane()
    for v in ("v", "w"):
        row, other = model.inertia[v], ("v", "w")
        left = sum(m * model.equations[o] for m, o in zip(row, other, strict=True))
        got, expected = numbers_of(model, (left, model.forces[v]), 3)
        assert got == pytest.approx(expected, rel=1e-10)


def test_a_single_inertia_with_a_force_is_the_equation_over_it():
    said = {"states": {"x": "m", "v": "m/s"}, "inputs": {"F": "N"}, "parameters": {"m": 2, "k": 9}}
    short = PhysicsModel(**said, equations={"x": "v"}, inertia={"v": "m"}, forces={"v": "F - k*x"})
    long = PhysicsModel(**said, equations={"x": "v", "v": "(F - k*x)/m"}, inertia={"v": "m"})
    assert short.equations == long.equations
    assert list(short.equations) == ["x", "v"]


def test_a_store_with_its_flow_is_the_equation_over_its_capacity():
    wall = PhysicsModel(
        {"T": "K", "W": "K"}, capacity={"T": "C", "W": "D"},
        flows={"T": "P - k*(T - W)", "W": "k*(T - W)"},
        inputs={"P": "W"}, parameters={"C": 2.0, "D": 30.0, "k": 0.5},
    )  # fmt: skip
    assert wall.to_text() == "T' = (P - k*(T - W))/C\nW' = k*(T - W)/D"
    assert PhysicsModel.from_dict(wall.to_dict()) == wall


def test_coupled_coils_have_a_matrix_of_inductances():
    coils = PhysicsModel(
        {"i": "A", "j": "A"}, capacity={"i": ["L", "X"], "j": ["X", "L"]},
        flows={"i": "U - R*i", "j": "-R*j"}, inputs={"U": "V"},
        parameters={"L": 2.0, "X": 1.5, "R": 3.0},
        energy={"stored": "L*(i**2 + j**2)/2 + X*i*j"},
    )  # fmt: skip
    stored = coils.energy["stored"]
    gains = sum(sympy.diff(stored, symbol(s)) * r for s, r in coils.equations.items())
    i, j, u, r = map(symbol, ("i", "j", "U", "R"))
    got, expected = numbers_of(coils, (gains, u * i - r * (i**2 + j**2)), 1)
    assert got == pytest.approx(expected, rel=1e-10)


# -- a value ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [crane(), arm(2)], ids=["crane", "arm"])
def test_rows_and_forces_come_back_from_every_copy(model, tmp_path):
    text = model.to_yaml(tmp_path / "model.yaml")
    copies = (
        PhysicsModel.from_dict(model.to_dict()),
        PhysicsModel.from_yaml(tmp_path / "model.yaml"),
        pickle.loads(pickle.dumps(model)),
        copy.copy(model),
        model.replace(),
        model.replace(equations=model.equations),
        model.with_parameters(g=1.0).with_parameters(g=9.81),
    )
    assert all(other == model and other.forces == model.forces for other in copies)
    assert "forces:" in text
    assert max(map(len, text.splitlines())) < 300


def test_another_inertia_or_force_gives_another_rate():
    model, two = crane(), {"v": ["M", 0], "w": [0, "m*l**2"]}
    assert str(model.replace(inertia=two).equations["w"]) == "-g*sin(q)/l"
    calm = model.replace(forces={"v": 0, "w": 0})
    assert calm.equations["v"] == calm.equations["w"] == 0


def test_a_changed_rate_makes_equations_of_the_forces_that_act_on_each_other():
    model = crane(
        states={"x": "m", "q": "rad", "v": "m/s", "w": "rad/s", "u": "m/s"},
        inertia={"v": ["M + m", "m*l*cos(q)"], "w": ["m*l*cos(q)", "m*l**2"], "u": "M"},
        forces={"v": "F", "w": "-m*g*l*sin(q)", "u": "-d*u"},
    )
    changed = model.replace(equations={**model.equations, "v": model.equations["v"] - symbol("g")})
    assert dict(changed.forces) == {"u": model.forces["u"]}
    assert changed.equations["w"] == model.equations["w"]
    assert PhysicsModel.from_dict(changed.to_dict()) == changed


def test_an_effect_on_an_input_acts_through_the_mass_matrix():
    model = crane()
    extended = model + effects.InputBias("F", 0.5)
    bias = {
        symbol(n): sympy.Float(p.value)
        for n, p in extended.parameters.items()
        if n not in model.parameters
    }
    shifted = {symbol("F"): symbol("F") + sympy.Float(*bias.values())}
    expected = [model.equations[v].xreplace(shifted) for v in ("v", "w")]
    got = [extended.equations[v].xreplace(bias) for v in ("v", "w")]
    assert numbers_of(model, got, 2) == pytest.approx(numbers_of(model, expected, 2), rel=1e-12)


def test_parameters_of_a_capacity_alone_are_in_use():
    store = PhysicsModel({"T": "K"}, {"T": "-T"}, {"C": 2.0, "k": 1.0}, capacity={"T": "C"})
    assert store.unused_parameters == ("k",)


# -- errors ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"inertia": {"v": ["M + m", "m*l*cos(q)"], "w": ["m*l*sin(q)", "m*l**2"]}},
            r"symmetric matrix, got l\*m\*cos\(q\) in the row of 'v' for 'w', and l\*m\*sin\(q\)"
            r" in the row of 'w' for 'v'. Remedy",
        ),
        (
            {"inertia": {"v": ["m", "m*l"], "w": ["m*l", "m*l**2"]}},
            "inertia: .* positive definite, got one that is singular.*Remedy",
        ),
        (
            {"inertia": {"v": ["M", 0], "w": [0, 0]}},
            "inertia: .* singular, mainly by 'w'.*Remedy",
        ),
        (
            {"inertia": {"v": ["M + m", "-m"], "w": ["-m", "-m*l**2"]}},
            "inertia: .* negative, mainly by 'w'.*Remedy",
        ),
        ({"inertia": {"v": ["M"], "w": ["m", "m"]}}, "inertia.v: expected a row of 2 .* 1. Remedy"),
        ({"inertia": {"v": "M"}}, "forces.w: expected what its rate is multiplied by.*Remedy"),
        ({"forces": {"v": "F"}}, "forces: 'w' is missing, on which the rate of 'v'.*Remedy"),
        (
            {"equations": {"x": "v", "q": "w", "v": "F"}},
            "equations.v: the rate follows from forces.v, and is given twice. Remedy",
        ),
        ({"forces": {}}, "equations: the equation of state 'v' is missing"),
        ({"forces": {"v": "F", "z": "F"}}, "forces: unknown name 'z'"),
        ({"capacity": {"v": "M"}}, "capacity.v: the state has an inertia already. Remedy"),
        ({"flows": {"x": "v"}}, "flows.x: expected what its rate is multiplied by.*Remedy"),
        ({"inertia": {"v": ["M", "b"], "w": ["b", "m"]}}, "inertia.v: unknown name 'b'"),
        ({"forces": ["F"]}, "forces: expected names and values"),
    ],
)
def test_what_is_no_balance_is_refused(changes, said):
    with pytest.raises(ModelError, match=said):
        crane(**changes)


def test_a_matrix_that_has_no_value_as_yet_is_not_judged():
    values = {"M": 5.0, "m": 2.0, "l": 0.0, "g": 9.81, "d": 3.0}
    rows = {"v": ["M/l", "m"], "w": ["m", "M/l"]}
    assert crane(parameters=values, inertia=rows).inertia["v"][1] == symbol("m")


def test_more_rates_than_can_be_solved_are_refused():
    n = MAX_COUPLED + 1
    row = ["m"] * n
    with pytest.raises(ModelError, match=f"at most {MAX_COUPLED} rates that act on each other"):
        PhysicsModel(
            {f"v{i}": "m/s" for i in range(n)}, parameters={"m": 1.0},
            inertia={f"v{i}": [*row[:i], "2*m", *row[i + 1 :]] for i in range(n)},
            forces=dict.fromkeys([f"v{i}" for i in range(n)], 0),
        )  # fmt: skip


def test_a_matrix_whose_inverse_would_be_too_long_is_refused():
    long = "+".join(f"sin({i}*q)" for i in range(400))
    names = [f"v{i}" for i in range(5)]
    rows = {v: [long if v == w else "1" for w in names] for v in names}
    with pytest.raises(ModelError, match=r"by short expressions, got v0, .* Remedy"):
        PhysicsModel(
            {"q": "rad"} | dict.fromkeys(names, "m/s"), {"q": "v0"}, inertia=rows,
            forces=dict.fromkeys(names, 0),
        )  # fmt: skip


FILE = """\
states: {i: A, j: A}
inputs: {U: V}
parameters:
  L: {value: 2.0, unit: H}
  X: {value: 1.5, unit: H}
  R: {value: 3.0, unit: Ohm}
capacity:
  i: [L, X]
  j: [X, L]
flows:
  i: U - R*i
  j: -R*j
"""


def test_a_file_may_have_flows_in_place_of_equations(tmp_path):
    path = tmp_path / "coils.yaml"
    path.write_text(FILE)
    assert PhysicsModel.from_yaml(path).flows["j"] == -symbol("R") * symbol("j")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[X, L]", "[R, L]", "yaml:9:3: capacity: expected a symmetric matrix"),
        ("[X, L]", "[X, {L: 2}]", "yaml:9:10: capacity.j: expected text, got names and values"),
        ("[L, X]", "[L]", "yaml:8:3: capacity.i: expected a row of 2 entries"),
        ("U - R*i", "U - R*k", "yaml:11:3: flows.i: unknown name 'k'"),
        ("  j: -R*j\n", "", "yaml:10:1: flows: 'j' is missing"),
    ],
)
def test_an_error_in_the_file_has_its_place(tmp_path, old, new, said):
    path = tmp_path / "coils.yaml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(ModelError, match=said):
        PhysicsModel.from_yaml(path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "X: {value: 1.5, unit: H}",
            "X: {value: 1.5, unit: Ohm}",
            ":8:3: capacity.i: the term X is",
        ),
        ("-R*j", "-j", ":12:3: flows.j: the term -j is in A, expected"),
    ],
)
def test_units_of_a_balance_are_checked(tmp_path, old, new, said):
    path = tmp_path / "coils.yaml"
    path.write_text(FILE.replace(old, new))
    with pytest.warns(UnitWarning, match=said):
        PhysicsModel.from_yaml(path)
