"""Units as people write them, those that follow from others, and equations against them."""

import math
import warnings

import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import UnitWarning
from sklearn_pgnn.physics.effects import CubicStiffness, QuadraticDrag, ViscousFriction
from sklearn_pgnn.physics.model_units import force_unit, rate_unit, tidy_unit
from sklearn_pgnn.physics.unit_check import check_units, output_measure
from sklearn_pgnn.physics.units import conversion, is_like, no_unit, plain_unit, read_unit

SAME = [
    ("N m", "Nm"),
    ("N m", "N*m"),
    ("kg m^2", "kg m²"),
    ("m/s^2", "m/s2"),
    ("m/s^2", "m/s**2"),
    ("°", "deg"),
    ("µm", "um"),
]
CONVERTED = [
    ("mm", "m", 1e-3),
    ("ms", "s", 1e-3),
    ("km/h", "m/s", 1 / 3.6),
    ("rpm", "rad/s", math.pi / 30),
    ("deg", "rad", math.pi / 180),
    ("bar", "Pa", 1e5),
    ("cm^0.5/s", "m^0.5/s", 0.1),
    ("kN/mm", "N/m", 1e6),
    ("%", "-", 0.01),
    ("J", "N m", 1.0),
    ("N m s/rad", "kg m^2/s", 1.0),
    ("m s-2", "m/s^2", 1.0),
    ("U/min", "rad/s", math.pi / 30),
    ("1/s", "rad/s", 1.0),
]


@pytest.mark.parametrize(("one", "other"), SAME)
def test_the_ways_to_write_a_unit_are_the_same(one, other):
    assert plain_unit(one) == plain_unit(other)
    assert conversion(one, other) == (1.0, 0.0)


@pytest.mark.parametrize(("given", "wanted", "factor"), CONVERTED)
def test_units_of_one_kind_are_converted_there_and_back(given, wanted, factor):
    there, back = conversion(given, wanted), conversion(wanted, given)
    assert there == (pytest.approx(factor), 0.0)
    assert there[0] * back[0] == pytest.approx(1.0)


def test_temperatures_have_their_own_zero():
    assert conversion("°C", "K") == (1.0, 273.15)
    assert conversion("K", "degC") == (1.0, -273.15)
    factor, offset = conversion("degF", "degC")
    assert factor * 212 + offset == pytest.approx(100)
    assert conversion("W/degC", "W/K") == (1.0, 0.0)


#: whether turns or radians are counted is not said
TURNS = [("1/min", "rad/s"), ("Hz", "rad/s"), ("deg/s", "min-1"), ("kHz", "rpm")]


@pytest.mark.parametrize(
    ("one", "other"), [("V", "N"), ("m", "m^2"), ("degC", "V"), ("s", "Hz"), *TURNS]
)
def test_units_of_another_kind_are_not_converted(one, other):
    assert conversion(one, other) is None


HOSTILE = ["9^9^9^9", "(m", "m/s/", "m + s", "__import__('os')", "kg<b>", "m" * 99, "1e400 m", "-m"]


@pytest.mark.parametrize("text", HOSTILE)
def test_what_is_no_unit_is_none(text):
    assert read_unit(text) is None


@pytest.mark.slow
@given(st.text(max_size=30))
def test_no_text_is_an_error(text):
    found = read_unit(text)
    assert found is None or math.isfinite(found.magnitude)


@given(st.sampled_from(["N", "kg", "m/s", "V", "rad", "Hz", "Pa"]), st.integers(-3, 3))
def test_powers_and_products_are_those_of_the_parts(unit, power):
    one = read_unit(unit)
    assert is_like(read_unit(f"({unit})^{power}"), one**power)
    assert is_like(one * one / one, one)
    assert is_like(one**0.0, no_unit())


SPEEDS = {"m/s": 1.0, "mm/s": 1e-3, "km/h": 1 / 3.6}


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize(("mass", "kilograms"), [("kg", 1.0), ("t", 1e3)])
def test_a_force_is_the_inertia_times_the_rate(speed, mass, kilograms):
    registry = pint.UnitRegistry()
    said = registry.Quantity(1.0, force_unit(mass, speed)).to("N").magnitude
    assert said == pytest.approx(kilograms * SPEEDS[speed])


@pytest.mark.parametrize("speed", ["rpm", "deg/s", "rad/s", "1/s"])
def test_a_torque_is_the_inertia_times_the_rate(speed):
    registry = pint.UnitRegistry()
    said = registry.Quantity(1.0, force_unit("kg m^2", speed).replace(" ", "*"))
    angle = registry.Quantity(1.0, {"1/s": "rad/s"}.get(speed, speed))
    assert said.to("kg*m^2/s^2").magnitude == pytest.approx(angle.to("rad/s").magnitude)


def test_a_force_without_a_known_inertia_has_the_unit_of_its_rate():
    assert force_unit("", "m/s") == "m/s^2"
    assert force_unit("kg", "") == "kg/s"


def test_what_has_no_unit_leaves_none_behind():
    assert rate_unit("") == "1/s"
    assert tidy_unit("1/s^2/()^3") == "1/s^2"
    assert tidy_unit("N/(1)^2") == "N"


def test_the_force_on_a_speed_in_millimetres_is_no_newton():
    slide = PhysicsModel(
        {"x": "mm", "v": "mm/s"}, {"x": "v", "v": "F/m"}, {"m": {"value": 2.0, "unit": "kg"}},
        {"F": "mN"}, inertia={"v": "m"},
    )  # fmt: skip
    (friction,) = ViscousFriction("v").parameters(slide)
    assert friction.unit == "kg mm/s^2/(mm/s)"


