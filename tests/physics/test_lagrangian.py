"""Models from their energies: textbook equations, balances, and what is conserved."""

import numpy as np
import pytest
import sympy
from machines_in_motion import (
    arm,
    cart_pole,
    crane,
    double_pendulum,
    numbers_of,
    random_point,
    three_masses,
)

from sklearn_pgnn.exceptions import ModelError, UnitWarning
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.physics.expressions import TIME, parse_expression, symbol
from sklearn_pgnn.physics.lagrangian import tidy

pytestmark = pytest.mark.core

MACHINES = (cart_pole(), double_pendulum(), crane(), arm(2), arm(3), three_masses())
BY_NAME = pytest.mark.parametrize("model", MACHINES, ids=lambda m: "-".join(m.states))


# -- textbooks -------------------------------------------------------------------------------------

TEXTBOOK = {
    # A. G. Barto, R. S. Sutton, C. W. Anderson, IEEE Trans. SMC 13, 1983: a uniform pole
    "cart-pole": (
        cart_pole(kinetic="M*v**2/2 + m*((v + l*w*cos(q))**2 + (l*w*sin(q))**2)/2 + m*l**2*w**2/6"),
        {"w": "(g*sin(q) + cos(q)*(-F + b*v - m*l*w**2*sin(q))/(M + m))"
              "/(l*(4/3 - m*cos(q)**2/(M + m)))"},
    ),
    # E. Neumann, myphysicslab.com, "Double Pendulum"
    "double pendulum": (
        double_pendulum(),
        {"w1": "(-g*(2*m1 + m2)*sin(q1) - m2*g*sin(q1 - 2*q2) - 2*sin(q1 - q2)*m2*(w2**2*l2 + "
               "w1**2*l1*cos(q1 - q2)))/(l1*(2*m1 + m2 - m2*cos(2*q1 - 2*q2)))",
         "w2": "2*sin(q1 - q2)*(w1**2*l1*(m1 + m2) + g*(m1 + m2)*cos(q1) + w2**2*l2*m2*cos(q1 - "
               "q2))/(l2*(2*m1 + m2 - m2*cos(2*q1 - 2*q2)))"},
    ),
    # the overhead crane of the control literature, without friction
    "crane": (
        crane().with_parameters(c=0.0, d=0.0),
        {"v": "(F + m*sin(q)*(l*w**2 + g*cos(q)))/(M + m*sin(q)**2)",
         "w": "-(F*cos(q) + m*l*w**2*sin(q)*cos(q) + (M + m)*g*sin(q))/(l*(M + m*sin(q)**2))"},
    ),
    "three masses": (
        three_masses(),
        {"v2": "(k1*(x1 - x2) - k2*(x2 - x3) + d*(v1 - 2*v2 + v3))/m2"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("machine", TEXTBOOK)
def test_the_rates_are_those_of_textbooks(machine):
    model, rates = TEXTBOOK[machine]
    names = (*model.states, *model.inputs, *model.parameters)
    for state, text in rates.items():
        published = parse_expression(text, names)
        for seed in range(3):
            got, expected = numbers_of(model, (model.equations[state], published), seed)
            assert got == pytest.approx(expected, rel=1e-10)


def test_the_arm_has_the_mass_matrix_of_spong():
    """The planar elbow manipulator of "Robot Modeling and Control", with the masses at the ends."""
    rows = arm(2).inertia
    assert str(rows["w1"][0]) == ("J1 + J2 + l1**2*m1 + l1**2*m2 + 2*l1*l2*m2*cos(q2) + l2**2*m2")
    assert str(rows["w1"][1]) == str(rows["w2"][0]) == "J2 + l1*l2*m2*cos(q2) + l2**2*m2"
    assert str(rows["w2"][1]) == "J2 + l2**2*m2"


# -- laws ------------------------------------------------------------------------------------------


def rate_of(model, expression):
    """Return the rate of a function of the states along the model's motion."""
    total = sympy.diff(expression, TIME)
    return total + sum(sympy.diff(expression, symbol(s)) * r for s, r in model.equations.items())


def balance(model):
    return rate_of(model, model.energy["stored"]), model.energy.get("supplied", 0) - (
        model.energy.get("dissipated", 0)
    )


@BY_NAME
def test_what_is_stored_grows_by_what_is_supplied_and_not_dissipated(model):
    for seed in range(3):
        grows, given = numbers_of(model, map(sympy.sympify, balance(model)), seed)
        assert grows == pytest.approx(given, rel=1e-9, abs=1e-9)


@BY_NAME
def test_dissipated_power_is_nowhere_negative(model):
    dissipated = sympy.sympify(model.energy.get("dissipated", 0))
    assert all(numbers_of(model, [dissipated], seed) >= 0.0 for seed in range(20))


def run(model, steps, x0):
    """Return the states along a motion without inputs, by Runge and Kutta's method."""
    names = [symbol(n) for n in model.states]
    constants = {symbol(n): p.value for n, p in model.parameters.items()}
    constants |= {symbol(n): 0.0 for n in model.inputs}
    rates = [rate.xreplace(constants) for rate in model.equations.values()]
    f = sympy.lambdify(names, rates, "math")
    states, h = [np.array(x0, dtype=float)], 1e-3
    for _ in range(steps):
        x = states[-1]
        k1 = np.array(f(*x))
        k2 = np.array(f(*(x + h / 2 * k1)))
        k3 = np.array(f(*(x + h / 2 * k2)))
        k4 = np.array(f(*(x + h * k3)))
        states.append(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return np.array(states), lambda e: sympy.lambdify(names, e.xreplace(constants), "numpy")


@pytest.mark.parametrize("model", [cart_pole(dissipation=0), double_pendulum()])
def test_energy_is_conserved_where_nothing_is_supplied_or_dissipated(model):
    states, function = run(model, 2000, [0.3, 1.2, 0.5, -0.7])
    stored = function(model.energy["stored"])(*states.T)
    kinetic = np.ptp(states[:, 3])
    assert np.ptp(stored) < 1e-9 * kinetic


def test_momentum_of_free_masses_changes_by_the_force_alone():
    model = three_masses()
    momentum = parse_expression("m1*v1 + m2*v2 + m3*v3", (*model.states, *model.parameters))
    for seed in range(3):
        changes, force = numbers_of(model, (rate_of(model, momentum), symbol("F")), seed)
        assert changes == pytest.approx(force, rel=1e-10)


def test_angular_momentum_of_an_arm_in_a_horizontal_plane_changes_by_the_first_torque_alone():
    model = arm(3).with_parameters(g=0.0, d=0.0)
    row = model.inertia["w1"]
    momentum = sum(entry * symbol(v) for entry, v in zip(row, model.inertia, strict=True))
    for seed in range(3):
        changes, torque = numbers_of(model, (rate_of(model, momentum), symbol("tau1")), seed)
        assert changes == pytest.approx(torque, rel=1e-9, abs=1e-10)


def test_a_bead_on_a_turning_hoop_conserves_jacobis_integral_and_not_its_energy():
    """Goldstein, 2.7: the hoop's motor supplies what the energy gains."""
    model = PhysicsModel.from_lagrangian(
        {"q": "w"}, "m*r**2*(w**2 + W**2*sin(q)**2)/2", "-m*g*r*cos(q)",
        states={"q": "rad", "w": "rad/s"},
        parameters={"m": 0.3, "r": 0.2, "W": 9.0, "g": 9.81},
    )  # fmt: skip
    stored = model.energy["stored"]
    jacobi = parse_expression(
        "m*r**2*(w**2 - W**2*sin(q)**2)/2 - m*g*r*cos(q)", (*model.states, *model.parameters)
    )
    assert set(model.energy) == {"stored"}
    assert sympy.expand(stored - jacobi) == 0
    assert abs(numbers_of(model, [rate_of(model, stored)], 0)[0]) < 1e-12


def test_a_force_by_the_velocity_of_another_coordinate_does_no_work():
    """A charge in a magnetic field: kinetic energy linear in the velocities."""
    model = PhysicsModel.from_lagrangian(
        {"x": "vx", "y": "vy"}, "m*(vx**2 + vy**2)/2 + B*(x*vy - y*vx)/2",
        states={"x": "m", "y": "m", "vx": "m/s", "vy": "m/s"}, parameters={"m": 2.0, "B": 3.0},
    )  # fmt: skip
    assert str(model.equations["vx"]) == "B*vy/m"
    assert str(model.equations["vy"]) == "-B*vx/m"
    assert sympy.expand(model.energy["stored"] - parse_expression(
        "m*(vx**2 + vy**2)/2", ("m", "vx", "vy")
    )) == 0  # fmt: skip


def test_a_pivot_that_is_moved_in_time_supplies_the_energy():
    model = PhysicsModel.from_lagrangian(
        {"q": "w"}, "m*(l**2*w**2 - 2*a*W*sin(W*t)*l*w*sin(q) + (a*W*sin(W*t))**2)/2",
        "-m*g*(l*cos(q) - a*cos(W*t))", "d*w**2/2",
        states={"q": "rad", "w": "rad/s"},
        parameters={"m": 0.3, "l": 0.4, "a": 0.05, "W": 20.0, "g": 9.81, "d": 0.01},
    )  # fmt: skip
    for seed in range(3):
        grows, given = numbers_of(model, balance(model), seed)
        assert grows == pytest.approx(given, rel=1e-9)


def test_a_spring_with_a_moved_end_supplies_by_its_input():
    model = PhysicsModel.from_lagrangian(
        {"x": "v"}, "m*v**2/2", "k*(x - u)**2/2", states={"x": "m", "v": "m/s"},
        inputs={"u": "m"}, parameters={"m": 2.0, "k": 8.0},
    )  # fmt: skip
    assert sympy.expand(model.equations["v"] - parse_expression(
        "k*(u - x)/m", ("k", "u", "x", "m")
    )) == 0  # fmt: skip
    assert str(model.energy["stored"]) == "k*x**2/2 + m*v**2/2"
    assert str(model.energy["supplied"]) == "k*u*v"


def test_a_one_sided_spring_pushes_on_one_side():
    model = PhysicsModel.from_lagrangian(
        {"x": "v"}, "m*v**2/2", "k*max(x, 0)**2/2", states={"x": "m", "v": "m/s"},
        parameters={"m": 2.0, "k": 8.0},
    )  # fmt: skip
    rate, x = model.equations["v"], symbol("x")
    constants = {symbol("k"): 8.0, symbol("m"): 2.0}
    pushed = [float(rate.xreplace({x: sympy.Float(v)} | constants)) for v in (-1.0, 0.0, 0.5)]
    assert pushed == [0.0, 0.0, -2.0]


def test_coulomb_friction_is_a_dissipation_function():
    model = cart_pole(dissipation="b*abs(v)")
    for seed in range(3):
        force, power = numbers_of(model, (model.forces["v"], model.energy["dissipated"]), seed)
        v = float(random_point(model, seed)[symbol("v")])
        frictionless = numbers_of(model, [cart_pole(dissipation=0).forces["v"]], seed)[0]
        assert force - frictionless == pytest.approx(-0.2 * np.sign(v))
        assert power == pytest.approx(0.2 * abs(v))


def test_a_motor_drives_a_pendulum():
    """A state that is no coordinate keeps its own equation."""
    model = PhysicsModel.from_lagrangian(
        {"q": "w"}, "J*w**2/2", forces={"q": "K*i"},
        states={"q": "rad", "w": "rad/s", "i": "A"}, inputs={"U": "V"},
        equations={"i": "(U - R*i - K*w)/L"},
        parameters={"J": 0.1, "K": 0.5, "R": 1.0, "L": 0.02},
    )  # fmt: skip
    assert str(model.equations["w"]) == "K*i/J"
    assert str(model.equations["i"]) == "(-K*w - R*i + U)/L"


def test_the_velocity_of_a_place_is_its_derivative():
    let = {"z": "x + l*sin(q)", "h": "l*cos(q)"}
    same = cart_pole(
        let=let, kinetic="M*der(x)**2/2 + m*(der(z)**2 + der(h)**2)/2", potential="m*g*h"
    )
    assert (same.inertia, same.forces) == (cart_pole().inertia, cart_pole().forces)
    for seed in range(3):
        stored = (same.energy["stored"], cart_pole().energy["stored"])
        got, expected = numbers_of(same, stored, seed)
        assert got == pytest.approx(expected, rel=1e-12)


def test_a_place_that_swings_in_time_moves():
    model = PhysicsModel.from_lagrangian(
        {"q": "w"}, "m*(der(x)**2 + der(y)**2)/2", "m*g*y", let={
            "x": "l*sin(q)", "y": "a*cos(W*t) - l*cos(q)"},
        states={"q": "rad", "w": "rad/s"},
        parameters={"m": 0.3, "l": 0.4, "a": 0.05, "W": 20.0, "g": 9.81},
    )  # fmt: skip
    kapitza = parse_expression(
        "-(g - a*W**2*cos(W*t))*sin(q)/l", (*model.states, *model.parameters)
    )
    for seed in range(3):
        got, expected = numbers_of(model, (model.equations["w"], kapitza), seed)
        assert got == pytest.approx(expected, rel=1e-10)


def test_a_diagonal_kinetic_energy_gives_single_inertias():
    assert all(isinstance(m, sympy.Symbol) for m in three_masses().inertia.values())


def test_tidy_keeps_what_is_short():
    a, b = sympy.symbols("a b")
    assert tidy((a + b) ** 3) == (a + b) ** 3
    assert tidy(a * sympy.sin(b) ** 2 + a * sympy.cos(b) ** 2) == a


def test_many_sines_are_not_written_by_the_sums_of_angles():
    waves = sympy.Mul(*(sympy.sin(i * symbol("q")) for i in range(1, 40)))
    assert tidy(waves) == waves
    assert tidy(sympy.cos(symbol("q")) ** 90) == sympy.cos(symbol("q")) ** 90


# -- errors ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"kinetic": "M*v**2/2"}, "lagrangian.kinetic: .* none of 'w'.*Remedy"),
        ({"kinetic": "M*(v + l*w)**2/2"}, "inertia: .* positive definite, .* singular.*Remedy"),
        ({"kinetic": "M*v**2/2 + m*l*v*w - m*l**2*w**2"}, "inertia: .* negative, .*'w'.*Remedy"),
        ({"kinetic": "M*v**2/2 + m*w**2*F/2"}, "lagrangian.kinetic: expected .* got 'F'.*Remedy"),
        ({"potential": "v*x"}, "lagrangian.potential: expected .* got 'v'.*Remedy"),
        ({"coordinates": {"x": "v", "q": "v"}}, "lagrangian.coordinates: .*'v'.*Remedy"),
        ({"coordinates": {"x": "v", "z": "w"}}, "lagrangian.coordinates: .*'z'.*Remedy"),
        ({"coordinates": {}}, "lagrangian.coordinates: .*none.*Remedy"),
        ({"forces": {"v": "F"}}, "lagrangian.forces: unknown name 'v'; expected one of x, q"),
        ({"equations": {"x": "v"}}, "equations.x: follows from 'lagrangian'.*Remedy"),
        ({"kinetic": "M*v**2 + m*l**2*w**2 + abs(v)*v"}, "lagrangian: .* jumps, .* in 'v'.*Remedy"),
        ({"kinetic": "M*v**2 + m*l**2*w**2*floor(x)"}, "lagrangian: .* jumps, .* in 'x'.*Remedy"),
        ({"kinetic": "M*der(v)**2/2"}, r"lagrangian.kinetic: .*der\(v\)"),
        ({"dissipation": "c*v**2"}, "lagrangian.dissipation: unknown name 'c'"),
    ],
)  # fmt: skip
def test_what_is_no_lagrangian_is_refused(changes, said):
    with pytest.raises(ModelError, match=said):
        cart_pole(**changes)


FILE = """\
states: {x: m, q: rad, v: m/s, w: rad/s}
inputs: {F: N}
parameters:
  M: {value: 1.3, unit: kg}
  m: {value: 0.4, unit: kg}
  l: {value: 0.7, unit: m}
  b: {value: 0.2, unit: N s/m}
  g: {value: 9.81, unit: m/s^2}
lagrangian:
  coordinates: {x: v, q: w}
  kinetic: M*v**2/2 + m*((v + l*w*cos(q))**2 + (l*w*sin(q))**2)/2
  potential: m*g*l*cos(q)
  dissipation: b*v**2/2
  forces: {x: F}
"""


def read(tmp_path, text):
    path = tmp_path / "machine.yaml"
    path.write_text(text)
    return PhysicsModel.from_yaml(path)


def test_the_model_file_has_the_same_machine(tmp_path):
    model, same = read(tmp_path, FILE), cart_pole()
    assert (model.equations, model.forces, model.energy) == (
        same.equations, same.forces, same.energy
    )  # fmt: skip


def test_a_lagrangian_is_written_as_its_mass_matrix(tmp_path):
    model = read(tmp_path, FILE)
    text = model.to_yaml()
    assert "lagrangian" not in text
    assert 'v: ["M + m", "l*m*cos(q)"]' in text
    assert read(tmp_path, text) == model


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("  kinetic: M*v", "  kinetik: M*v", ":11:3: unknown key 'kinetik'; expected coordinates"),
        ("  kinetic: M*v", "  potential: M*v", ":12:3: 'potential' is here twice"),
        ("{x: v, q: w}\n  kinetic", "{x: v, q: u}\n  kinetic", ":10:3: .*'u'.*Remedy"),
        ("b*v**2/2", "b*v**2/", ":13:3: .* is not an arithmetic expression"),
        ("forces: {x: F}", "forces: {x: G}", r":14:12: .*unknown name 'G'"),
        ("forces: {x: F}", "forces: F", ":14:11: lagrangian.forces: expected names and values"),
    ],
)
def test_an_error_in_the_file_has_its_place(tmp_path, old, new, said):
    assert old in FILE
    with pytest.raises(ModelError, match=said):
        read(tmp_path, FILE.replace(old, new))


def test_a_unit_that_does_not_fit_an_energy_is_told_where_it_is(tmp_path):
    with pytest.warns(UnitWarning) as warned:
        read(tmp_path, FILE.replace("m*g*l*cos", "m*g*cos"))
    said = [str(each.message) for each in warned]
    assert len(said) == 2
    assert ":9:1: forces.w: the term g*m*sin(q) is in N, expected N m" in said[0]
    assert ":9:1: energy.stored: the term g*m*cos(q) is in N" in said[1]
