"""A finding: a fault of the records, and its remedy."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """A fault of the records that limits a diagnosis.

    Parameters
    ----------
    kind : str
        Kind of fault.
    where : str
        The quantity, and the record if a single one is concerned.
    text : str
        The observation, in one sentence.
    value : float
        Size or number of occurrences.
    remedy : str
        The remedy.

    Examples
    --------
    >>> finding = Finding("clipping", "phi", "phi stays at 1.2 rad", 34.0, "drive it less")
    >>> finding.where
    'phi'
    """

    kind: str
    where: str
    text: str
    value: float
    remedy: str


def listed(items: Iterable[str]) -> str:
    """Return a list as in a sentence, with "and" before its last entry.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    items = list(items)
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)
