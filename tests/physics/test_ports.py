"""Ports: an effort acts in every rate and output that contains it, and takes the power e*f."""

import pickle

import numpy as np
import pytest
import sympy

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.exceptions import ModelError, UnitWarning
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.found_ports import inverse_masses

#: a two-link arm: masses at the ends of the links, angles relative to the link before
LET = {
    "c": "cos(q2)",
    "h": "m2*l1*l2*sin(q2)",
    "a": "m1*l1**2 + m2*(l1**2 + 2*l1*l2*c + l2**2)",
    "b": "m2*(l1*l2*c + l2**2)",
    "d": "m2*l2**2",
    "e1": "tau1 + h*(2*w1*w2 + w2**2)",
    "e2": "tau2 - h*w1**2",
}
KINETIC = "(a*w1**2 + 2*b*w1*w2 + d*w2**2)/2"
ARM = {
    "states": {"q1": "rad", "q2": "rad", "w1": "rad/s", "w2": "rad/s"},
    "inputs": {"tau1": "N m"},
    "parameters": {
        name: {"value": value, "unit": unit}
        for name, value, unit in (
            ("m1", 1.3, "kg"), ("m2", 0.7, "kg"), ("l1", 0.4, "m"), ("l2", 0.55, "m"),
        )
    },
    "equations": {
        "q1": "w1",
        "q2": "w2",
        "w1": "(d*e1 - b*e2)/(a*d - b**2)",
        "w2": "(a*e2 - b*e1)/(a*d - b**2)",
    },
    "outputs": {"q1": "q1", "q2": "q2", "acc": "der(w2)"},
    "let": LET,
    "energy": {"stored": KINETIC},
}  # fmt: skip
ELBOW = {"elbow": {"effort": "tau2", "flow": "w2"}}
#: a cart below a pendulum, and a force on the cart
PULL = "(F + m*l*w**2*sin(th) - m*g*sin(th)*cos(th))/(M + m*sin(th)**2)"
CART = PhysicsModel(
    {"x": "m", "v": "m/s", "th": "rad", "w": "rad/s"},
    {"x": "v", "v": PULL, "th": "w", "w": f"(g*sin(th) - cos(th)*{PULL})/l"},
    {"M": 1.4, "m": 0.3, "l": 0.6, "g": 9.81},
    {"F": "N"},
)
CART_ENERGY = sympy.sympify(
    "M*v**2/2 + m*(v**2 + 2*l*v*w*cos(th) + l**2*w**2)/2 + m*g*l*cos(th)",
    {name: symbol(name) for name in ("M", "m", "v", "l", "w", "th", "g")},
)


def drawn(model, seed=3):
    """Return a random value for every quantity of a model."""
    rng = np.random.default_rng(seed)
    names = (*model.states, *model.inputs)
    values = {symbol(name): rng.uniform(-2, 2) for name in names}
    values[TIME] = 0.7
    return values | {symbol(n): p.value + rng.uniform(0, 1) for n, p in model.parameters.items()}


def power(model, energy):
    """Return the rate of an energy along a model's equations."""
    return sympy.Add(*(energy.diff(symbol(s)) * rate for s, rate in model.equations.items()))


def lost(model, effect, energy):
    """Return the power that an effect takes from an energy, at a random point."""
    extended = model + effect
    point = drawn(extended)
    difference = power(extended, energy) - power(model, energy)
    return float(difference.xreplace(point)), point


# -- the law ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("ports", [ELBOW, {}], ids=["declared", "found from the energy"])
def test_friction_at_an_elbow_takes_its_power_from_the_whole_arm(ports):
    arm = PhysicsModel(**{**ARM, "inputs": {"tau1": "N m", "tau2": "N m"}, "ports": ports})
    target = "elbow" if ports else "w2"
    friction = effects.CoulombFriction(target, level=0.2)
    found, point = lost(arm, friction, arm.energy["stored"])
    level, w = point[symbol(f"Fc_{target}")], point[symbol("w2")]
    assert found == pytest.approx(-level * abs(w), rel=1e-9)
    dissipated = (arm + friction).energy["dissipated"]
    assert float(dissipated.xreplace(point)) == pytest.approx(level * abs(w))


