"""A file of measured samples as X and y: columns by name, errors with their location."""

import math
import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.extras import is_installed
from sklearn_pgnn.physics.expressions import to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.unit_check import output_measure
from sklearn_pgnn.physics.units import conversion, plain_unit, read_unit
from sklearn_pgnn.trajectories.alike import likeness, names_alike, units_alike
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES, TIME, TRAJECTORY, split_rows
from sklearn_pgnn.trajectories.sample_interval import check_sample_interval
from sklearn_pgnn.trajectories.tables import read_clock
from sklearn_pgnn.user_line import warn_user

_UNIT = re.compile(r"\s*(\[[^]]*\]|\([^)]*\))$")
#: units of time, other than the second, in which a column's name may end
TIMES = ("ms", "us", "ns", "min", "h")
#: names of the time in files, other than t
TIME_NAME = "time"
#: remedy for a file without a time
NO_TIME = "Or, if it has no time, give the sample interval: sample_time=0.01 [s] (--sample-time)."


class FileTable(ABC):
    """A file as a header and columns of cells.

    Parameters
    ----------
    path : str
        The file.
    model : PhysicsModel
        Defines the columns; its `columns` give their names in the file.
    sample_time : float, optional
        Sample interval [s] of a file without a time.
    """

    #: the file's name in error messages
    kind = "file"
    header: list[str]

    def __init__(self, path: str, model: PhysicsModel, sample_time: float | None = None):
        self.path, self.model, self.sample_time = path, model, sample_time
        if sample_time is not None:
            check_sample_interval(sample_time, "sample_time")

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of samples."""

    @abstractmethod
    def place(self, row: int | None) -> str:
        """Return the location of a row, or of the header, for an error message."""

    @abstractmethod
    def name_of(self, row: int) -> str:
        """Return the name of a row in an error message about another row."""

    @abstractmethod
    def cells(self, k: int) -> Sequence[Any]:
        """Return the cells of a column."""

    @abstractmethod
    def number(self, cell) -> float | None:
        """Read a number: NaN for an empty cell, None for anything else."""

    @abstractmethod
    def dates(self, k: int) -> pd.Series | None:
        """Read a column as dates or time differences; None if its cells are something else."""

    def refuse(self, row: int | None, why: str, column: str | None = None) -> NoReturn:
        """Raise `RecordError` for a row, or for the header."""
        about = "" if column is None else f"column {column!r}: "
        place = self.path + self.place(row)
        raise RecordError(f"{place}: {about}{' '.join(why.split())}") from None

    def read(self, needs_outputs: bool = True) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Return X and y under the model's own names.

        Parameters
        ----------
        needs_outputs : bool, default=True
            Whether every output must be present.
        """
        model = self.model
        names = self.trajectories()
        t = self.times(names)
        inputs = {name: self.finite(name) for name in model.inputs}
        outputs = {
            name: self.output(name)
            for name in model.outputs or ()
            if needs_outputs or self.find(name) is not None
        }
        states = {n: self.numbers(n) for n in model.states if self.find(n) is not None}
        self.check_records(t, names)
        return pd.DataFrame({TRAJECTORY: names, TIME: t, **inputs, **states}), pd.DataFrame(outputs)

    # -- columns -----------------------------------------------------------------------------------

    def find(self, name: str) -> int | None:
        """Find a quantity of the model in the header, by its whole name or without its unit.

        If a column has no unit, the model's `columns` may give it: ``angle [deg]``.
        """
        wanted = self.model.columns.get(name, name)
        bare = [_UNIT.sub("", text) for text in self.header]
        tries = [(self.header, wanted), (bare, wanted)]
        if wanted.endswith("]"):
            tries.append((self.header, _UNIT.sub("", wanted)))
        for header, title in tries:
            found = [k for k, text in enumerate(header) if text == title]
            if len(found) > 1:
                self.refuse(None, f"expected it once, got it {len(found)} times.", wanted)
            if found:
                return found[0]
        return None

    def column(self, name: str) -> int:
        """Return the column of a quantity, or raise `RecordError`."""
        found = self.find(name)
        if found is None:
            self.refuse(
                None,
                f"missing; the file has {', '.join(self.header)}. Remedy: {self.remedy(name)}",
                self.model.columns.get(name, name),
            )
        return found

    def unused(self) -> dict[str, str]:
        """Return the columns that match no quantity of the model, each with its unit."""
        model = self.model
        taken = {self.find(n) for n in (TIME, TRAJECTORY, *model.inputs, *model.states)}
        taken |= {self.find(n) for n in model.outputs or ()}
        free = [text for k, text in enumerate(self.header) if k not in taken]
        return {_UNIT.sub("", text): unit_of(text) for text in free}

    def remedy(self, name: str) -> str:
        """Return the remedy for a missing column: the most similar ones of the unused columns."""
        last = f" {NO_TIME}" if name == TIME else ""
        near = self.nearest()
        if name not in near and (free := self.unused()):
            return (
                f"say in the model file what the {self.kind} calls it, in columns: "
                f"{{{name}: ...}}; not used so far: {', '.join(free)}.{last}"
            )
        if name not in near:
            without = "." if name == TIME else ", or take it out of the model."
            return f"add it to the file{without}{last}"
        first = {name: near.pop(name), **near}
        columns = ", ".join(f"{own}: {self.with_unit(own, first[own])}" for own in first)
        return (
            f"say in the model file what the {self.kind} calls it, as in "
            f"columns: {{{columns}}}.{last}"
        )

    def nearest(self) -> dict[str, str]:
        """Return the most similar unused column for each missing quantity.

        Their names are similar, or no other column, and no other quantity, has a unit like theirs.
        """
        near: dict[str, str] = {}
        free, missing = self.unused(), self.missing()
        of_one_kind = [
            (own, theirs)
            for own, unit in missing.items()
            for theirs, their_unit in free.items()
            if units_alike(unit, their_unit)
        ]
        owns, others = Counter(own for own, _ in of_one_kind), Counter(t for _, t in of_one_kind)
        pairs = {
            (own, theirs): (units_alike(missing[own], free[theirs]), *self.likeness(own, theirs))
            for own, theirs in product(missing, free)
            if any(names_alike(name, theirs) for name in self.called(own))
            or ((own, theirs) in of_one_kind and owns[own] == others[theirs] == 1)
        }
        for own, theirs in sorted(pairs, key=pairs.__getitem__, reverse=True):
            if own not in near and theirs not in near.values():
                near[own] = theirs
        return near

    def missing(self) -> dict[str, str]:
        """Return the time, inputs and outputs that have no column, each with its unit."""
        names = (*self.model.inputs, *(self.model.outputs or ()))
        if self.sample_time is None:
            names = (TIME, *names)
        return {name: self.wanted_unit(name) for name in names if self.find(name) is None}

    def called(self, name: str) -> tuple[str, ...]:
        """Return the possible names of a quantity in a file."""
        said = _UNIT.sub("", self.model.columns.get(name, name))
        return (said, name, TIME_NAME) if name == TIME else (said, name)

    def likeness(self, own: str, theirs: str) -> tuple[int, float]:
        """Return the similarity of a column's name to the possible names of a quantity."""
        return max(likeness(name, theirs) for name in self.called(own))

    def with_unit(self, name: str, title: str) -> str:
        """Return a column's title as the model's `columns` would give it, with its unit."""
        unit = self.unit_in_name(name, title)
        return f'"{title} [{unit}]"' if unit else title

    def unit_in_name(self, name: str, title: str) -> str:
        """Return the unit at the end of a title such as time_ms, if it is not the model's."""
        wanted, (_, _, last) = self.wanted_unit(name), title.rpartition("_")
        if unit_of(title) or last == title or not wanted or plain_unit(last) == plain_unit(wanted):
            return ""
        if last.isdecimal():  # it counts columns
            return ""
        if name == TIME:
            return last if last in TIMES else ""
        found = conversion(last, wanted) if is_installed("units") else None
        return last if found not in (None, (1.0, 0.0)) else ""

    def wanted_unit(self, name: str) -> str:
        """Return the model's unit of a quantity."""
        return "s" if name == TIME else self.model.unit(name)

    def numbers(self, name: str) -> np.ndarray:
        """Read a column of numbers, NaN where it is empty."""
        k = self.column(name)
        self.warn_of_unit(name, k)
        self.warn_of_scale(name, k)
        cells = self.cells(k)
        values = [self.number(cell) for cell in cells]
        for row, value in enumerate(values):
            if value is None or math.isinf(value):
                why = f"expected a number, got {cells[row]!r}. {_remedy(cells[row], name)}"
                self.refuse(row, why, self.header[k])
        factor, offset = self.conversion(name, k)
        return factor * np.array(values, dtype=float) + offset

    # -- units -------------------------------------------------------------------------------------

    def given_unit(self, name: str, k: int) -> str:
        """Return the unit of a column from its header, else from the model's `columns`."""
        return unit_of(self.header[k]) or unit_of(self.model.columns.get(name, ""))

    def warn_of_unit(self, name: str, k: int) -> None:
        """Warn if a column's name ends in a unit other than the one it is read in."""
        title, unit = self.header[k], self.unit_in_name(name, self.header[k])
        if unit and not self.given_unit(name, k):
            wanted = self.wanted_unit(name)
            warn_user(
                f"{self.path}{self.place(None)}: column {title!r} is read as {name} in {wanted}, "
                f"but its name ends in {unit!r}. Remedy: say which it is in the model file: "
                f'columns: {{{name}: "{title} [{unit}]"}}, or "{title} [{wanted}]".',
                RecordWarning,
            )

    def warn_of_scale(self, name: str, k: int) -> None:
        """Warn if an output's expression is in a unit other than that of its column."""
        given = self.given_unit(name, k)
        told = not given or self.wanted_unit(name) or name not in (self.model.outputs or ())
        if told or not is_installed("units"):
            return
        theirs, ours = read_unit(given), output_measure(self.model, name)
        if theirs is None or ours is None or not theirs.is_like(ours):
            return
        scale = ours.factor / theirs.factor
        if abs(scale - 1.0) > 1e-6:
            shown = to_text(self.model.outputs[name])
            warn_user(
                f"{self.path}{self.place(None)}: column {self.header[k]!r} is read as it stands, "
                f"in {given}, but the model's {name} = {shown} is in {ours.to_text()}. Remedy: "
                f'convert it in the model file: outputs: {{{name}: "{scale:.6g}*({shown})"}}.',
                RecordWarning,
            )

    def conversion(self, name: str, k: int) -> tuple[float, float]:
        """Return factor and offset from a column's unit to the model's, or raise `RecordError`.

        Text in round brackets that is not a unit is treated as a remark.
        """
        wanted = self.wanted_unit(name)
        given, title = self.given_unit(name, k), self.header[k]
        if not (given and wanted):
            return 1.0, 0.0
        if plain_unit(given) == plain_unit(wanted):
            return 1.0, 0.0
        may_be_remark = title.endswith(")")
        if not is_installed("units"):
            self.without_pint(title, given, wanted, may_be_remark)
            return 1.0, 0.0
        found = conversion(given, wanted)
        if found is None and not (may_be_remark and read_unit(given) is None):
            self.refuse(
                None,
                f"expected the unit {wanted!r} of the model or one like it, got {given!r}. Remedy: "
                f"correct the header, or the unit in the model file.",
                title,
            )
        return found or (1.0, 0.0)

    def without_pint(self, title: str, given: str, wanted: str, may_be_remark: bool) -> None:
        """Refuse a different unit that cannot be read, or warn of a possible remark."""
        install = 'pip install "sklearn-pgnn[units]"'
        if not may_be_remark:
            self.refuse(
                None,
                f"expected the unit {wanted!r} of the model, got {given!r}. Remedy: convert the "
                f"column, or let it be converted: {install}.",
                title,
            )
        warn_user(
            f"{self.path}{self.place(None)}: column {title!r}: {given!r} is treated as a remark; "
            f"without pint it cannot be checked whether it is a unit. Remedy: {install}.",
            RecordWarning,
        )

    def converted(self) -> dict[str, tuple[str, str]]:
        """Return the columns that are converted: by quantity, the file's unit and the model's."""
        model, found = self.model, {}
        for name in (TIME, *model.inputs, *model.states, *(model.outputs or ())):
            k = self.find(name)
            if k is not None and self.conversion(name, k) != (1.0, 0.0):
                found[name] = self.given_unit(name, k), self.wanted_unit(name)
        return found

    def finite(self, name: str) -> np.ndarray:
        """Read a column that has a number in every row."""
        values = self.numbers(name)
        bad = np.flatnonzero(np.isnan(values))
        if bad.size:
            k, row = self.column(name), int(bad[0])
            cell = self.cells(k)[row]
            got = repr(cell) if isinstance(cell, str) and cell else "nothing"
            self.refuse(
                row,
                f"expected a number, got {got}. Remedy: fill the gap or cut the record there.",
                self.header[k],
            )
        return values

    def output(self, name: str) -> np.ndarray:
        """Read a column that has a number in some row."""
        values = self.numbers(name)
        if values.size and np.all(np.isnan(values)):
            column = self.header[self.column(name)]
            self.refuse(0, "expected a measured value, got none at all.", column)
        return values

    # -- records -----------------------------------------------------------------------------------

    def trajectories(self) -> list[str]:
        """Return the trajectory of every row; by default the file's stem."""
        k = self.find(TRAJECTORY)
        if k is None:
            return [stem_of(self.path)] * self.size
        cells = self.cells(k)
        for row, cell in enumerate(cells):
            if not isinstance(cell, str) and pd.isna(cell):
                self.refuse(row, "expected a name, got nothing.", self.header[k])
        return [f"{cell:.12g}" if isinstance(cell, float) else str(cell) for cell in cells]

    def times(self, names: list[str]) -> np.ndarray:
        """Read the time [s]: numbers, dates, or the samples' own where the file has none."""
        if self.find(TIME) is None and self.sample_time is not None:
            t = np.empty(self.size)
            for _, rows in split_rows(t, names) if self.size else ():
                t[rows] = self.sample_time * np.arange(rows.size)
            return t
        k = self.column(TIME)
        dates = self.dates(k)
        if dates is None:
            return self.finite(TIME)
        bad = np.flatnonzero(dates.isna())
        if bad.size:
            row = int(bad[0])
            self.refuse(
                row,
                f"expected a time such as 2026-01-31 12:00:00.005, got {self.cells(k)[row]!r}. "
                f"Remedy: write all times that way, or as seconds.",
                self.header[k],
            )
        ticks, tick = read_clock(dates, "t") or (np.zeros(0), 0.0)
        t = np.empty(self.size)
        for _, rows in split_rows(t, names):
            t[rows] = (ticks[rows] - ticks[rows[0]]) * tick
        return t

    def check_records(self, t: np.ndarray, names: list[str]) -> None:
        """Refuse a time that does not increase, and records with too few samples."""
        k = self.find(TIME)
        column = TIME if k is None else self.header[k]
        if not t.size:
            self.refuse(None, f"expected at least {MIN_SAMPLES} samples, got 0.", column)
        for name, rows in split_rows(t, names):
            still = np.flatnonzero(np.diff(t[rows]) <= 0)
            if still.size and k is not None:
                self.refuse_still(k, t, rows[still[0]], rows[still[0] + 1])
            if rows.size < MIN_SAMPLES:
                self.refuse(
                    rows[0],
                    f"expected at least {MIN_SAMPLES} samples in a record, got {rows.size} in "
                    f"{name!r}.",
                    column,
                )

    def refuse_still(self, k: int, t: np.ndarray, before: int, here: int) -> NoReturn:
        """Refuse a time that does not increase from one row to another."""
        cells, dated = self.cells(k), self.dates(k) is not None
        got, last = (str(cells[row]) if dated else f"{t[row]:.12g}" for row in (here, before))
        self.refuse(
            here,
            f"expected time to increase, got {got} after {last} in {self.name_of(before)}. Remedy: "
            f"sort the record, or separate several by a column 'trajectory'.",
            self.header[k],
        )


