"""CSV files as X and y: the columns a model names, every error with its line."""

import csv
import math
import os
import re
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES, TIME, TRAJECTORY, split_rows

_NOTHING = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
_UNIT = re.compile(r"\s*(\[[^]]*\]|\([^)]*\))$")


def read_csv(path, model: PhysicsModel) -> tuple[pd.DataFrame, pd.DataFrame]:
    r"""Read a CSV file as the X and y of a model.

    The separator (comma, semicolon, tab) is found in the header; beside a semicolon or a tab,
    numbers may have a decimal comma. Lines that begin with ``#`` are comments, and a header may
    carry its unit, as in ``torque [N m]``. A file is one record, or several if it has a column
    ``trajectory``.

    Parameters
    ----------
    path : str or path-like
        The file.
    model : PhysicsModel
        Names the columns; its `columns` say what the file calls them.

    Returns
    -------
    X : DataFrame
        ``trajectory`` (by default the file's stem), ``t``, the inputs, and the states that the
        file has, under the model's own names.
    y : DataFrame
        The outputs under the model's own names, NaN where there is none.

    Raises
    ------
    RecordError
        If the file cannot be read or says what a record cannot say: ``FILE:LINE: what``.

    Examples
    --------
    >>> import tempfile
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "run.csv")
    ...     _ = path.write_text("t;u [V];y\n0;1,5;0\n1;1,5;0,6\n2;1,5;0,9\n3;1,5;1,2\n")
    ...     X, y = read_csv(path, lag)
    >>> X["u"].tolist(), y["y"].tolist()
    ([1.5, 1.5, 1.5, 1.5], [0.0, 0.6, 0.9, 1.2])
    """
    table = _Table(os.fspath(path), model)
    t = table.finite(TIME)
    inputs = {name: table.finite(name) for name in model.inputs}
    outputs = {name: table.output(name) for name in model.outputs or ()}
    states = {name: table.numbers(name) for name in model.states if table.find(name) is not None}
    names = table.trajectories()
    table.check_records(t, names)
    X = pd.DataFrame({TRAJECTORY: names, TIME: t, **inputs, **states})
    return X, pd.DataFrame(outputs)


def read_csv_files(paths: Iterable, model: PhysicsModel) -> tuple[pd.DataFrame, pd.DataFrame]:
    r"""Read several CSV files as one X and y; every file is at least one trajectory.

    Parameters
    ----------
    paths : iterable of str or path-like
        The files.
    model : PhysicsModel
        Names the columns; its `columns` say what the files call them.

    Returns
    -------
    X : DataFrame
        As `read_csv`; ``trajectory`` holds the file's stem, made unique.
    y : DataFrame
        The outputs.

    Raises
    ------
    RecordError
        As `read_csv`, or if there is no file.

    Examples
    --------
    >>> import tempfile
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "run.csv")
    ...     _ = path.write_text("t,y\n0,1\n1,0.6\n2,0.4\n3,0.2\n")
    ...     X, y = read_csv_files([path, path], lag)
    >>> X["trajectory"].unique().tolist()
    ['run', 'run-2']
    """
    paths = list(paths)
    if not paths:
        raise RecordError("expected at least one CSV file, got none.")
    tables, outputs = [], []
    for path, name in zip(paths, _unique([Path(path).stem for path in paths]), strict=True):
        X, y = read_csv(path, model)
        own = X[TRAJECTORY]
        alone = own.nunique() == 1 and own.iloc[0] == Path(path).stem
        tables.append(X.assign(**{TRAJECTORY: name if alone else name + "/" + own}))
        outputs.append(y)
    return pd.concat(tables, ignore_index=True), pd.concat(outputs, ignore_index=True)


def _unique(names: list[str]) -> list[str]:
    """Give every name once, those that come again with a number."""
    found: list[str] = []
    for name in names:
        new, count = name, 1
        while new in found:
            count += 1
            new = f"{name}-{count}"
        found.append(new)
    return found


