"""Units of outputs follow from their expressions, by the rules of dimensions."""

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.physics.effects import QuadraticDrag, StribeckFriction
from sklearn_pgnn.physics.effects.rates import worded_for
from sklearn_pgnn.physics.units import conversion

pytestmark = pytest.mark.core

UNITS = {"k": "V s/rad", "l": "m", "m": "kg", "c": "N/m", "n": "", "d": "N s/m", "R": "ohm"}


def machine(expression):
    return PhysicsModel(
        {"x": "m", "v": "m/s", "th": "rad", "w": "rad/s", "i": "A"},
        {"x": "v", "v": "-v", "th": "w", "w": "-w", "i": "-i"},
        {name: {"value": 1.0, "unit": unit} for name, unit in UNITS.items()},
        outputs={"seen": expression},
    )


@pytest.mark.parametrize(("expression", "unit"), [
    ("k*w", "V"), ("l*w", "m/s"), ("l*sin(th)", "m"), ("x + l*sin(th)", "m"), ("-w", "rad/s"),
    ("abs(v)", "m/s"), ("c*x + d*v", "N"), ("v/l", "1/s"), ("v**2/l", "m/s^2"), ("R*i", "V"),
    ("x - 0.1", "m"), ("c*x*v", "W"), ("l*w**2", "m/s^2"), ("m*l**2", "kg m^2"),
    ("sqrt(x**2)", "m"),
])  # fmt: skip
def test_the_unit_of_an_output_follows_from_its_expression(expression, unit):
    assert machine(expression).unit("seen") == unit


@pytest.mark.parametrize(
    "expression", ["1000*x", "n*x", "x + v", "30*w/pi", "x/l", "sin(th)", "x**0.3"]
)
def test_no_unit_is_claimed_where_a_number_may_convert_or_nothing_is_known(expression):
    assert machine(expression).unit("seen") == ""


@pytest.mark.parametrize("seed", range(5))
def test_products_of_units_are_those_of_pint(seed):
    pytest.importorskip("pint")
    rng, known = np.random.default_rng(seed), ["N", "m/s", "kg", "V s", "1/s", "N/(m s)", "kg m^2"]
    one, other = rng.choice(known, 2)
    model = PhysicsModel(
        {"x": "m"},
        {"x": "-x"},
        {"a": {"value": 1.0, "unit": one}, "b": {"value": 1.0, "unit": other}},
        outputs={"product": "a*b + 0*x", "quotient": "a*x/b"},
    )
    assert conversion(model.unit("product"), f"({one})*({other})") == pytest.approx((1.0, 0.0))
    assert conversion(model.unit("quotient"), f"({one})*m/({other})") == pytest.approx((1.0, 0.0))


def test_a_check_speaks_of_torque_where_the_machine_turns():
    turning = PhysicsModel(
        {"w": "rad/s"}, {"w": "-d*w/J"}, {"J": {"value": 1.0, "unit": "kg m^2"}, "d": 1.0},
        inertia={"w": "J"},
    )  # fmt: skip
    sliding = PhysicsModel(
        {"v": "m/s"}, {"v": "-d*v/m"}, {"m": {"value": 1.0, "unit": "kg"}, "d": 1.0},
        inertia={"v": "m"},
    )  # fmt: skip
    for kind in (StribeckFriction, QuadraticDrag):
        _, check = worded_for(turning, kind("w"))
        assert "torque" in check
        assert "force" not in check
        assert worded_for(sliding, kind("v")) == (kind.summary, kind.check)
    assert "level plus the peak" in StribeckFriction.summary
