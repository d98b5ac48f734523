"""Several files as one X and y."""

from collections.abc import Callable, Iterable

import pandas as pd

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.file_table import FileTable
from sklearn_pgnn.trajectories.file_text import stem
from sklearn_pgnn.trajectories.reader import TRAJECTORY, of_files


def read_each(
    opened: Callable[..., FileTable],
    paths: Iterable,
    model: PhysicsModel,
    sample_time: float | None,
    *,
    needs_outputs: bool = True,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read several files as one X and y; every file is at least one trajectory.

    Where outputs are needed, each of several files needs one, and every output one of the files.
    """
    paths = list(paths)
    if not paths:
        raise RecordError("expected at least one file of records, got none.")
    tables, found = [], []
    for path in paths:
        tables.append(opened(path, model, sample_time))
        found.append(tables[-1].read(needs_outputs and len(paths) == 1))
        if needs_outputs and not _measured(found[-1][1]):
            tables[-1].read()  # which refuses the first output
    if needs_outputs and _measured(*(y for _, y in found)) < set(model.outputs or ()):
        tables[0].refuse_unmeasured(_measured(*(y for _, y in found)))
    y = pd.concat([y for _, y in found], ignore_index=True)
    Xs = _named([X for X, _ in found], [stem(table.path) for table in tables])
    return of_files(pd.concat(Xs, ignore_index=True)), y[[n for n in model.outputs or () if n in y]]


def _measured(*ys: pd.DataFrame) -> set[str]:
    """Return the outputs that were measured somewhere."""
    return {name for y in ys for name in y if y[name].notna().any()}


def _named(Xs: list[pd.DataFrame], stems: list[str]) -> list[pd.DataFrame]:
    """Return every X with its file's unique name, before those of several trajectories."""
    named: list[pd.DataFrame] = []
    for X, own, name in zip(Xs, stems, unique(stems), strict=True):
        inside = X[TRAJECTORY]
        alone = inside.nunique() == 1 and inside.iloc[0] == own
        named.append(X.assign(**{TRAJECTORY: name if alone else name + "/" + inside}))
    return named


def unique(names: Iterable[str]) -> list[str]:
    """Return the names made unique; repeated ones get a number."""
    found: list[str] = []
    for name in names:
        new, count = name, 1
        while new in found:
            count += 1
            new = f"{name}-{count}"
        found.append(new)
    return found
