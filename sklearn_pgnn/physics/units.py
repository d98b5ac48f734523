"""Units as written in model files and headers: their meaning and conversion.

A unit is parsed by the same whitelist as an equation; pint knows the names, and multiplies them.
"""

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import parse_expression

if TYPE_CHECKING:
    from pint import Quantity, UnitRegistry

#: longest unit that is read
MAX_LENGTH = 60
#: least length of a name that may begin with a capital, as in Volts
WORD = 4
#: texts that stand for no unit
NONE = frozenset({"", "-", "1", "[]"})
#: signs and words that pint would read differently
_SPELLED = {"%": "percent", "°C": "degC", "℃": "degC", "°": "deg", "Ω": "ohm", "Ohm": "ohm"}
_SPELLED |= {"U/min": "rpm", "r/min": "rpm", "Umdr/min": "rpm", "Grad": "deg"}
_SPELLED |= {"µ": "u", "μ": "u", "·": " ", "⋅": " ", "⁻¹": "^-1", "⁻²": "^-2", "⁻³": "^-3"}
_SPELLED |= {"²": "^2", "³": "^3", "½": "^0.5"}
#: temperatures with a zero of their own
_SHIFTED = ("degree_Celsius", "degree_Fahrenheit")
_DOT = re.compile(r"(?<=[A-Za-z])\.(?=[A-Za-z])")
_NEWTON_METRE = re.compile(r"\b([kMmu]?)Nm\b")
_POWER = re.compile(r"\b([A-Za-z]+)([23]|-[1-4])\b")
_ANGLE = re.compile(r"rad|deg|rpm|rev|turn|arc")
_SMALL = 1e-9
#: common units, for messages
_COMMON = ("N", "N m", "W", "V", "ohm", "Pa", "N/m", "N s/m", "N/s", "m/s", "m/s^2", "1/s", "1/s^2")


def unit_text(quantity: "Quantity") -> str:
    """Return a quantity of size 1 in common units, else in base units, with the factor if not 1.

    >>> unit_text(read_unit("g m/s^2"))
    '0.001 N'
    """
    known = next((text for text in _COMMON if is_like(read_unit(text), quantity)), None)
    scaled = [] if abs(quantity.magnitude - 1) < _SMALL else [f"{quantity.magnitude:.4g}"]
    names: dict[str, Any] = {f"{_registry().Unit(n):~}": p for n, p in quantity.unit_items()}
    base = [n if p == 1 else f"{n}^{p:g}" for n, p in sorted(names.items()) if abs(p) > _SMALL]
    return " ".join([*scaled, *([known] if known else base)]) or "no unit"


def is_like(one: "Quantity | None", other: "Quantity | None") -> bool:
    """Whether two quantities are known and of one kind; an angle is a number."""
    if one is None or other is None:
        return False
    powers: Iterable[Any] = (one / other).dimensionality.values()
    return all(abs(power) < _SMALL for power in powers)


def product(quantities: Iterable["Quantity | None"]) -> "Quantity | None":
    """Return the product; None if one of its factors is unknown."""
    whole = no_unit()
    for each in quantities:
        if each is None:
            return None
        whole = whole * each
    return whole


def no_unit() -> "Quantity":
    """Return a plain 1."""
    return _registry().Quantity(1.0)


@lru_cache(maxsize=1024)
def read_unit(text: str) -> "Quantity | None":
    """Return a unit as a quantity in base units, None for an unknown unit."""
    if text.strip() in NONE:
        return no_unit()
    words = plain_unit(text)
    names = set(re.findall(r"[^\W\d]\w*", words))
    prefixed = re.sub(r"[^\W\d]\w*", lambda found: f"unit_{found[0]}", words)
    known = {f"unit_{n}": found for n in names if (found := _named(n)) is not None}
    if len(words) > MAX_LENGTH or len(known) < len(names):
        return None
    try:
        return _evaluated(parse_expression(prefixed, list(known), "unit"), known)
    except (ModelError, OverflowError):
        return None


