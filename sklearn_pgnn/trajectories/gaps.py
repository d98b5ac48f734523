"""Splitting of records at gaps."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from sklearn_pgnn.trajectories.reader import MIN_SAMPLES
from sklearn_pgnn.trajectories.record import Record


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
