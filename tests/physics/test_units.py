"""Units as people write them: what they measure, how they are converted, what is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
