"""Cells and lists as error messages show them: never longer than a line or two."""

import json
import re
from collections.abc import Iterable
from typing import Any

#: longest text of a cell, of a list, and of a whole sentence
SHORT, LISTED, SAID = 60, 300, 1200
#: names that YAML reads as they stand, and those of them that it does not read as texts
_PLAIN = re.compile(r"[^\W\d][\w./-]*(?: [\w./-]+)*|/[\w./-]+")
_WORDS = frozenset({"y", "n", "yes", "no", "on", "off", "true", "false", "null"})


def cut(text: str, most: int) -> str:
    """Return the beginning of a text that is too long.

    >>> cut("0123456789", 8)
    '01234...'
    """
    return text if len(text) <= most else f"{text[: most - 3]}..."


def shown(cell: Any) -> str:
    """Return a cell, a text in quotes.

    >>> shown("off"), shown(1.5), len(shown(10**6 * "9"))
    ("'off'", '1.5', 62)
    """
    return repr(cut(cell, SHORT)) if isinstance(cell, str) else cut(str(cell), SHORT)


def listed(names: Iterable[str]) -> str:
    """Return names, separated by commas."""
    return cut(", ".join(cut(name, SHORT) for name in names), LISTED)


def as_yaml(name: str) -> str:
    """Return a name as a model file has to write it, in quotes where YAML would read another.

    >>> print(as_yaml("speed"), as_yaml("speed: raw"), as_yaml("'t'"), as_yaml("no"))
    speed "speed: raw" "'t'" "no"
    """
    plain = _PLAIN.fullmatch(name) and name.lower() not in _WORDS
    return name if plain else json.dumps(name, ensure_ascii=False)
