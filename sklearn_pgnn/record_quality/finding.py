"""A finding: a fault of the records, and its remedy."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """A fault of the records that limits a diagnosis.

    Parameters
    ----------
    kind : str
        What sort of fault.
    where : str
        The quantity, and the record where it is one.
    text : str
        What was seen, in one sentence.
    value : float
        How large or how often.
    remedy : str
        What to do about it.

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
