"""The ports of coordinates and stores: columns of the inverse mass matrix, kept as forces."""

import numpy as np
import pytest
import sympy
from machines_in_motion import arm, cart_pole, numbers_of, three_masses

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics import PhysicsModel, effects
from sklearn_pgnn.physics.expressions import parse_expression, symbol

pytestmark = pytest.mark.core

EFFORT = sympy.Float(0.7)


@pytest.mark.parametrize("model", [cart_pole(), arm(2), arm(3)], ids=["cart-pole", "2R", "3R"])
def test_a_port_is_a_column_of_the_inverse_mass_matrix(model):
    velocities = list(model.inertia)
    matrix = numbers_of(model, [e for row in model.inertia.values() for e in row], 4)
    inverse = np.linalg.inv(matrix.reshape(len(velocities), -1))
    for j, (name, position) in enumerate(
        zip(velocities, model.kinematic_pairs.values(), strict=False)
    ):
        port = model.port(name)
        column = numbers_of(model, [port.rates[v] for v in velocities], 4)
        assert column == pytest.approx(inverse[:, j], rel=1e-9)
        assert (str(port.flow), port.position) == (name, position)
        assert float(numbers_of(model, [port.mobility], 4)[0]) > 0.0


def test_ports_of_an_arm_have_torques_and_a_trolley_a_force():
    crane = PhysicsModel(
        {"x": "m", "q": "rad", "v": "m/s", "w": "rad/s"}, {"x": "v", "q": "w"},
        {n: {"value": 2.0, "unit": u} for n, u in (("m", "kg"), ("l", "m"))},
        inertia={"v": ["3*m", "m*l*cos(q)"], "w": ["m*l*cos(q)", "m*l**2"]},
        forces={"v": 0, "w": 0},
    )  # fmt: skip
    assert crane.port("w").unit == "N m"
    assert crane.port("v").flow == symbol("v")


def explicit(model):
    """Return the same machine by its equations."""
    return model.replace(forces={}, equations=model.equations)


@pytest.mark.parametrize("model", [cart_pole(), arm(2), three_masses()])
def test_an_effort_at_a_port_is_the_same_with_forces_and_with_equations(model):
    name = list(model.inertia)[1]
    port = model.port(name)
    moved = model.replace(**port.act(model, EFFORT))
    told = explicit(model).replace(**port.act(explicit(model), EFFORT))
    assert moved.forces[name] == model.forces[name] - EFFORT
    assert not told.forces
    got, expected = (numbers_of(m, m.equations.values(), 1) for m in (moved, told))
    assert got == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("model", [cart_pole(), arm(2), three_masses()])
def test_an_effect_that_leaves_the_forces_out_finds_the_same_rates(model):
    name = list(model.inertia)[1]
    changes = model.port(name).act(model, EFFORT)
    moved, told = model.replace(**changes), model.replace(equations=changes["equations"])
    assert name not in told.forces
    got, expected = (numbers_of(m, m.equations.values(), 1) for m in (moved, told))
    assert got == pytest.approx(expected, rel=1e-10)


def between(model, flow):
    """Declare a port between the first two velocities by its rates."""
    one, other = (model.port(w).rates for w in ("w1", "w2"))
    rates = {v: one[v] - other[v] for v in model.inertia}
    return model.replace(ports={"gear": {"flow": flow, "rates": rates}})


def test_an_effort_between_two_coordinates_enters_both_forces():
    model = between(arm(2), "w1 - w2")
    port = model.port("gear")
    moved = model.replace(**port.act(model, EFFORT))
    assert moved.forces["w1"] == model.forces["w1"] - EFFORT
    assert moved.forces["w2"] == model.forces["w2"] + EFFORT
    told = explicit(model)
    expected = told.replace(**port.act(told, EFFORT))
    assert numbers_of(moved, moved.equations.values(), 1) == pytest.approx(
        numbers_of(expected, expected.equations.values(), 1), rel=1e-9
    )


def test_an_effort_between_a_force_and_an_equation_enters_both():
    masses = three_masses()
    rates = {**masses.equations, "v2": masses.equations["v2"] + 0}
    mixed = masses.replace(
        equations=rates,
        forces={v: masses.forces[v] for v in ("v1", "v3")},
        ports={"spring": {"flow": "v1 - v2"}},
    )
    assert "v2" not in mixed.forces
    moved = mixed.replace(**mixed.port("spring").act(mixed, EFFORT))
    changes = [moved.equations[v] - mixed.equations[v] for v in ("v1", "v2")]
    m1, m2 = (masses.parameters[m].value for m in ("m1", "m2"))
    got = numbers_of(masses, changes, 2)
    assert got == pytest.approx([-0.7 / m1, 0.7 / m2], rel=1e-9)


def test_a_port_whose_rates_are_not_those_of_its_flow_acts_in_the_equations():
    model = between(arm(2), "w1 + w2")
    port = model.port("gear")
    moved, told = model.replace(**port.act(model, EFFORT)), explicit(model)
    expected = told.replace(**port.act(told, EFFORT))
    assert not moved.forces
    assert moved.equations == expected.equations