class _Table:
    """One file as columns of text; every row knows its line."""

    def __init__(self, path: str, model: PhysicsModel):
        self.path, self.model = path, model
        self.lines, texts = self.split(self.decode(self.raw()))
        separator = _separator(texts[0])
        self.decimal_comma = separator != ","
        self.header, *self.rows = self.parse(texts, separator)
        self.header_line, *self.lines = self.lines
        self.check_header()
        self.check_widths()

    def refuse(self, line: int, why: str, column: str | None = None) -> NoReturn:
        place = "" if column is None else f"column {column!r}: "
        raise RecordError(f"{self.path}:{line}: {place}{' '.join(why.split())}") from None

    # -- lines -------------------------------------------------------------------------------------

    def raw(self) -> bytes:
        try:
            raw = Path(self.path).read_bytes()
        except OSError as error:
            self.refuse(1, f"expected a CSV file, got: {error.strerror}.")
        if not raw.strip():
            self.refuse(1, "expected a CSV file, got an empty file.")
        return raw

    def decode(self, raw: bytes) -> str:
        binary = _CONTROL.search(raw)
        if binary:
            line = raw.count(b"\n", 0, binary.start()) + 1
            self.refuse(line, "expected a CSV file (text in UTF-8), got a binary file.")
        try:
            return raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            return raw.decode("latin-1")

    def split(self, text: str) -> tuple[list[int], list[str]]:
        """Give line numbers and texts without comments and empty lines."""
        lines = re.split(r"\r\n|\n|\r", text)
        kept = [k for k, line in enumerate(lines) if line.strip() and line.lstrip()[0] != "#"]
        if not kept:
            self.refuse(1, "expected a header and samples, got comments only.")
        return [k + 1 for k in kept], [lines[k] for k in kept]

    def parse(self, texts: list[str], separator: str) -> list[list[str]]:
        rows: list[list[str]] = []
        try:
            for text in texts:
                rows.append(_fields(text, separator))
        except csv.Error as error:
            self.refuse(self.lines[len(rows)], f"expected CSV, got: {error}.")
        return rows

    def check_header(self) -> None:
        self.header = [name.strip() for name in self.header]
        if all(self.number(name) is not None for name in self.header):
            shown = ", ".join(self.header)[:80]
            self.refuse(
                self.header_line, f"expected a header with the names of the columns, got {shown!r}."
            )

    def check_widths(self) -> None:
        """Refuse a row that is longer than the header; an empty field at the end is nothing."""
        width = len(self.header)
        for line, row in zip(self.lines, self.rows, strict=True):
            if len(row) > width and any(text.strip() for text in row[width:]):
                self.refuse(line, f"expected {width} fields as in the header, got {len(row)}.")

    # -- columns -----------------------------------------------------------------------------------

    def find(self, name: str) -> int | None:
        """Find a quantity of the model in the header, by its whole name or without its unit."""
        wanted = self.model.columns.get(name, name)
        for header in (self.header, [_UNIT.sub("", name) for name in self.header]):
            found = [k for k, text in enumerate(header) if text == wanted]
            if len(found) > 1:
                self.refuse(
                    self.header_line, f"expected it once, got it {len(found)} times.", wanted
                )
            if found:
                return found[0]
        return None

    def column(self, name: str) -> int:
        found = self.find(name)
        if found is None:
            self.refuse(
                self.header_line,
                f"missing; the file has {', '.join(self.header)}. Remedy: {self.remedy(name)}",
                self.model.columns.get(name, name),
            )
        return found

    def remedy(self, name: str) -> str:
        """Say what to do about a missing column: the likest that nothing else needs may be it."""
        model = self.model
        taken = {self.find(n) for n in (TIME, TRAJECTORY, *model.inputs, *model.states)}
        taken |= {self.find(n) for n in model.outputs or ()}
        free = [_UNIT.sub("", text) for k, text in enumerate(self.header) if k not in taken]
        near = get_close_matches(model.columns.get(name, name), free, n=1, cutoff=0.0)
        if not near:
            return "add it to the file, or take it out of the model."
        return f"say in the model file what the CSV calls it, as in columns: {{{name}: {near[0]}}}."

    def texts(self, k: int) -> list[str]:
        return [row[k].strip() if k < len(row) else "" for row in self.rows]

    def number(self, text: str) -> float | None:
        """Read a number, NaN where there is nothing, None where there is something else."""
        try:
            return float(text) if "_" not in text else None
        except ValueError:
            pass
        if text.lower() in _NOTHING:
            return math.nan
        if self.decimal_comma and text.count(",") == 1 and "." not in text:
            return self.number(text.replace(",", "."))
        return None

    def numbers(self, name: str) -> np.ndarray:
        """Read a column; NaN where it is empty."""
        k = self.column(name)
        texts = self.texts(k)
        values = [self.number(text) for text in texts]
        for line, text, value in zip(self.lines, texts, values, strict=True):
            if value is None or math.isinf(value):
                self.refuse(line, f"expected a number, got {text!r}.", self.header[k])
        return np.array(values, dtype=float)

    def finite(self, name: str) -> np.ndarray:
        """Read a column that has a number in every row."""
        values = self.numbers(name)
        bad = np.flatnonzero(np.isnan(values))
        if bad.size:
            k, row = self.column(name), int(bad[0])
            text = self.texts(k)[row]
            self.refuse(
                self.lines[row],
                f"expected a number, got {repr(text) if text else 'nothing'}. "
                f"Remedy: fill the gap or cut the record there.",
                self.header[k],
            )
        return values

    def output(self, name: str) -> np.ndarray:
        """Read a column that has a number in some row."""
        values = self.numbers(name)
        if values.size and np.all(np.isnan(values)):
            column = self.header[self.column(name)]
            self.refuse(self.lines[0], "expected a measured value, got none at all.", column)
        return values

    # -- records -----------------------------------------------------------------------------------

    def trajectories(self) -> list[str]:
        k = self.find(TRAJECTORY)
        if k is None:
            return [Path(self.path).stem] * len(self.rows)
        return self.texts(k)

    def check_records(self, t: np.ndarray, names: list[str]) -> None:
        column = self.header[self.column(TIME)]
        if not t.size:
            self.refuse(
                self.header_line, f"expected at least {MIN_SAMPLES} samples, got 0.", column
            )
        for name, rows in split_rows(t, names):
            still = np.flatnonzero(np.diff(t[rows]) <= 0)
            if still.size:
                before, here = rows[still[0]], rows[still[0] + 1]
                self.refuse(
                    self.lines[here],
                    f"expected time to increase, got {t[here]:.12g} after {t[before]:.12g} in "
                    f"line {self.lines[before]}. Remedy: sort the record, or tell several apart "
                    f"by a column 'trajectory'.",
                    column,
                )
            if rows.size < MIN_SAMPLES:
                self.refuse(
                    self.lines[rows[0]],
                    f"expected at least {MIN_SAMPLES} samples in a record, got {rows.size} in "
                    f"{name!r}.",
                    column,
                )


def _separator(header: str) -> str:
    """Find the separator in a header, outside of quotes."""
    bare = re.sub(r'"[^"]*"', "", header)
    return next((sign for sign in ("\t", ";") if sign in bare), ",")


def _fields(text: str, separator: str) -> list[str]:
    """Cut a line into fields; the csv module is asked only where there are quotes."""
    if '"' not in text:
        return text.split(separator)
    return next(csv.reader([text], delimiter=separator, skipinitialspace=True))
