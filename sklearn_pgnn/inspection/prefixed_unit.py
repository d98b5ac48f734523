"""The unit that a power of ten makes of another: metres of millimetres, grams of kilograms."""

import re

#: prefixes by their power of ten
_PREFIXES = {-9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
#: units that take them
_LETTERS = ("m", "g", "s", "A", "K", "N", "W", "V", "J", "F", "H", "T", "C", "l", "L")
_WORDS = ("Pa", "Hz", "rad", "ohm", "Ω", "bar", "Nm", "Wb", "VA", "mol")
#: a unit that begins with a name, without a power, and what comes after it
_PARTS = re.compile(r"([^\W\d_]++)(?!\^|\*\*|[²³\d])(.*)")


def prefixed_unit(unit: str, power: int) -> str:
    """Return the unit of which there are ten to a power in another; empty where it has no name.

    Examples
    --------
    >>> prefixed_unit("mm", -3), prefixed_unit("mm/s", 3), prefixed_unit("kg", 3)
    ('m', 'um/s', 'g')
    >>> prefixed_unit("degC", 3), prefixed_unit("mm^2", 3)
    ('', '')
    """
    parts = _PARTS.fullmatch(unit)
    own, symbol = _read(parts[1]) if parts else (0, "")
    prefix = _PREFIXES.get(own - power)
    return f"{prefix}{symbol}{parts[2]}" if parts and symbol and prefix is not None else ""


def _read(name: str) -> tuple[int, str]:
    """Return the power of ten of a name's prefix, and the name without it; empty if unknown."""
    if name in (*_LETTERS, *_WORDS):
        return 0, name
    for power, prefix in _PREFIXES.items():
        if prefix and name.removeprefix(prefix) in (*_LETTERS, *_WORDS) and name[0] == prefix:
            return power, name[1:]
    return 0, ""
