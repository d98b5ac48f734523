"""Units that follow from others agree with what pint makes of them."""

import pint
import pytest

from sklearn_pgnn import PhysicsModel, systems
from sklearn_pgnn.physics.derived_units import force_unit, rate_unit, tidy_unit
from sklearn_pgnn.physics.effects import CubicStiffness, QuadraticDrag, ViscousFriction

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
