"""A finding: what in the records stands in the way, and what to do about it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """What in the records stands in the way of a diagnosis.

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