def test_a_force_on_a_cart_takes_its_power_from_cart_and_pendulum():
    """The force is the input's place: it enters both rates, and drives the cart forward."""
    found, point = lost(CART, effects.ViscousFriction("v", coefficient=1.0), CART_ENERGY)
    assert found == pytest.approx(-point[symbol("d_v")] * point[symbol("v")] ** 2, rel=1e-9)


def test_ports_by_energy_and_by_input_are_the_same():
    by_energy = CART.replace(energy={"stored": CART_ENERGY}).port("v").rates
    by_input = CART.port("v").rates
    point = drawn(CART)
    for state, slope in by_input.items():
        expected = float(slope.xreplace(point))
        assert float(by_energy[state].xreplace(point)) == pytest.approx(expected, rel=1e-12)


def test_an_effort_between_two_masses_acts_on_both():
    car = PhysicsModel(
        {"x": "m", "v": "m/s", "y": "m", "w": "m/s"},
        {"x": "v", "v": "(-k*(x - y) + G)/m1", "y": "w", "w": "(k*(x - y) - G - u*y)/m2"},
        {"m1": 300.0, "m2": 40.0, "k": 2e4, "u": 2e5},
        outputs={"stroke": "x - y", "body": "der(v)"},
        inertia={"v": "m1", "w": "m2"},
        ports={"damper": {"effort": "G", "flow": "v - w"}},
    )
    port = car.port("damper")
    assert port.displacement == symbol("x") - symbol("y")
    assert port.unit == "N"
    damped = car + effects.ViscousFriction("damper", coefficient=900.0)
    force = symbol("d_damper") * (symbol("v") - symbol("w"))
    for name, mass, sign in (("v", "m1", 1), ("w", "m2", -1)):
        changed = damped.equations[name] - car.equations[name]
        assert sympy.simplify(changed + sign * force / symbol(mass)) == 0
    assert sympy.simplify(damped.outputs["body"] - damped.equations["v"]) == 0
    assert set(car.ports) == {"damper", "v", "w"}


# -- orders ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "on_input",
    [
        effects.ActuatorLag("F", time_constant=0.1),
        effects.InputSaturation("F", 3.0),
        effects.InputGain("F", 0.1),
        effects.InputDeadZone("F", 0.2),
        effects.WrongParameter("m"),
        effects.ParameterDrift("l", 0.01),
    ],
    ids=lambda effect: effect.id,
)
def test_effects_at_a_port_and_on_an_input_come_in_any_order(on_input):
    friction = effects.CoulombFriction("v", level=1.0)
    one, other = CART + on_input + friction, CART + friction + on_input
    point = drawn(one)
    for state, rate in one.equations.items():
        expected = float(other.equations[state].xreplace(point))
        assert float(rate.xreplace(point)) == pytest.approx(expected, rel=1e-12)


# -- files -----------------------------------------------------------------------------------------


def test_a_model_with_ports_comes_back_from_its_file_and_from_a_pickle(tmp_path):
    arm = PhysicsModel(**{**ARM, "ports": ELBOW}) + effects.CoulombFriction("elbow", level=0.1)
    arm.to_yaml(tmp_path / "arm.yaml")
    read = PhysicsModel.from_yaml(tmp_path / "arm.yaml")
    assert read == arm == pickle.loads(pickle.dumps(arm)) == PhysicsModel.from_dict(arm.to_dict())
    assert read.port("elbow") == arm.port("elbow")
    assert arm.port("elbow").unit == "N m"


def test_shared_subexpressions_are_written_out_and_an_effort_that_nobody_applies_is_zero():
    arm, driven = (
        PhysicsModel(**{**ARM, "inputs": inputs, "ports": ELBOW})
        for inputs in ({"tau1": "N m"}, {"tau1": "N m", "tau2": "N m"})
    )
    assert not {*LET, "tau2"} & {s.name for r in arm.equations.values() for s in r.free_symbols}
    point = drawn(driven) | {symbol("tau2"): 0.0}
    for state, rate in arm.equations.items():
        expected = float(driven.equations[state].xreplace(point))
        assert float(rate.xreplace(point)) == pytest.approx(expected, rel=1e-12)
    assert arm.port("elbow").rates == driven.port("elbow").rates


