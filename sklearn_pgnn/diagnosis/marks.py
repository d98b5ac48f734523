"""The columns that say which trajectories belong to a group of records that differ."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.physics.effects.differences import mark_of
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user


def split_marks(X: Any, groups: Mapping[str, tuple[str, ...]]) -> tuple[Any, np.ndarray]:
    """Return a table without the columns of groups, and these, as assumed where it has none."""
    given = [column for column in groups if isinstance(X, pd.DataFrame) and column in X.columns]
    marks = np.zeros((len(X), len(groups)))
    for place, (column, records) in enumerate(groups.items()):
        if column in given:
            marks[:, place] = np.asarray(X[column], dtype=float)
            continue
        marks[:, place], expected = mark_of(column, records)
        warn_user(
            f"X: expected the column {column!r}, {expected}. Remedy: add the column.",
            RecordWarning,
        )
    return (X.drop(columns=given) if given else X), marks


def marked_records(records: tuple[Record, ...], marks: np.ndarray) -> tuple[Record, ...]:
    """Return records with these columns as further inputs."""
    if not marks.shape[1]:
        return records
    return tuple(
        replace(record, u=np.column_stack([record.u, marks[record.rows]])) for record in records
    )
