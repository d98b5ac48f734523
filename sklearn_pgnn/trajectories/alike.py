"""Similarity of the names and units of columns to those of a model."""

import re
from difflib import SequenceMatcher

from sklearn_pgnn.physics.units import conversion, plain_unit

#: fraction of their letters that similar names share, in order
LETTERS = 0.75
#: least length of a name that counts as similar to a longer one that begins with it
BEGINNING = 3


def likeness(own: str, theirs: str) -> tuple[int, float]:
    """Return how many words, and what fraction of their letters, two names share, for a ranking.

    Examples
    --------
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
