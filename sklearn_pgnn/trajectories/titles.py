"""Titles of columns: a name and its unit, as in ``force [N]``, ``force / N`` or ``force in N``."""

import re
from collections.abc import Iterator

from sklearn_pgnn.physics.units import read_unit

_BRACKETS = re.compile(r"\s*(?:\[([^]]*)\]|\(([^)]*)\)|\{([^}]*)\}|<([^>]*)>)$")
_BEFORE_UNIT = re.compile(r"\s*/\s*|\s*,\s*|\s*:\s+|\s+(?:in|en)\s+")
#: longest title in which a unit is looked for
LONGEST = 200


def split_title(title: str) -> tuple[str, str]:
    """Return the name and the unit of a column, empty if there is none.

    Text in round brackets may be a remark; a known unit stands behind a slash, a comma, a colon or
    ``in``.

    Examples
    --------
    >>> split_title("torque [N m]"), split_title("speed / m/s"), split_title("Weg in mm")
    (('torque', 'N m'), ('speed', 'm/s'), ('Weg', 'mm'))
    >>> split_title("valve in use"), split_title("/joints/position")
    (('valve in use', ''), ('/joints/position', ''))
    """
    bracketed = _bracketed(title)
    if bracketed is not None:
        return bracketed
    return next(((name, unit) for name, unit in _parts(title) if _is_unit(unit)), (title, ""))


def is_called(title: str, name: str) -> bool:
    """Whether a column has a name, be it with a unit behind it."""
    if not title.startswith(name):
        return False
    bracketed = _bracketed(title)
    if bracketed is not None:
        return bracketed[0] == name
    return any(first == name and _is_unit(unit) for first, unit in _parts(title))


def name_of(title: str) -> str:
    """Return the name in a title, without the unit."""
    return split_title(title)[0]


def unit_of(title: str) -> str:
    """Return the unit in a title, empty if there is none."""
    return split_title(title)[1]


def bracketed_unit(title: str) -> str:
    """Return the unit in brackets at the end of a text, empty if there is none."""
    return (_bracketed(title) or ("", ""))[1]


def _bracketed(title: str) -> tuple[str, str] | None:
    found = _BRACKETS.search(title[-LONGEST:]) if title[-1:] in (*"])}>",) else None
    if found is None:
        return None
    unit = next(group for group in found.groups() if group is not None).strip()
    return title[: len(title) - len(found[0])], unit


def _parts(title: str) -> Iterator[tuple[str, str]]:
    """Return every way to split a title at a slash, a comma or ``in``; a path has none."""
    if title.startswith("/") or len(title) > LONGEST:
        return
    for found in _BEFORE_UNIT.finditer(title):
        if found.start() and found.end() < len(title):
            yield title[: found.start()], title[found.end() :]


def _is_unit(text: str) -> bool:
    return text == "%" or (not text.isdecimal() and read_unit(text) is not None)
