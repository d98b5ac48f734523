"""The columns that say which trajectories belong to a group of records that differ."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user


def split_marks(X: Any, groups: Mapping[str, tuple[str, ...]]) -> tuple[Any, np.ndarray]:
    """Return a table without the columns of groups, and these, zero where it has none."""
    given = [column for column in groups if isinstance(X, pd.DataFrame) and column in X.columns]
    missing = [column for column in groups if column not in given]
    if missing:
        warn_user(
            f"X: expected the column {missing[0]!r}, 1 in trajectories like "
            f"{', '.join(groups[missing[0]])} and 0 in others, got none: all are taken to be like "
            f"the others. Remedy: add the column.",
            RecordWarning,
        )
    marks = np.zeros((len(X), len(groups)))
    for place, column in enumerate(groups):
        if column in given:
            marks[:, place] = np.asarray(X[column], dtype=float)
    return (X.drop(columns=given) if given else X), marks


def marked_records(records: tuple[Record, ...], marks: np.ndarray) -> tuple[Record, ...]:
    """Return records with these columns as further inputs."""
    if not marks.shape[1]:
        return records
    return tuple(
        replace(record, u=np.column_stack([record.u, marks[record.rows]])) for record in records
    )
