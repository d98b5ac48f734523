"""A finding: a fault of the records, and its remedy."""

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
