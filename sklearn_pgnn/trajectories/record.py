"""A record: one trajectory of a machine, as measured."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import pairwise

import numpy as np

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.user_line import warn_user

#: fewest samples of a trajectory with outputs
MIN_SAMPLES = 4


@dataclass(frozen=True)
class Record:
    """One trajectory, whose clock showed ``origin + t``; NaN stands for what is unknown."""

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


# -- records split at gaps -------------------------------------------------------------------------


def split_at_gaps(records: tuple[Record, ...], longest: float, samples: int) -> tuple[Record, ...]:
    """Split records at gaps: long intervals in which the inputs are unknown.

    An interval is long if it exceeds both the longest time that a simulation may bridge [s] and so
    many of the record's usual intervals. Where every input is the same before and after it, as
    where a logger writes a rest at a slower rate, it is known: that is no gap. Without inputs,
    nothing tells so. Pieces that are too short for a record, or have no output, are left out.
    """
    return tuple(piece for record in records for piece in _pieces(record, longest, samples))


def _pieces(record: Record, longest: float, samples: int) -> list[Record]:
    steps, u = np.diff(record.t), record.u
    held = (u[1:] == u[:-1]).all(axis=1) & (u.shape[1] > 0)
    bridged = max(longest, samples * float(np.median(steps)))
    edges = [0, *(np.flatnonzero((steps > bridged) & ~held) + 1), record.t.size]
    if len(edges) == 2:
        return [record]
    spans = [slice(a, b) for a, b in pairwise(edges)]
    pieces = [piece_of(record, span) for span in spans]
    return [
        p for p in pieces if p.t.size >= MIN_SAMPLES and (p.y is None or np.isfinite(p.y).any())
    ]


def piece_of(record: Record, span: slice) -> Record:
    """Return a piece of a record; any but the first begins at an unknown state."""
    start = span.start
    return replace(
        record,
        t=record.t[span],
        u=record.u[span],
        y=None if record.y is None else record.y[span],
        x0=np.full_like(record.x0, np.nan) if start else record.x0,
        name=f"{record.name} from {record.t[start]:g} s" if start else record.name,
        rows=record.rows[span],
    )