def unit_of(title: str) -> str:
    """Return the unit in a column's header, empty if there is none.

    Examples
    --------
    >>> unit_of("torque [N m]"), unit_of("torque")
    ('N m', '')
    """
    found = _UNIT.search(title)
    return "" if found is None else found[1][1:-1].strip()


def read_each(read, paths, model: PhysicsModel, sample_time) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read several files as one X and y; every file is at least one trajectory.

    Parameters
    ----------
    read : callable
        Reads one file: ``read(path, model, sample_time)``.
    paths : iterable of str or path-like
        The files.
    model : PhysicsModel
        Defines the columns.
    sample_time : float or None
        Sample interval [s] of files without a time.

    Returns
    -------
    X : DataFrame
        ``trajectory`` holds the file's stem, made unique, followed by the file's own names.
    y : DataFrame
        The outputs.
    """
    paths = list(paths)
    if not paths:
        raise RecordError("expected at least one file of records, got none.")
    tables, outputs = [], []
    for path, name in zip(paths, _unique([stem_of(path) for path in paths]), strict=True):
        X, y = read(path, model, sample_time)
        own = X[TRAJECTORY]
        alone = own.nunique() == 1 and own.iloc[0] == stem_of(path)
        tables.append(X.assign(**{TRAJECTORY: name if alone else name + "/" + own}))
        outputs.append(y)
    return pd.concat(tables, ignore_index=True), pd.concat(outputs, ignore_index=True)


def stem_of(path) -> str:
    """Return the stem of a file's name, with question marks for bytes that are no text."""
    return Path(path).stem.encode(errors="replace").decode()


def _unique(names: list[str]) -> list[str]:
    """Return the names made unique; repeated ones get a number."""
    found: list[str] = []
    for name in names:
        new, count = name, 1
        while new in found:
            count += 1
            new = f"{name}-{count}"
        found.append(new)
    return found


def _remedy(cell, name: str) -> str:
    """Return the remedy for a cell that is not a number."""
    if name == TIME and re.search(r"\d[:./-]\d", str(cell)):
        return "Remedy: write dates as 2026-01-31 12:00:00.005, or the time in seconds."
    return "Remedy: leave the cell empty where nothing was measured."