def test_an_effort_may_be_a_shared_subexpression():
    let = {"load": "tau - d*w"}
    ports = {"shaft": {"effort": "load", "flow": "w"}}
    parts = {"states": {"w": "rad/s"}, "inputs": {"tau": "N m"}, "parameters": {"J": 2.0, "d": 0.1}}
    motor = PhysicsModel(**parts, equations={"w": "load/J"}, let=let, ports=ports)
    assert dict(motor.port("shaft").rates) == {"w": 1 / symbol("J")}
    assert motor.equations["w"] == (symbol("tau") - symbol("d") * symbol("w")) / symbol("J")


def test_a_port_with_the_name_of_its_flow_replaces_what_is_found():
    store = PhysicsModel(
        {"T": "K"}, {"T": "P/C"}, {"C": 80.0}, {"P": "W"}, ports={"T": {"effort": "P", "flow": "T"}}
    )
    assert list(store.ports) == ["T"]
    assert store.port("T").unit == "W"
    assert effects.CoulombFriction.targets(store) == ()


def test_places_with_a_name_of_their_own_are_called_by_it():
    arm = PhysicsModel(**{**ARM, "ports": ELBOW})
    names = [effects.CoulombFriction.title(t) for t in effects.CoulombFriction.targets(arm)]
    assert names == ["Coulomb friction at the elbow", "Coulomb friction on w1"]