def test_an_effort_that_stands_in_the_forces_is_a_port():
    """An undriven elbow, by its torque among the forces of a Lagrangian."""
    elbow = {"effort": "stiction", "flow": "w2", "displacement": "q2"}
    said = arm(2).to_dict()
    said["forces"]["w2"] += " + stiction"
    model = PhysicsModel.from_dict({**said, "ports": {"elbow": elbow}})
    assert "w2" not in model.ports
    assert not model.forces["w2"].has(symbol("stiction"))
    plain = arm(2).port("w2").rates
    got, expected = (numbers_of(arm(2), r.values(), 2) for r in (model.port("elbow").rates, plain))
    assert got == pytest.approx(expected, rel=1e-12)
    moved = model.replace(**model.port("elbow").act(model, EFFORT))
    assert moved.forces["w2"] == model.forces["w2"] - EFFORT


def test_shared_subexpressions_stand_in_a_lagrangian_and_in_rows():
    let = {"h": "m*l*cos(q)", "turn": "l*w"}
    said = cart_pole().to_dict()
    said["inertia"] = {"v": ["M + m", "h"], "w": ["h", "m*l**2"]}
    assert PhysicsModel.from_dict({**said, "let": let}) == cart_pole()
    same = cart_pole(let=let, kinetic="M*v**2/2 + m*((v + turn*cos(q))**2 + (turn*sin(q))**2)/2")
    assert same == cart_pole()


FRICTION = effects.CoulombFriction


def test_friction_at_a_joint_keeps_the_mass_matrix_and_comes_back_from_a_file(tmp_path):
    model = arm(3) + FRICTION("w2", 0.3)
    text = model.to_yaml(tmp_path / "arm.yaml")
    assert "sign(w2)" in str(model.forces["w2"])
    assert "sign" not in str(model.forces["w1"])
    assert PhysicsModel.from_yaml(tmp_path / "arm.yaml") == model
    assert max(map(len, text.splitlines())) < 800


def test_a_port_of_a_mass_matrix_is_written_without_its_rates(tmp_path):
    model = between(arm(3), "w1 - w2") + FRICTION("gear", 0.3)
    assert model.to_dict()["ports"] == {
        "gear": {"flow": "w1 - w2", "displacement": "q1 - q2", "unit": "N m"}
    }
    assert PhysicsModel.from_dict(model.to_dict()) == model
    assert PhysicsModel.from_dict(model.to_dict()).port("gear").rates.keys() == {"w1", "w2", "w3"}


def test_a_flow_names_a_port_where_its_inertia_is_stated():
    masses = three_masses().replace(ports={"spring": {"flow": "v1 - v2"}, "end": {"flow": "v3"}})
    m1, m2, m3 = map(symbol, ("m1", "m2", "m3"))
    assert masses.port("spring").rates == {"v1": 1 / m1, "v2": -1 / m2}
    assert masses.port("end").rates == {"v3": 1 / m3}
    assert "v3" not in masses.ports
    assert list(masses.ports) == ["spring", "end", "v1", "v2"]
    with pytest.raises(ModelError, match=r"ports.x: expected 'effort' or 'rates', .* Remedy"):
        three_masses().replace(ports={"x": {"flow": "x1"}})


def test_friction_at_a_joint_takes_the_power_that_the_balance_says():
    model = arm(2) + FRICTION("w2", 0.3)
    stored = model.energy["stored"]
    grows = sum(sympy.diff(stored, symbol(s)) * r for s, r in model.equations.items())
    given = model.energy["supplied"] - model.energy["dissipated"]
    got, expected = numbers_of(model, (grows, given), 6)
    assert got == pytest.approx(expected, rel=1e-9)


def test_load_dependent_friction_is_driven_by_the_torque_at_its_joint():
    model = arm(2) + effects.LoadFriction("w2", level=0.1, share=0.2)
    assert model.forces["w2"].has(abs(symbol("tau2")))
    assert not model.forces["w2"].has(symbol("tau1"))


def test_accelerometers_on_both_sides_of_a_strut_feel_what_acts_in_it():
    """The wheel's acceleration has all terms of the body's, and yet it repeats its own alone."""
    car = PhysicsModel(
        {"b": "m", "w": "m", "vb": "m/s", "vw": "m/s"}, {"b": "vb", "w": "vw"},
        {"mb": 300.0, "mw": 40.0, "k": 18e3, "d": 1e3, "kt": 18e4}, {"r": "m"},
        {"ab": "der(vb)", "aw": "der(vw)", "both": "der(vb) - der(vw)"},
        inertia={"vb": "mb", "vw": "mw"}, let={"F": "k*(b - w) + d*(vb - vw)"},
        forces={"vb": "-F", "vw": "F - kt*(w - r)"}, ports={"strut": {"flow": "vb - vw"}},
    )  # fmt: skip
    rubbing = car + FRICTION("strut", 50.0)
    shown, rates = rubbing.outputs, rubbing.equations
    for seed in range(3):
        ab, aw, both, vb, vw = numbers_of(
            rubbing, (*shown.values(), rates["vb"], rates["vw"]), seed
        )
        assert (ab, aw, both) == pytest.approx((vb, vw, vb - vw), rel=1e-9)


def test_what_leaves_a_store_is_taken_from_its_energy():
    wall = PhysicsModel(
        {"T": "K"}, capacity={"T": "C"}, flows={"T": "P"}, inputs={"P": "W"},
        parameters={"C": {"value": 2.0, "unit": "J/K"}},
        energy={"stored": "C*T", "supplied": "P"},
    )  # fmt: skip
    port = wall.port("T")
    assert (port.rates, port.unit) == ({"T": 1 / symbol("C")}, "W")
    cooled = wall.replace(**port.act(wall, parse_expression("0.5*T", ["T"])))
    assert str(cooled.flows["T"]) == "P - 0.5*T"
    assert str(cooled.energy["dissipated"]) == "0.5*T"
