"""A finding: a fault of the records, and its remedy."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from sklearn_pgnn.estimation.plain_data import plain


@dataclass(frozen=True)
class Finding:
    """A fault of the records that limits a diagnosis.

    Parameters
    ----------
    kind : str
        Kind of fault; ``sklearn-pgnn explain`` tells of each.
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
    >>> finding.where, finding.code
    ('phi', 'clipping')
    """

    kind: str
    where: str
    text: str
    value: float
    remedy: str

    @property
    def code(self) -> str:
        """Its kind as the code that ``sklearn-pgnn explain`` takes, as in ``"dropped_samples"``."""
        return self.kind.replace(" ", "_")

    @property
    def said(self) -> str:
        """The observation and the remedy in sentences."""
        return f"{self.text}. Remedy: {self.remedy}." if self.remedy else f"{self.text}."

    def to_dict(self) -> dict:
        """Return the finding as plain data."""
        return {"code": self.code, **plain(self)}


def finding_of(kind: str, said: str, where: str = "") -> Finding:
    """Return a remark, which has its remedy in its last sentence, as a finding without a size.

    >>> finding_of("poor fit", "'v' is not followed. Remedy: check the equations.", "v").remedy
    'check the equations'
    """
    text, _, remedy = said.removesuffix(".").partition(". Remedy: ")
    return Finding(kind, where, text, math.nan, remedy)


def listed(items: Iterable[str]) -> str:
    """Return a list as in a sentence, with "and" before its last entry.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    items = list(items)
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)