def test_a_unit_that_makes_no_power_is_told(tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text(
        "states: {w: rad/s}\ninputs: {u: V}\nparameters: {K: 2.0}\nequations: {w: K*u}\n"
        "ports: {shaft: {effort: u, flow: w}}\n"
    )
    with pytest.warns(UnitWarning, match=r":5:9: ports.shaft: the effort in V times .* no power"):
        PhysicsModel.from_yaml(file)


# -- what is refused -------------------------------------------------------------------------------

ROTOR = {
    "states": {"q": "rad", "w": "rad/s"},
    "inputs": {"u": "N m"},
    "parameters": {"J": 2.0},
    "equations": {"q": "w", "w": "(u + 3*min(f, 2))/J"},
}


@pytest.mark.parametrize(
    ("ports", "message"),
    [
        (
            {"p": {"effort": "f", "flow": "w"}},
            "effort 'f' is not linear in .* of 'w'.*Remedy: give",
        ),
        ({"p": {"effort": "z", "flow": "w"}}, "effort 'z' is in no equation.*Remedy: write z"),
        ({"p": {"effort": "u", "flow": "u"}}, "flow: expected a state, or a difference of two"),
        ({"p": {"effort": "u"}}, "expected the flow conjugate to the effort, got none"),
        ({"p": {"flow": "w"}}, "expected 'effort' or 'rates', got none, and no inertia"),
        ({"p": {"flow": "w", "rates": {"z": "1"}}}, "unknown name 'z'; expected one of q, w"),
        ({"p": {"effort": "u", "flow": "w", "color": "red"}}, "unknown key 'color'"),
        ({"p": {"effort": "u", "flow": "w", "displacement": "2*q"}}, "whose rate is 2\\*w"),
        ({"J": {"effort": "u", "flow": "w"}}, "the name is taken by another quantity"),
        ({"p": {"effort": "J", "flow": "w"}}, "let 'J': the name is taken"),
        ({"p": {"effort": 3, "flow": "w"}}, "effort: expected a name, got 3"),
        ({"p": "w"}, "expected names and values, got 'w'"),
        ({"no name": {"effort": "u", "flow": "w"}}, "port 'no name' is not a name"),
        ("p", "ports: expected names and values, got 'p'"),
    ],
)
def test_what_is_no_port_is_refused(ports, message):
    with pytest.raises(ModelError, match=message):
        PhysicsModel(**{**ROTOR, "ports": ports, "let": {"g": "u"}, **_with_effort(ports)})


def _with_effort(ports):
    """Return equations that are whole where no port names the effort f."""
    named = "'f'" in str(ports)
    return {} if named else {"equations": {"q": "w", "w": "u/J"}}


def test_an_unknown_port_is_refused():
    with pytest.raises(ModelError, match=r"expected a port among v, w, got 'elbow'\. Remedy"):
        CART.port("elbow")


@pytest.mark.parametrize(
    ("let", "message"),
    [
        ({"a": "x + zz"}, "unknown name 'zz'"),
        ({"a": "b", "b": "x"}, "unknown name 'b'"),
        ({"x": "1"}, "let 'x': the name is taken"),
        ({"der": "x", "1a": "x"}, "let '1a' is not a name"),
        (
            {f"a{n}": f"sin(a{n - 1}) + cos(a{n - 1})" if n else "x" for n in range(40)},
            "at most 10000",
        ),
        ({f"a{n}": f"sin(a{n - 1})" if n else "x" for n in range(900)}, "nested"),
        ({f"a{n}": f"a{n - 1}**50" if n else "x + 1" for n in range(3)}, "exponent of at most 100"),
    ],
    ids=["unknown", "later", "taken", "no name", "doubling", "deep", "tower"],
)
def test_shared_subexpressions_that_are_refused(let, message):
    with pytest.raises(ModelError, match=message):
        PhysicsModel({"x": "m"}, {"x": "-x"}, let=let)


# -- found ports -----------------------------------------------------------------------------------


def test_an_input_between_two_masses_is_not_taken_for_a_force_on_one():
    """Constant coefficients of both signs: two masses, or a linear coupling."""
    car = PhysicsModel(
        {"x": "m", "v": "m/s", "y": "m", "w": "m/s"},
        {"x": "v", "v": "u/m1", "y": "w", "w": "-u/m2"},
        {"m1": 3.0, "m2": 4.0},
        {"u": "N"},
    )
    assert {name: dict(port.rates) for name, port in car.ports.items()} == {
        "v": {"v": 1},
        "w": {"w": 1},
    }


def test_a_mass_matrix_is_inverted_only_where_the_energy_has_one():
    v, w, m = (symbol(name) for name in ("v", "w", "m"))
    assert inverse_masses(m * v**2 / 2, (v,)) == {v: {v: 1 / m}}
    assert inverse_masses(v**4, (v,)) == {}
    assert inverse_masses((v + w) ** 2, (v, w)) == {}
    assert inverse_masses(m * symbol("x"), (v,)) == {}


# -- outputs that contain a rate -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("output", "factor"),
    [
        ("(F - k*x - d*v)/m", "1"),
        ("-(F - k*x - d*v)/m/9.81 + b", "-1/9.81"),
        ("F - k*x - d*v + b*F", "m"),
        ("der(v)*(1 + b)", "1 + b"),
        ("F - k*x", "0"),
        ("v", "0"),
        ("x - F/m", "0"),
    ],
)
def test_an_effect_on_a_rate_reaches_what_shows_the_rate(output, factor):
    mass = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(F - k*x - d*v)/m"},
        {"m": 2.0, "k": 8.0, "d": 0.3, "b": 0.1},
        {"F": "N"},
        outputs={"y": output},
        inertia={"v": "m"},
    )
    for effect in (effects.CoulombFriction("v", 1.0), effects.RateLimit("v", 2.0)):
        changed = mass + effect
        point = drawn(changed) | {symbol("R_v"): 0.01}
        scale = float(sympy.sympify(factor).subs({str(s): v for s, v in point.items()}))
        at_rate, at_output = (
            float((now[name] - before[name]).xreplace(point))
            for now, before, name in (
                (changed.equations, mass.equations, "v"),
                (changed.outputs, mass.outputs, "y"),
            )
        )
        assert at_rate != 0
        assert at_output == pytest.approx(scale * at_rate, abs=1e-12)


def test_the_voltage_at_a_resistor_does_not_show_a_leak_of_the_capacitor():
    high_pass = PhysicsModel(
        {"x": "V"}, {"x": "(u - x)/T"}, {"T": 2.0}, {"u": "V"}, outputs={"y": "u - x"}
    )
    leaking = high_pass + effects.Leak("x", coefficient=0.1)
    assert leaking.outputs == high_pass.outputs
    assert leaking.equations != high_pass.equations


@pytest.mark.parametrize("output", ["der(F)", "der(x + v)", "der()", "der(v, x)"])
def test_only_a_state_has_a_rate(output):
    with pytest.raises(ModelError, match="is not the rate of a state; only an output may have one"):
        PhysicsModel({"x": "m", "v": "m/s"}, {"x": "v", "v": "F"}, {}, {"F": "N"}, {"y": output})