def conversion(given: str, wanted: str) -> tuple[float, float] | None:
    """Return factor and offset of ``wanted = factor*given + offset``; None if there is neither.

    Examples
    --------
    >>> conversion("mm/s", "m/s"), conversion("N m", "N*m"), conversion("V", "N")
    ((0.001, 0.0), (1.0, 0.0), None)
    >>> conversion("degC", "K")
    (1.0, 273.15)
    """
    if plain_unit(given) == plain_unit(wanted):
        return 1.0, 0.0
    shifted = _temperature(given, wanted)
    if shifted is not None:
        return shifted
    one, other = read_unit(given), read_unit(wanted)
    if one is None or other is None or not is_like(one, other) or _may_count_turns(given, wanted):
        return None
    if is_like(one, read_unit("K")) and _has_own_zero(given) != _has_own_zero(wanted):
        return None
    return float(f"{one.magnitude / other.magnitude:.15g}"), 0.0


def _may_count_turns(*units: str) -> bool:
    """Whether one of two rates is of an angle, and the other counts turns or radians, as Hz may."""
    plain = [unit for unit in map(plain_unit, units) if not _ANGLE.search(unit)]
    rate = is_like(read_unit(units[0]), read_unit("1/s"))
    return rate and len(plain) == 1 and plain[0] not in ("1/s", "s**-1")


def plain_unit(text: str) -> str:
    """Return a unit with plain signs, ``*`` between its parts and ``**`` before its powers."""
    for sign, word in _SPELLED.items():
        text = text.replace(sign, word)
    text = _DOT.sub(" ", text.strip())
    text = _NEWTON_METRE.sub(r"\1N m", text).replace("^", "**")
    text = _POWER.sub(r"\1**\2", text)
    text = re.sub(r"(?<=[\w)])\s+(?=[\w(])", "*", text)
    return re.sub(r"\s+", "", text)


def _has_own_zero(unit: str) -> bool:
    """Whether a temperature such as 0.1 degC counts from a zero of its own, or may do so."""
    return any(_pint_name(name) in _SHIFTED for name in re.findall(r"[^\W\d]\w*", plain_unit(unit)))


def _temperature(given: str, wanted: str) -> tuple[float, float] | None:
    """Return the conversion between two temperatures, whose zeros differ."""
    pair = (plain_unit(given), plain_unit(wanted))
    if not any(_pint_name(name) in _SHIFTED for name in pair):
        return None
    pair = _pint_name(pair[0]), _pint_name(pair[1])
    try:
        zero, ten = (_registry().Quantity(x, pair[0]).to(pair[1]).magnitude for x in (0.0, 10.0))
    except Exception:  # another kind's, or no name at all
        return None
    return float(f"{(ten - zero) / 10:.12g}"), float(f"{zero:.12g}")


@lru_cache(maxsize=1)
def _registry() -> "UnitRegistry":
    import pint  # takes half a second

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


def _named(name: str) -> "Quantity | None":
    """Return a named unit in base units: none for an angle, a difference for a temperature."""
    registry, known = _registry(), _pint_name(name)
    if known in _SHIFTED:
        known = f"delta_{known}"
    if not known or not registry.Quantity(1.0, known)._is_multiplicative:  # decibels are no factor
        return None
    found = registry.Quantity(1.0, known).to_base_units()
    return found / registry.radian ** dict(found.unit_items()).get("radian", 0)


@lru_cache(maxsize=1024)
def _pint_name(name: str) -> str:
    """Return pint's own name of a unit, which may begin with a capital; empty for none."""
    registry, words = _registry(), [name]
    if len(name) >= WORD and name.istitle():
        words.append(name.lower())
    for word in words if name.isidentifier() else ():
        with suppress(Exception):  # pint has a dozen ways to say that a name is none
            return registry.get_name(word)
    return ""


def _evaluated(expression: sympy.Expr, known: Mapping[str, "Quantity"]) -> "Quantity | None":
    """Return an expression of units; None where it is no product of powers."""
    if expression.is_number:
        return float(expression) * no_unit() if expression.is_positive else None
    if isinstance(expression, sympy.Symbol):
        return known[str(expression)]
    if isinstance(expression, sympy.Pow) and expression.exp.is_number:
        base = _evaluated(expression.base, known)
        return None if base is None else base ** float(expression.exp)
    if not isinstance(expression, sympy.Mul):
        return None
    return product(_evaluated(part, known) for part in expression.args)
