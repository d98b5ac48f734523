"""A hash of all that a result depends on: the model, the options, the records, the package."""

import hashlib
import json
import marshal
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import fields
from os import PathLike
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import pandas as pd

from sklearn_pgnn import __version__
from sklearn_pgnn.annotations import Table
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import read_catalogue
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.tables import as_table

#: options that change no result
HOW = ("n_jobs", "progress")
#: the modules whose code is identified by the package's version
OURS = ("sklearn_pgnn.", "builtins", "abc")


def content_key(*parts: str | bytes) -> str:
    """Return one hash of several parts."""
    whole = hashlib.sha256()
    for part in parts:
        whole.update(hashlib.sha256(part.encode() if isinstance(part, str) else part).digest())
    return whole.hexdigest()


def setting_key(model: PhysicsModel, options: Mapping) -> str:
    """Return the hash of what all machines share: model, options and the package's version."""
    said = {name: value for name, value in options.items() if name not in HOW}
    catalogue = said.pop("catalogue", None)
    effects = () if catalogue is None else map(_effect_key, read_catalogue(catalogue))
    told = {name: _plain_option(name, value) for name, value in sorted(said.items())}
    told["catalogue"] = None if catalogue is None else list(effects)
    text = model.content() if model.opaque_functions else model.to_yaml()
    return content_key(__version__, text, json.dumps(told))


def records_key(X: Table, y: Table) -> str:
    """Return the hash of a table of inputs and one of outputs."""
    return content_key(*_table_bytes(X), *_table_bytes(y))


def files_key(paths: Iterable[str | PathLike], sample_time: float | None) -> str:
    """Return the hash of files of records: their names and their present contents."""
    contents = (part for path in map(Path, paths) for part in _contents(path))
    return content_key(repr(sample_time), *contents)


def _contents(path: Path) -> Iterator[str | bytes]:
    """Yield the name and the contents of a record: a file, or the files of a folder."""
    yield path.name
    for file in sorted(path.iterdir()) if path.is_dir() else (path,):
        yield file.read_bytes()


def _table_bytes(table: Table) -> tuple[bytes, ...]:
    table = as_table(table)
    if not isinstance(table, pd.DataFrame | pd.Series):
        array = np.asarray(table)
        table = pd.DataFrame(array.reshape(len(array), -1) if array.size else array.reshape(0, 0))
    frame = table.to_frame() if isinstance(table, pd.Series) else table
    names = [(str(name), str(kind)) for name, kind in frame.dtypes.items()]
    rows = pd.util.hash_pandas_object(frame, index=False).to_numpy()
    return json.dumps(names).encode(), rows.tobytes()


def _effect_key(kind: type[Effect]) -> list:
    """Return the name of an effect and, for one from outside the package, its definition."""
    own = [base for base in kind.__mro__ if not base.__module__.startswith(OURS)]
    quantities = [
        (f.name, repr(f.default), repr(dict(f.metadata))) for f in fields(kind) if f.metadata
    ]
    return [kind.__module__, kind.__qualname__, kind.id, quantities, *map(_class_key, own)]


def _class_key(kind: type) -> dict[str, str]:
    """Return the definition of a class by name: its constants, its methods' code and defaults."""
    said = {name: _said(value) for name, value in vars(kind).items()}
    return {name: text for name, text in said.items() if " at 0x" not in text}  # is no content


def _said(value: object) -> str:
    """Return the definition of an entry of a class, as text."""
    functions = _functions(value)
    if functions:
        return repr([_function_key(function) for function in functions])
    return repr(sorted(value, key=repr) if isinstance(value, Set) else value)


def _functions(value: object) -> list[FunctionType]:
    """Return the functions that an entry of a class contains."""
    if isinstance(value, property):
        parts: list[object] = [value.fget, value.fset, value.fdel]
    else:  # also of a class method, a static method or a cached property
        parts = [getattr(value, "__func__", getattr(value, "func", value))]
    return [part for part in parts if isinstance(part, FunctionType)]


def _function_key(function: FunctionType) -> tuple:
    # version 2 of marshal writes equal code as equal bytes
    code = hashlib.sha256(marshal.dumps(function.__code__, 2)).hexdigest()
    closed = [cell.cell_contents for cell in function.__closure__ or ()]
    held = [value for value in closed if isinstance(value, str | int | float | tuple)]
    return code, function.__defaults__, function.__kwdefaults__, held


def _plain_option(name: str, value: Any) -> Any:
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, Sequence) and all(isinstance(item, str) for item in value):
        return list(value)
    try:
        return np.asarray(value, dtype=float).tolist()
    except (TypeError, ValueError):
        raise OptionError(
            f"options: {name}: expected numbers or texts, got {value!r}, which cannot be compared "
            f"between runs. Remedy: pass a seed instead of a generator."
        ) from None
