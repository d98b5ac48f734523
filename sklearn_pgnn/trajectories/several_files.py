"""Several files as one X and y."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path

import pandas as pd

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.file_table import CONDITIONS, FileTable
from sklearn_pgnn.trajectories.file_text import stem
from sklearn_pgnn.trajectories.reader import TRAJECTORY, of_files
from sklearn_pgnn.trajectories.shown import listed
from sklearn_pgnn.user_line import warn_user


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
    given = [os.fspath(path) for path in paths]
    of_conditions = [path for path in given if is_conditions(path)]
    paths = [path for path in given if path not in of_conditions]
    if not paths or len(of_conditions) > 1:
        raise RecordError(
            f"expected at least one file of records, and at most one table of conditions, got "
            f"{listed(given) or 'none'}."
        )
    known = _conditions(opened(of_conditions[0], model, None), paths) if of_conditions else {}
    tables, found = [], []
    for path in paths:
        tables.append(opened(path, model, sample_time))
        tables[-1].conditions = known.get(path, {})
        found.append(tables[-1].read(needs_outputs and len(paths) == 1))
        if needs_outputs and not _measured(found[-1][1]):
            tables[-1].read()  # which refuses the first output
    if needs_outputs and _measured(*(y for _, y in found)) < set(model.outputs or ()):
        tables[0].refuse_unmeasured(_measured(*(y for _, y in found)))
    y = pd.concat([y for _, y in found], ignore_index=True)
    Xs = _named([X for X, _ in found], [stem(table.path) for table in tables])
    _tell_marks(Xs, tables)
    return of_files(pd.concat(Xs, ignore_index=True)), y[[n for n in model.outputs or () if n in y]]


def is_conditions(path: str) -> bool:
    """Return whether a file is a table of conditions, by its name.

    >>> is_conditions("day_1/Conditions.csv"), is_conditions("run_1.csv")
    (True, False)
    """
    return stem(path).lower() == CONDITIONS


def _conditions(table: FileTable, paths: Iterable[str]) -> dict[str, dict[str, float]]:
    """Return the inputs that a table gives for files: its first column names them or folders."""
    names = [str(cell).strip() for cell in table.cells(0)]
    found = [name for name in table.model.inputs if table.find(name) is not None]
    if not found:
        table.refuse(
            None,
            f"expected a column for an input of the model "
            f"({', '.join(table.model.inputs) or 'it has none'}), got {listed(table.header)}. "
            f"Remedy: declare it among the model's inputs, where it may drive nothing, or say in "
            f"columns what the table calls it.",
        )
    values = {name: table.finite(name) for name in found}
    given = {}
    for path in paths:
        called = (Path(path).name, stem(path), Path(path).absolute().parent.name)
        row = next((names.index(name) for name in called if name in names), None)
        if row is None:
            table.refuse(
                None,
                f"expected a row for {path}, got {listed(names)}. Remedy: add a row that begins "
                f"with {stem(path)}, or with the file's folder.",
            )
        given[path] = {name: float(values[name][row]) for name in found}
    return given


def _tell_marks(Xs: Iterable[pd.DataFrame], tables: Iterable[FileTable]) -> None:
    """Tell which records were taken to be of a group by their names."""
    marks: dict[str, dict[str, float]] = {}
    for X, table in zip(Xs, tables, strict=True):
        for name in filter(table.knows, table.model.inputs):
            if name not in table.conditions:
                marks.setdefault(name, {}).update(X.groupby(TRAJECTORY, sort=False)[name].max())
    for name, found in marks.items():
        of = {m: [record for record, mark in found.items() if mark == m] for m in (1, 0)}
        said = [f"{mark} in {listed(records)}" for mark, records in of.items() if records]
        warn_user(
            f"the files have no column {name!r}: by their names it is {', and '.join(said)}. "
            f"Remedy: if that is wrong, add the column, or give a table {CONDITIONS}.csv.",
            RecordWarning,
        )


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
