"""Units as written in model files and headers: their meaning and conversion.

A unit is parsed by the same whitelist as an equation; pint (extra ``units``) knows the names.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.expressions import parse_expression

#: longest unit that is read
MAX_LENGTH = 60
#: texts that stand for no unit
NONE = frozenset({"", "-", "1", "[]"})
#: signs and words that pint would read differently
_SPELLED = {"%": "percent", "°C": "degC", "℃": "degC", "°": "deg", "Ω": "ohm", "Ohm": "ohm"}
_SPELLED |= {"µ": "u", "μ": "u", "·": " ", "⋅": " ", "²": "^2", "³": "^3", "½": "^0.5"}
_NEWTON_METRE = re.compile(r"\b([kMmu]?)Nm\b")
_SQUARE = re.compile(r"\b([A-Za-z]+)([23])\b")
_SMALL = 1e-9
#: common units, for messages
_COMMON = ("N", "N m", "W", "V", "ohm", "Pa", "N/m", "N s/m", "N/s", "m/s", "m/s^2", "1/s", "1/s^2")


@dataclass(frozen=True)
class Measure:
    """The measure of a unit: its size in base units, and their powers.

    Parameters
    ----------
    factor : float
        Size of the unit in base units.
    powers : tuple of (str, float)
        Powers of the base units, by name; an angle has none.
    """

    factor: float = 1.0
    powers: tuple[tuple[str, float], ...] = ()

    def __mul__(self, other: "Measure") -> "Measure":
        powers = dict(self.powers)
        for name, power in other.powers:
            powers[name] = powers.get(name, 0.0) + power
        return _measure(self.factor * other.factor, powers)

    def __pow__(self, exponent: float) -> "Measure":
        return _measure(self.factor**exponent, {n: p * exponent for n, p in self.powers})

    def __truediv__(self, other: "Measure") -> "Measure":
        return self * other**-1.0

    def is_like(self, other: "Measure") -> bool:
        """Return whether another measure is of the same kind of quantity."""
        return self.powers == other.powers

    def to_text(self) -> str:
        """Return the measure in common units, else in base units, with the factor if not 1.

        Examples
        --------
        >>> Measure(1e-3, (("kg", 1.0), ("m", 1.0), ("s", -2.0))).to_text()
        '0.001 N'
        """
        known = _common().get(self.powers)
        base = (n if power == 1 else f"{n}^{power:g}" for n, power in self.powers)
        scaled = [] if abs(self.factor - 1) < _SMALL else [f"{self.factor:.4g}"]
        return " ".join([*scaled, *([known] if known else base)]) or "no unit"


def _measure(factor: float, powers: Mapping[str, float]) -> Measure:
    kept = {name: round(power, 9) for name, power in sorted(powers.items())}
    return Measure(factor, tuple((n, p) for n, p in kept.items() if p))


def product(measures: Iterable[Measure | None]) -> Measure | None:
    """Return the measure of a product; None if one of its factors is unknown."""
    whole = Measure()
    for each in measures:
        if each is None:
            return None
        whole = whole * each
    return whole


def read_unit(text: str) -> Measure | None:
    """Return the measure of a unit.

    Parameters
    ----------
    text : str
        The unit, as in ``"kg m^2"``, ``"N/(m/s)^2"`` or ``"rpm"``.

    Returns
    -------
    Measure or None
        Its size and its base units; None for an unknown unit.

    Raises
    ------
    ModuleNotFoundError
        If pint is not installed.

    Examples
    --------
    >>> read_unit("kN/mm").to_text(), read_unit("kg/mol").to_text(), read_unit("bananas")
    ('1e+06 N/m', 'kg mol^-1', None)
    """
    if text.strip() in NONE:
        return Measure()
    words = plain_unit(text)
    names = set(re.findall(r"[^\W\d]\w*", words))
    prefixed = re.sub(r"[^\W\d]\w*", lambda found: f"unit_{found[0]}", words)
    known = {f"unit_{n}": found for n in names if (found := _named(n)) is not None}
    if len(words) > MAX_LENGTH or len(known) < len(names):
        return None
    try:
        return _evaluated(parse_expression(prefixed, list(known), "unit"), known)
    except ModelError:
        return None


def conversion(given: str, wanted: str) -> tuple[float, float] | None:
    """Return the conversion from one unit to another.

    Parameters
    ----------
    given, wanted : str
        The units.

    Returns
    -------
    tuple of float or None
        Factor and offset, as in ``wanted = factor*given + offset``; None if there is no conversion.

    Raises
    ------
    ModuleNotFoundError
        If the units are written differently and pint is not installed.

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
    if one is None or other is None or not one.is_like(other):
        return None
    return float(f"{one.factor / other.factor:.15g}"), 0.0


@lru_cache(maxsize=1)
def _common() -> dict[tuple, str]:
    """Return the common units by the powers of their base units."""
    return {found.powers: text for text in _COMMON if (found := read_unit(text)) is not None}


def plain_unit(text: str) -> str:
    """Return a unit with plain signs, ``*`` between its parts and ``**`` before its powers.

    Parameters
    ----------
    text : str
        The unit as it was written.

    Returns
    -------
    str
        The unit in one form, the same for all usual spellings.

    Examples
    --------
    >>> plain_unit("kg m²/(s A)"), plain_unit("mNm"), plain_unit("m/s2")
    ('kg*m**2/(s*A)', 'mN*m', 'm/s**2')
    """
    for sign, word in _SPELLED.items():
        text = text.replace(sign, word)
    text = _NEWTON_METRE.sub(r"\1N m", text.strip()).replace("^", "**")
    text = _SQUARE.sub(r"\1**\2", text)
    text = re.sub(r"(?<=[\w)])\s+(?=[\w(])", "*", text)
    return re.sub(r"\s+", "", text)


def _temperature(given: str, wanted: str) -> tuple[float, float] | None:
    """Return the conversion between two temperatures, whose zeros differ."""
    pair = (plain_unit(given), plain_unit(wanted))
    if not any(name in ("degC", "degF") for name in pair):
        return None
    try:
        zero, ten = (_registry().Quantity(x, pair[0]).to(pair[1]).magnitude for x in (0.0, 10.0))
    except Exception:  # pint has a dozen ways to say that a name is none, or another kind's
        return None
    return float(f"{(ten - zero) / 10:.12g}"), float(f"{zero:.12g}")


@lru_cache(maxsize=1)
def _registry():
    with needed_by("Reading a unit"):
        import pint
    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


@lru_cache(maxsize=1024)
def _named(name: str) -> Measure | None:
    """Return the measure of a named unit: none for an angle, a difference for a temperature."""
    registry = _registry()
    if name in ("degC", "degF"):
        name = f"delta_{name}"
    try:
        found = registry.Quantity(1.0, name).to_base_units()
    except Exception:  # see `_temperature`
        return None
    powers = {f"{registry.Unit(n):~}": float(p) for n, p in found.unit_items() if n != "radian"}
    return _measure(float(found.magnitude), powers)


def _evaluated(expression, known: Mapping[str, Measure]) -> Measure | None:
    """Return what an expression of units measures; None where it is no product of powers."""
    if expression.is_number:
        return Measure(float(expression)) if expression.is_positive else None
    if isinstance(expression, sympy.Symbol):
        return known[str(expression)]
    if isinstance(expression, sympy.Pow) and expression.exp.is_number:
        base = _evaluated(expression.base, known)
        return None if base is None else base ** float(expression.exp)
    if not isinstance(expression, sympy.Mul):
        return None
    return product(_evaluated(part, known) for part in expression.args)
