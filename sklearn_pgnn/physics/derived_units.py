"""Units derived from others: of a rate, of a force, and of a quotient."""

import re

#: units of a force, by the units of the inertia and of the rate of the velocity
_FORCES = {
    ("kg", "m/s^2"): "N",
    ("t", "m/s^2"): "kN",
    ("kg m^2", "rad/s^2"): "N m",
    ("kg m^2", "1/s^2"): "N m",
}
#: units of an effort, by the unit of its flow
EFFORTS = {"m/s": "N", "rad/s": "N m"}
#: units of what flows into a store, by the unit of its content per second
_FLOWS = {"J/s": "W", "C/s": "A", "F V/s": "A", "A H/s": "V", "Wb/s": "V"}


def flow_unit(content: str) -> str:
    """Return the unit of what flows into a store, by the unit of its content.

    >>> flow_unit("J"), flow_unit("F V"), flow_unit("m^3"), flow_unit("")
    ('W', 'A', 'm^3/s', '')
    """
    unit = rate_unit(content) if content else ""
    return _FLOWS.get(unit, unit)


def rate_unit(unit: str) -> str:
    """Return the unit of the rate of change per second of a quantity."""
    return tidy_unit(f"{unit.strip()}/s")


def force_unit(inertia: str, velocity: str) -> str:
    """Return the unit of an inertia times the rate of a velocity."""
    inertia, rate = inertia.strip(), rate_unit(velocity)
    written = inertia.replace("*", " ").replace("²", "^2")
    product = f"{inertia}{rate[1:]}" if inertia and rate.startswith("1/") else f"{inertia} {rate}"
    return _FORCES.get((written, rate), product.strip())


def tidy_unit(unit: str) -> str:
    """Return a unit without the remains of its empty or dimensionless parts."""
    unit = re.sub(r"/(1|\(1?\))?(\^\d+)?(?=$|\s)", "", unit.strip())
    unit = re.sub(r"\((\w+)\)", r"\1", unit)
    unit = re.sub(r"/s/s$", "/s^2", unit)
    return f"1{unit}" if unit.startswith("/") else unit
