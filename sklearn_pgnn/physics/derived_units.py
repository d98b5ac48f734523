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

    Examples
    --------
    >>> flow_unit("J"), flow_unit("F V"), flow_unit("m^3"), flow_unit("")
    ('W', 'A', 'm^3/s', '')
    """
    unit = rate_unit(content) if content else ""
    return _FLOWS.get(unit, unit)


def rate_unit(unit: str) -> str:
    """Return the unit of the rate of change per second of a quantity.

    Examples
    --------
    >>> rate_unit("m/s"), rate_unit("V"), rate_unit("")
    ('m/s^2', 'V/s', '1/s')
    """
    return tidy_unit(f"{unit.strip()}/s")


def force_unit(inertia: str, velocity: str) -> str:
    """Return the unit of an inertia times the rate of a velocity.

    Examples
    --------
    >>> force_unit("kg", "m/s"), force_unit("kg*m²", "rad/s"), force_unit("kg", "mm/s")
    ('N', 'N m', 'kg mm/s^2')
    """
    inertia, rate = inertia.strip(), rate_unit(velocity)
    written = inertia.replace("*", " ").replace("²", "^2")
    product = f"{inertia}{rate[1:]}" if inertia and rate.startswith("1/") else f"{inertia} {rate}"
    return _FORCES.get((written, rate), product.strip())


def tidy_unit(unit: str) -> str:
    """Return a unit without the remains of its empty or dimensionless parts.

    Examples
    --------
    >>> tidy_unit("N/(m)^3"), tidy_unit("N/()^3"), tidy_unit("/s"), tidy_unit("m/s/s")
    ('N/m^3', 'N', '1/s', 'm/s^2')
    """
    unit = re.sub(r"/(1|\(1?\))?(\^\d+)?(?=$|\s)", "", unit.strip())
    unit = re.sub(r"\((\w+)\)", r"\1", unit)
    unit = re.sub(r"/s/s$", "/s^2", unit)
    return f"1{unit}" if unit.startswith("/") else unit
