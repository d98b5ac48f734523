"""Units of expressions in a model's quantities, and of what is derived from others."""

import re
from collections.abc import Callable, Mapping
from fractions import Fraction

import sympy

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


#: a name in a unit with its power, and what stands before it
_PART = re.compile(r"([/ *·]*)(°?[^\W\d]+|%|°|Ω)(?:(?:\^|\*\*)?([-+]?\d+))?")
#: products that have a name
_NAMED = {"A V": "W", "N m/s": "W", "kg m/s^2": "N", "A s": "C", "A Ω": "V", "A ohm": "V"}
#: functions whose value is a plain number
_NUMBERS = (sympy.sin, sympy.cos, sympy.tan, sympy.tanh, sympy.sign, sympy.exp, sympy.log)


def unit_of(expression: sympy.Expr | None, unit: Callable[[str], str]) -> str:
    """Return the unit of an expression, from the units of its quantities.

    It is empty where a quantity has no unit, where a number may be the conversion to another unit,
    where the parts of a sum differ, or where the unit cannot be told. An angle counts as a number
    in a product with other quantities.

    >>> x, y, k, w, C, T = sympy.symbols("x y k w C T")
    >>> units = {"x": "m", "y": "m", "k": "V s/rad", "w": "rad/s", "C": "J/K", "T": "degC"}
    >>> [unit_of(each, units.get) for each in (x + y, k * w, x * w, w / k, 3.6 * x, C * T)]
    ['m', 'V', 'm/s', '1/(V s^2)', '', 'J']
    """
    if isinstance(expression, sympy.Symbol):
        return unit(str(expression))
    powers = None if expression is None else _powers(expression, unit)
    return "" if powers is None else _written(powers)


def _powers(expression: sympy.Expr, unit: Callable[[str], str]) -> dict[str, Fraction] | None:
    """Return the powers of the units of an expression; None where they cannot be told."""
    if isinstance(expression, sympy.Symbol):
        return _read(unit(str(expression)))
    if isinstance(expression, _NUMBERS) or expression == -1:
        return {}
    if isinstance(expression, sympy.Pow) and expression.exp.is_Rational:
        base, power = _powers(expression.base, unit), expression.exp
        return base and {n: p * Fraction(power.p, power.q) for n, p in base.items()}
    if isinstance(expression, sympy.Mul):
        return _product([_of_factor(part, unit) for part in expression.args])
    if isinstance(expression, sympy.Add | sympy.Max | sympy.Min | sympy.Abs):
        return _common(expression, unit)
    return None


def _of_factor(expression: sympy.Expr, unit: Callable[[str], str]) -> dict[str, Fraction] | None:
    """Return the powers of a factor; a sum with a number counts as a number."""
    is_sum = isinstance(expression, sympy.Add)
    is_number = is_sum and any(part.is_number for part in expression.args)
    return {} if is_number else _powers(expression, unit)


def _common(expression: sympy.Expr, unit: Callable[[str], str]) -> dict[str, Fraction] | None:
    """Return what all parts of a sum or a bound have that are not numbers."""
    first, *others = (_powers(part, unit) for part in expression.args if not part.is_number)
    return first if all(other == first for other in others) else None


def _product(parts: list[dict[str, Fraction] | None]) -> dict[str, Fraction] | None:
    """Return the powers of a product, without an angle beside other quantities."""
    whole: dict[str, Fraction] = {}
    for part in parts:
        if part is None:
            return None
        for name, power in part.items():
            name = "K" if name in ("degC", "°C") else name  # a difference of two
            whole[name] = whole.get(name, Fraction(0)) + power
    kept = {name: power for name, power in whole.items() if power}
    is_angle = not set(kept) - {"rad", "s"}
    return kept if is_angle else {n: p for n, p in kept.items() if n != "rad"}


def _read(unit: str) -> dict[str, Fraction] | None:
    """Return the powers in a unit such as ``N m/(rad/s)^2``; None for none, or another form.

    >>> {name: int(power) for name, power in _read("V s/rad").items()}, _read("N/(m s)")["s"] < 0
    ({'V': 1, 's': 1, 'rad': -1}, True)
    >>> _read(""), _read("1"), _read("m^0.5")
    (None, {}, None)
    """
    text = unit.strip().replace("²", "^2").replace("³", "^3")
    if text == "1":
        return {}
    above, _, below = text.partition("/(")
    if below:
        inner = _read(below[:-1]) if below.endswith(")") and "(" not in below else None
        outer = _read(above) if above != "1" else {}
        return None if inner is None or outer is None else _product([outer, _inverse(inner)])
    text = re.sub(r"^1(?=/)", "", text)
    if not text or _PART.sub("", text):
        return None
    powers: dict[str, Fraction] = {}
    for before, name, power in _PART.findall(text):
        sign = -1 if "/" in before else 1
        powers[name] = powers.get(name, Fraction(0)) + sign * int(power or 1)
    return powers


def _inverse(powers: Mapping[str, Fraction]) -> dict[str, Fraction]:
    return {name: -power for name, power in powers.items()}


def _written(powers: Mapping[str, Fraction]) -> str:
    """Return powers as a unit; empty where one is no integer."""
    if any(power.denominator != 1 for power in powers.values()):
        return ""
    order = sorted(powers, key=lambda name: (abs(powers[name]), name))
    above = [_part(name, int(powers[name])) for name in order if powers[name] > 0]
    below = [_part(name, int(-powers[name])) for name in order if powers[name] < 0]
    under = f"({' '.join(below)})" if len(below) > 1 else "".join(below)
    text = " ".join(above) or ("1" if below else "")
    text = f"{text}/{under}" if under else text
    return _NAMED.get(text, text)


def _part(name: str, power: int) -> str:
    return name if power == 1 else f"{name}^{power}"
