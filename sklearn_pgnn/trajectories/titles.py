"""Titles of columns: names and units, as in ``force [N]``, and how alike they are to others."""

import re
from collections.abc import Iterator
from difflib import SequenceMatcher

from sklearn_pgnn.physics.units import conversion, plain_unit, read_unit

_BRACKETS = re.compile(r"\s*(?:\[([^]]*)\]|\(([^)]*)\)|\{([^}]*)\}|<([^>]*)>)$")
_BEFORE_UNIT = re.compile(r"\s*/\s*|\s*,\s*|\s*:\s+|\s+(?:in|en)\s+")
#: longest title in which a unit is looked for
LONGEST = 200


def split_title(title: str) -> tuple[str, str]:
    """Return the name and the unit of a column, in brackets or behind a slash, a comma, ``in``."""
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


# -- likeness to the names and units of a model ----------------------------------------------------

#: fraction of their letters that similar names share, in order
LETTERS = 0.75
#: least length of a name that counts as similar to a longer one that begins with it
BEGINNING = 3


def likeness(own: str, theirs: str) -> tuple[int, float]:
    """Return how many words, and what fraction of their letters, two names share, for a ranking.

    >>> likeness("motor_force", "Force (raw)")
    (1, 0.454...)
    """
    letters = SequenceMatcher(None, own.lower(), theirs.lower()).ratio()
    return len(_words(own) & _words(theirs)), letters


def names_alike(own: str, theirs: str) -> bool:
    """Whether two names share a word or most of their letters, or one begins the other."""
    words, letters = likeness(own, theirs)
    short, long = sorted((own.lower(), theirs.lower()), key=len)
    begins = len(short) >= BEGINNING and long.startswith(short)
    return words > 0 or begins or letters >= LETTERS


def units_alike(own: str, theirs: str) -> bool:
    """Whether two units are known to measure the same; False if either is missing."""
    if not (own and theirs):
        return False
    same = plain_unit(own) == plain_unit(theirs)
    return same or conversion(theirs, own) is not None


def _words(name: str) -> set[str]:
    """Return the words of a name; a number alone does not count as a word."""
    return set(re.findall(r"[^\W\d_]+", name.lower()))
