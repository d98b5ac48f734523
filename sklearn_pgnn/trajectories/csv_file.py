"""CSV files as X and y: columns named by a model, errors with their line."""

import csv
import math
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import NoReturn

import pandas as pd

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.file_table import FileTable, read_each

_NOTHING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-"})
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
#: a first line in which Excel declares the separator
_TOLD = re.compile(r"sep=(.)\s*")


def read_csv(
    path: FilePath, model: PhysicsModel, sample_time: float | None = None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    r"""Read a CSV file as the X and y of a model.

    The separator (comma, semicolon, tab) is detected from the header; with a semicolon or a tab,
    numbers may have a decimal comma. Lines that begin with ``#`` are comments, and a header may
    carry its unit, as in ``torque [N m]``: a unit other than the model's is converted, or refused
    if it measures a different quantity. The time is in seconds, or in ISO dates such as
    ``2026-01-31 12:00:00.005``, which count from each trajectory's first sample. A file is one
    record, or several if it has a column ``trajectory``.

    Parameters
    ----------
    path : str or path-like
        The file.
    model : PhysicsModel
        Defines the columns; its `columns` give their names in the file.
    sample_time : float, optional
        Sample interval [s] of a file without a time.

    Returns
    -------
    X : DataFrame
        ``trajectory`` (by default the file's stem), ``t``, the inputs, and the states that the
        file has, under the model's own names.
    y : DataFrame
        The outputs under the model's own names, NaN where there is no value.

    Raises
    ------
    RecordError
        If the file cannot be read or is not a valid record: ``FILE:LINE: what``.

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
    return open_csv(path, model, sample_time).read()


def open_csv(path, model: PhysicsModel, sample_time: float | None = None) -> FileTable:
    """Open a CSV file to inspect its content.

    Parameters
    ----------
    path : str or path-like
        The file.
    model : PhysicsModel
        Defines the columns.
    sample_time : float, optional
        Sample interval [s] of a file without a time.

    Returns
    -------
    FileTable
        The file, with its `header` and its columns.
    """
    return _CsvTable(os.fspath(path), model, sample_time)


def read_csv_files(
    paths: Iterable, model: PhysicsModel, sample_time: float | None = None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    r"""Read several CSV files as one X and y; every file is at least one trajectory.

    Parameters
    ----------
    paths : iterable of str or path-like
        The files.
    model : PhysicsModel
        Defines the columns; its `columns` give their names in the files.
    sample_time : float, optional
        Sample interval [s] of files without a time.

    Returns
    -------
    X : DataFrame
        As returned by `read_csv`; ``trajectory`` holds the file's stem, made unique.
    y : DataFrame
        The outputs.

    Raises
    ------
    RecordError
        As raised by `read_csv`, or if there is no file.

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
    return read_each(read_csv, paths, model, sample_time)


class _CsvTable(FileTable):
    """A file as columns of text, with the line of every row."""

    kind = "CSV"

    def __init__(self, path: str, model: PhysicsModel, sample_time: float | None = None):
        super().__init__(path, model, sample_time)
        self.lines, texts = self.split(self.decode(self.raw()))
        told = _TOLD.fullmatch(texts[0]) if len(texts) > 1 else None
        if told:
            self.lines, texts = self.lines[1:], texts[1:]
        separator = told[1] if told else _separator(texts[0])
        self.decimal_comma = separator != ","
        self.header, *self.rows = self.parse(texts, separator)
        self.header_line, *self.lines = self.lines
        self.check_header()
        self.check_widths()

    def refuse_line(self, line: int, why: str) -> NoReturn:
        """Raise `RecordError` for a line, whether it is a sample or not."""
        raise RecordError(f"{self.path}:{line}: {' '.join(why.split())}") from None

    # -- lines -------------------------------------------------------------------------------------

    def raw(self) -> bytes:
        try:
            raw = Path(self.path).read_bytes()
        except OSError as error:
            self.refuse_line(1, f"expected a CSV file, got: {error.strerror}.")
        if not raw.strip():
            self.refuse_line(1, "expected a CSV file, got an empty file.")
        return raw

    def decode(self, raw: bytes) -> str:
        binary = _CONTROL.search(raw)
        if binary:
            line = raw.count(b"\n", 0, binary.start()) + 1
            self.refuse_line(line, "expected a CSV file (text in UTF-8), got a binary file.")
        try:
            return raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            return raw.decode("latin-1")

    def split(self, text: str) -> tuple[list[int], list[str]]:
        """Return the line numbers and texts of all lines but comments and empty ones."""
        lines = re.split(r"\r\n|\n|\r", text)
        kept = [k for k, line in enumerate(lines) if line.strip() and line.lstrip()[0] != "#"]
        if not kept:
            self.refuse_line(1, "expected a header and samples, got comments only.")
        return [k + 1 for k in kept], [lines[k] for k in kept]

    def parse(self, texts: list[str], separator: str) -> list[list[str]]:
        rows: list[list[str]] = []
        try:
            for text in texts:
                rows.append(_fields(text, separator))
        except csv.Error as error:
            self.refuse_line(self.lines[len(rows)], f"expected CSV, got: {error}.")
        return rows

    def check_header(self) -> None:
        self.header = [name.strip() for name in self.header]
        if all(self.number(name) is not None for name in self.header):
            shown = ", ".join(self.header)[:80]
            self.refuse_line(
                self.header_line, f"expected a header with the names of the columns, got {shown!r}."
            )

    def check_widths(self) -> None:
        """Refuse a row that is longer than the header; empty fields at its end are ignored."""
        width = len(self.header)
        for line, row in zip(self.lines, self.rows, strict=True):
            if len(row) > width and any(text.strip() for text in row[width:]):
                self.refuse_line(line, f"expected {width} fields as in the header, got {len(row)}.")

    # -- cells -------------------------------------------------------------------------------------

    @property
    def size(self) -> int:
        """Number of samples."""
        return len(self.rows)

    def place(self, row: int | None) -> str:
        """Return the line of a row, or of the header."""
        return f":{self.header_line if row is None else self.lines[row]}"

    def name_of(self, row: int) -> str:
        """Return the line of a row."""
        return f"line {self.lines[row]}"

    def cells(self, k: int) -> list[str]:
        """Return the text of a column."""
        return [row[k].strip() if k < len(row) else "" for row in self.rows]

    def number(self, cell: str) -> float | None:
        """Read a number: NaN for an empty cell, None for anything else."""
        try:
            return float(cell) if "_" not in cell else None
        except ValueError:
            pass
        if cell.lower() in _NOTHING:
            return math.nan
        if self.decimal_comma and cell.count(",") == 1 and "." not in cell:
            return self.number(cell.replace(",", "."))
        return None

    def dates(self, k: int) -> pd.Series | None:
        """Read a column that begins with a date."""
        cells = self.cells(k)
        if not cells or self.number(cells[0]) is not None:
            return None
        texts = pd.Series([cell.replace(",", ".") for cell in cells])
        dates = pd.to_datetime(texts, format="ISO8601", utc=True, errors="coerce")
        return None if pd.isna(dates[0]) else dates


def _separator(header: str) -> str:
    """Find the separator in a header, outside quotes."""
    bare = re.sub(r'"[^"]*"', "", header)
    return next((sign for sign in ("\t", ";") if sign in bare), ",")


def _fields(text: str, separator: str) -> list[str]:
    """Split a line into fields; the csv module is used only if there are quotes."""
    if '"' not in text:
        return text.split(separator)
    return next(csv.reader([text], delimiter=separator, skipinitialspace=True))
