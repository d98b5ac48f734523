"""Assignment of a file's columns, with their units, to the quantities of a model."""

from collections.abc import Collection, Mapping, Sequence

import pandas as pd

from sklearn_pgnn.cli.inputs import positive
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.channel_kinds import usual_kind
from sklearn_pgnn.physics.effects.differences import is_mark
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.csv_file import open_csv
from sklearn_pgnn.trajectories.file_table import FileTable
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY
from sklearn_pgnn.trajectories.several_files import is_conditions, read_each, unique
from sklearn_pgnn.trajectories.titles import unit_of

#: key of the sample interval [s] in a mapping, for files without a time
SAMPLE_TIME = "sample_time"


def quantities(model: PhysicsModel, known: Collection[str] = ()) -> list[tuple[str, str, str]]:
    """Return name, role and unit of all quantities that a file of records must contain.

    A table of conditions has those that are known; marks of groups are known by the files' names.

    >>> quantities(PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"}))
    [('t', 'time', 's'), ('u', 'input', 'V'), ('y', 'output', 'V')]
    """
    told = [name for name in model.inputs if name not in known and not is_mark(model, name)]
    inputs = [(name, "input", model.unit(name)) for name in told]
    outputs = [(name, "output", model.unit(name)) for name in model.outputs]
    return [(TIME, "time", "s"), *inputs, *outputs]


def seen_columns(model: PhysicsModel, files: Sequence[Mapping]) -> dict:
    """Return the columns that all files have, and the quantity that each may be."""
    known, files = _conditions(model, files)
    tables = [_open(file, model) for file in files]
    first, shared = tables[0], list(tables[0].header)
    for file, table in zip(files, tables, strict=True):
        there = [title for title in shared if _place(title, table.header) is not None]
        if not any(there):
            raise RecordError(
                f"{file['label']}: expected columns as in {files[0]['label']}, "
                f"{', '.join(filter(None, shared))}, got {', '.join(filter(None, table.header))}. "
                f"Remedy: use the same column names in all files."
            )
        shared = there
    needed = quantities(model, known)
    kinds = {
        name: "" if role == "time" else model.channels.get(name) or usual_kind(model, name)
        for name, role, _ in needed
    }
    return {
        "columns": [title for title in dict.fromkeys(shared) if title],
        "quantities": needed,
        "guess": {
            name: _guess(first, name, unit, shared) | {"kind": kinds[name]}
            for name, _, unit in needed
        },
    }


def with_kinds(model: PhysicsModel, mapping: Mapping) -> PhysicsModel:
    """Return a model with what was chosen of its channels.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> dict(with_kinds(lag, {"t": {"kind": ""}, "u": {"kind": "measured"}, "y": {}}).channels)
    {'u': 'measured'}
    """
    names = (*model.inputs, *model.outputs)
    told = {name: mapping.get(name, {}).get("kind", "") for name in names}
    return model.replace(channels={name: kind for name, kind in told.items() if kind})


def _place(title: str, header: Sequence[str]) -> int | None:
    """Return where a column is in another file, which may state its unit or not."""
    if title in header:
        return header.index(title)
    found = [k for k, other in enumerate(header) if other and _bare(other) == _bare(title)]
    return found[0] if len(found) == 1 else None


def _bare(title: str) -> str:
    """Return the header of a column without its unit.

    >>> _bare("torque [N m]"), _bare("torque")
    ('torque', 'torque')
    """
    unit = unit_of(title)
    return title[: title.rindex(unit)].rstrip(" [(/").removesuffix(" in") if unit else title


def _guess(table: FileTable, name: str, unit: str, shared: Sequence[str]) -> dict[str, str]:
    """Return the column of a quantity: the one with its name, else the most similar one."""
    k = table.find(name)
    title = "" if k is None else table.header[k]
    if k is None:
        like = table.nearest().get(name, "")
        title = next((t for t in table.header if t == like or t.startswith(f"{like} ")), "")
    title = title if title in shared else ""
    below = "" if k is None else table.units.get(k, "")
    return {"column": title, "unit": unit_of(title) or below or unit}


def read_mapped(
    model: PhysicsModel, files: Sequence[Mapping], mapping: Mapping
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read files as the X and y of a model, by a mapping of its quantities to their columns."""
    sample_time = _sample_time(mapping)
    _check(quantities(model, _conditions(model, files)[0]), mapping, sample_time)
    plain = model.replace(columns={})
    by_label = dict(zip(unique(file["label"] for file in files), files, strict=True))

    def opened(path: str, model: PhysicsModel, sample_time: float | None) -> FileTable:
        table = _open(by_label[path], model, sample_time)
        table.path = by_label[path]["label"]
        if not is_conditions(path):
            table.header, table.units = _renamed(table.header, mapping, model), {}
        return table

    return read_each(opened, list(by_label), plain, sample_time)


def _conditions(
    model: PhysicsModel, files: Sequence[Mapping]
) -> tuple[frozenset[str], list[Mapping]]:
    """Return the inputs that a table of conditions among files gives, and the files of records."""
    tables = [_open(file, model) for file in files if is_conditions(file["label"])]
    known = {name for table in tables for name in model.inputs if table.find(name) is not None}
    return frozenset(known), [file for file in files if not is_conditions(file["label"])]


def _open(file: Mapping, model: PhysicsModel, sample_time: float | None = None) -> FileTable:
    """Open a file; error messages use its label."""
    try:
        return open_csv(file["file"], model, sample_time)
    except RecordError as error:
        raise RecordError(str(error).replace(file["file"], file["label"], 1)) from error


def _renamed(header: Sequence[str], mapping: Mapping, model: PhysicsModel) -> list[str]:
    """Return the columns' names in the model, with their units; other columns lose their names."""
    kept = {TRAJECTORY, *(name for name in model.inputs if is_mark(model, name))}
    named = [title if title in kept else "" for title in header]
    for name, said in mapping.items():
        place = None if name == SAMPLE_TIME else _place(said["column"], header)
        if place is not None and said["column"]:
            title = header[place]
            unit = said["unit"] if title == said["column"] else unit_of(title)
            named[place] = f"{name} [{unit}]" if unit else name
    return named


def _check(
    needed: Sequence[tuple[str, str, str]], mapping: Mapping, sample_time: float | None
) -> None:
    taken: dict[str, str] = {}
    for name, role, _ in needed:
        column = mapping.get(name, {}).get("column", "")
        if not column and not (name == TIME and sample_time is not None):
            remedy = "Remedy: choose one"
            remedy += ", or state the sample time." if name == TIME else "."
            raise RecordError(f"expected a column for the {role} {name!r}, got none. {remedy}")
        if column and column in taken:
            raise RecordError(
                f"expected a column of its own for {name!r}, got {column!r}, which is already used "
                f"for {taken[column]!r}. Remedy: choose another one."
            )
        taken[column] = name


def _sample_time(mapping: Mapping) -> float | None:
    """Return the sample time [s] of files whose mapping has no column for the time."""
    if mapping.get(TIME, {}).get("column"):
        return None
    text = str(mapping.get(SAMPLE_TIME) or "").strip()
    if not text:
        return None
    value = positive(text)
    if value is None:
        raise RecordError(f"sample time: expected a positive number of seconds, got {text!r}.")
    return value
