"""Groups of records that differ, and the column that marks one in the records."""

import re
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.physics.effects.differences import (
    ALL,
    AND,
    DIFFERENCES,
    IN,
    SINCE,
    TO,
    TREND,
    Difference,
    cleaned,
    mark_at,
)
from sklearn_pgnn.physics.effects.targets import pair
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.record import Record

#: longest column that is made of the names of its records
LONGEST = 60


class Group(NamedTuple):
    """Records that may differ from the others, or from an onset on from what they were before.

    With an end the difference grows evenly until then. All records without an onset differ by a
    trend from the first to the last. The difference explains a share of the squares; a fit with it
    and with another usual value leaves a share.
    """

    records: tuple[int, ...]
    since: float | None
    until: float | None
    kind: type[Difference]
    quantity: str
    share: float
    left: float = 1.0

    @property
    def what(self) -> tuple[type[Difference], str]:
        """The kind of difference, and in which quantity."""
        return self.kind, self.quantity


class Marked(NamedTuple):
    """A model and its records with a column that marks a group, and what may differ there."""

    model: PhysicsModel
    records: tuple[Record, ...]
    candidates: tuple[Difference, ...]
    column: str


def mark(model: PhysicsModel, records: tuple[Record, ...], group: Group) -> Marked:
    """Return a model and its records with a column that is one in a group, else zero."""
    column = _column(model, records, group)
    marked = tuple(
        replace(
            record,
            u=np.column_stack(
                [record.u, marks_of(group, np.full(len(record.t), r), record.t, len(records))]
            ),
        )
        for r, record in enumerate(records)
    )
    candidates = [
        kind(pair(name, column)) for kind in DIFFERENCES for name in kind.quantities_of(model)
    ]
    wider = model.replace(inputs={**model.inputs, column: "1"})
    return Marked(wider, marked, tuple(candidates), column)


def marks_of(group: Group, record: np.ndarray, t: np.ndarray, n_records: int) -> np.ndarray:
    """Return the column of a group, or of a trend, at samples of some records."""
    if group.since is None and len(group.records) == n_records:
        return record / (n_records - 1.0)
    return np.isin(record, group.records) * mark_at(t, group.since, group.until)


def _column(model: PhysicsModel, records: tuple[Record, ...], group: Group) -> str:
    """Return a name for a group: that of its records, if these are short, and its onset."""
    if group.since is None and len(group.records) == len(records):
        return TREND
    names = [cleaned(records[r].name) for r in group.records]
    name = IN + AND.join(names)
    if len(names) == len(records):
        name = f"{IN}{ALL}"
    elif len(name) > LONGEST:
        name = f"{IN}group_{len(model.inputs)}"
    if group.since is None:
        return name
    since = name + SINCE + _written(group.since)
    return since if group.until is None else since + TO + _written(group.until)


def _written(time: float) -> str:
    """Return a time [s] as it stands in a name."""
    said = np.format_float_positional(time, 4, unique=False, fractional=False, trim="-")
    return re.sub(r"\W", "p", said)