def test_effects_on_a_state_without_a_unit_have_units_that_can_be_read():
    valve = systems.servo_valve()
    units = {
        parameter.unit
        for effect in (CubicStiffness, QuadraticDrag)
        for target in effect.targets(valve)
        for parameter in effect(target).parameters(valve)
    }
    assert not [unit for unit in units if "()" in unit or "/s/s" in unit]


SYSTEMS = [getattr(systems, name) for name in systems.__all__]


def cart(**changes):
    units = {"m": "kg", "k": "N/m", "d": "N s/m", "x": "m", "v": "m/s", "F": "N", **changes}
    return PhysicsModel(
        {"x": units["x"], "v": units["v"]},
        {"x": "v", "v": "(F - k*x - d*v)/m"},
        {name: {"value": 1.0, "unit": units[name]} for name in "mkd"},
        {"F": units["F"]},
        inertia={"v": "m"},
    )


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_ready_systems_fit_their_units_with_every_effect_of_the_catalogue(system):
    model = system()
    assert check_units(model) == ()
    for kind in effects.CATALOGUE:
        for target in kind.targets(model):
            assert check_units(model + kind(target)) == (), (kind.id, target)


@pytest.mark.parametrize(
    ("changes", "terms"),
    [
        ({}, []),
        ({"k": "N"}, ["-k*x"]),
        ({"d": "N/m"}, ["-d*v"]),
        ({"F": "V"}, ["F"]),
        ({"F": "kN"}, ["F"]),
        ({"m": "g"}, ["F", "-k*x", "-d*v"]),
        ({"k": "N", "d": ""}, ["-k*x"]),
        ({"k": ""}, []),
        ({"k": "bananas"}, []),
        ({"v": "mm/s"}, ["v", "F", "-k*x"]),
    ],
)
def test_the_term_that_does_not_fit_is_named(changes, terms):
    said = check_units(cart(**changes))
    assert sorted(text.split("the term ")[1].split(" is in")[0] for text in said) == sorted(terms)


def test_another_scale_has_its_factor():
    (said,) = check_units(cart(F="kN"))
    assert said == "equations.v: the term F is in 1000 N, expected N (a factor of 1000)."
    cell = PhysicsModel({"z": ""}, {"z": "I/Q"}, {"Q": {"value": 2.9, "unit": "A h"}}, {"I": "A"})
    assert "expected 1/s (a factor of 0.0002778)" in check_units(cell)[0]


def test_a_number_in_front_of_another_kind_is_no_gravity():
    (said,) = check_units(one_state("-a*sqrt(2*9.81*x)/x", a="m/s"))
    assert "-4.429*a" in said
    assert "define a constant such as 9.81 m/s^2 as a fixed parameter" in said


def one_state(rate, unit="m", **parameters):
    values = {name: {"value": 1.0, "unit": unit} for name, unit in parameters.items()}
    return PhysicsModel({"x": unit}, {"x": rate}, values)


@pytest.mark.parametrize(
    ("model", "fits"),
    [
        (one_state("-x/T", T="s"), True),
        (one_state("-x/T", T="ms"), False),
        (one_state("-1000*x/T", T="ms"), True),
        (one_state("a*sin(w*t)", a="m/s", w="rad/s"), True),
        (one_state("a*sin(t)", a="m/s"), False),
        (one_state("a*sin(p)", a="m/s", p="deg"), False),
        (one_state("a*sin(p*pi/180)", a="m/s", p="deg"), True),
        (one_state("-k*sqrt(x)", k="m^0.5/s"), True),
        (one_state("-k*sqrt(x)", k="m/s"), False),
        (one_state("min(a, b)", a="m/s", b="m"), False),
        (one_state("a*max(x, 0)/b", a="m/s", b="m"), True),
        (one_state("a*exp(-x/b)", a="m/s", b="m"), True),
        (one_state("a*exp(-x)", a="m/s"), False),
        (one_state("a*(1 - x/b)", a="m/s", b="m"), True),
        (one_state("a*(1 - x)", a="m/s"), False),
        (one_state("a*tanh(x/b)**2", a="m/s", b="m"), True),
        (one_state("-k*sqrt(max(b - x, 0.01))", k="m^0.5/s", b="m"), True),
        (one_state("-k*sqrt(abs(b - x) + 1)", k="m^0.5/s", b="m"), True),
        (one_state("-k*sqrt(max(b - x, 0.01))", k="m/s", b="m"), False),
    ],
)
def test_functions_powers_and_bounds_are_looked_into(model, fits):
    assert (check_units(model) == ()) == fits


def test_a_model_file_that_does_not_fit_is_warned_of_with_its_line(tmp_path):
    path = tmp_path / "cart.yaml"
    cart(d="N/m").to_yaml(path)
    with pytest.warns(UnitWarning, match=r"cart.yaml:\d+:\d+: equations.v: the term -d\*v is in"):
        model = PhysicsModel.from_yaml(path)
    assert model == cart(d="N/m")
    cart().to_yaml(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PhysicsModel.from_yaml(path)


def test_a_number_that_converts_a_sum_is_seen_as_one():
    cell = PhysicsModel(
        {"v": "V"}, {"v": "-v"}, {"E": {"value": 3.0, "unit": "V"}},
        outputs={"converted": "1000*(E - v)", "half": "E - 0.5*v", "bare": "E - v"},
    )  # fmt: skip
    assert output_measure(cell, "converted") is None
    assert output_measure(cell, "half") == output_measure(cell, "bare") == read_unit("V")
