"""A record: one trajectory of a machine, as measured."""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.user_line import warn_user


@dataclass(frozen=True)
class Record:
    """One trajectory.

    Parameters
    ----------
    t : ndarray of shape (n_samples,)
        Time [s], increasing.
    u : ndarray of shape (n_samples, n_inputs)
        Inputs.
    y : ndarray of shape (n_samples, n_outputs) or None
        Measured outputs, NaN where there is no value; None if only inputs are known.
    x0 : ndarray of shape (n_states,)
        Initial state, NaN where unknown.
    name : str
        Name of the trajectory.
    rows : ndarray of shape (n_samples,)
        Row numbers of its samples in the original table.
    origin : float, default=0
        Offset subtracted from the table's clock [s], which showed ``origin + t``.
    """

    t: np.ndarray
    u: np.ndarray
    y: np.ndarray | None
    x0: np.ndarray
    name: str
    rows: np.ndarray
    origin: float = 0.0

    @property
    def is_measured(self) -> bool:
        """Whether any output was measured."""
        return self.y is not None and bool(np.isfinite(self.y).any())


# -- records that are given twice: what is held out of a fit was then fitted -----------------------

REMEDY = "give every record once: held-out errors and intervals count it as new evidence"


def repeated_records(records: Sequence[Record]) -> list[tuple[str, str]]:
    """Return the pairs of records of the same content, whatever their names and clocks say."""
    first: dict[tuple[str, str], str] = {}
    pairs = []
    for record in records:
        content = _content(record)
        if content in first:
            pairs.append((first[content], record.name))
        first.setdefault(content, record.name)
    return pairs


def _content(record: Record) -> tuple[str, str]:
    """Return duration and values; a clock that begins elsewhere is rounded otherwise."""
    values = [np.ascontiguousarray(part) for part in (record.u, record.y) if part is not None]
    told = sha256(b"".join(part.tobytes() for part in values)).hexdigest()
    return f"{record.t[-1] - record.t[0]:.6g}", told


def remarks_on_repeats(records: Sequence[Record]) -> list[str]:
    """Return a sentence for every record that was given before."""
    return [f"record {b!r} has the same values as {a!r}" for a, b in repeated_records(records)]


def warn_of_repeats(records: Sequence[Record]) -> None:
    """Warn of records that are given twice."""
    for remark in remarks_on_repeats(records):
        warn_user(f"{remark}. Remedy: {REMEDY}.", RecordWarning)
