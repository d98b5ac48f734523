"""Splitting of records at gaps."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from sklearn_pgnn.trajectories.reader import MIN_SAMPLES
from sklearn_pgnn.trajectories.record import Record


def split_at_gaps(records: tuple[Record, ...], longest: float, samples: int) -> tuple[Record, ...]:
    """Split records at long gaps, in which the inputs are unknown.

    Parameters
    ----------
    records : tuple of Record
        The records.
    longest : float
        Longest time without a sample [s] that a simulation may bridge.
    samples : int
        Number of a record's usual sample intervals that are always bridged.

    Returns
    -------
    tuple of Record
        The records; the piece after a gap begins at an unknown state, and keeps its time. Pieces
        that are too short for a record, or have no measured output, are left out.

    Examples
    --------
    >>> t = np.array([0.0, 0.1, 0.2, 0.3, 9.0, 9.1, 9.2, 9.3])
    >>> whole = Record(t, np.zeros((8, 0)), np.ones((8, 1)), np.zeros(1), "a", np.arange(8))
    >>> [(piece.name, piece.rows.size) for piece in split_at_gaps((whole,), 1.0, 20)]
    [('a', 4), ('a from 9 s', 4)]
    """
    return tuple(piece for record in records for piece in _pieces(record, longest, samples))


def _pieces(record: Record, longest: float, samples: int) -> list[Record]:
    steps = np.diff(record.t)
    bridged = max(longest, samples * float(np.median(steps)))
    edges = [0, *(np.flatnonzero(steps > bridged) + 1), record.t.size]
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
