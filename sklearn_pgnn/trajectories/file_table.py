"""A file of measured samples as X and y: columns by name, errors with their location."""

import math
import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from itertools import product
from typing import Any, NoReturn

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics.effects.differences import is_mark, mark_by_name, values_of
from sklearn_pgnn.physics.expressions import to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.unit_check import output_measure
from sklearn_pgnn.physics.units import conversion, is_like, plain_unit, read_unit, unit_text
from sklearn_pgnn.trajectories.cell_text import (
    UnclearTimes,
    mark_of,
    may_be_two,
    read_number,
    read_times,
    whole_numbers,
)
from sklearn_pgnn.trajectories.clock import (
    ClockColumn,
    check_sample_interval,
    other_unit,
    usual_step,
)
from sklearn_pgnn.trajectories.file_text import stem
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES, TIME, TRAJECTORY, of_files, split_rows
from sklearn_pgnn.trajectories.shown import SAID, SHORT, as_yaml, cut, listed, shown
from sklearn_pgnn.trajectories.tables import read_clock
from sklearn_pgnn.trajectories.titles import (
    bracketed_unit,
    is_called,
    likeness,
    name_of,
    names_alike,
    split_title,
    unit_of,
    units_alike,
)
from sklearn_pgnn.user_line import warn_user

#: units of time, other than the second, in which a column's name may end
TIMES = ("ms", "us", "ns", "min", "h")
#: name of a file that is no record: a row for every file, or folder, with what holds throughout
CONDITIONS = "conditions"
#: names of the time in files, other than t
TIME_NAME = "time"
#: remedy for a file without a time
NO_TIME = "Or, if it has no time, give the sample interval: sample_time=0.01 [s] (--sample-time)."
#: most columns whose names are compared with that of a missing one
COMPARED = 2000
#: by how much a sample time may differ from that of a column in its place without a warning
DIFFERENT = 0.05
#: ends of names of temperatures, which as units are the coulomb and the farad
_DEGREES = {"C": "degC", "F": "degF"}
_DATE = re.compile(r"\d:\d|\d[./-]\d+[./-]\d")
_WITH_UNIT = re.compile(r"[+-]?\d[\d.,]*([eE][+-]?\d+)?\s*([^\d\s.,:/×+-]\S{0,9})")


class FileTable(ABC):
    """A file as a header and columns of cells.

    A sample time [s] is that of a file without a time, and overrides the column of one with a time.
    """

    #: the file's name in error messages
    kind = "file"
    #: whether a comma is the mark of the decimals where the numbers do not tell
    decimal_comma = False
    header: list[str]

    def __init__(self, path: str, model: PhysicsModel, sample_time: float | None = None):
        self.path, self.model, self.sample_time = path, model, sample_time
        #: units in a row under the header, by column
        self.units: dict[int, str] = {}
        #: inputs that a table of conditions gives for this file
        self.conditions: dict[str, float] = {}
        self._dates: dict[int, pd.Series | None] = {}
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

    def dates(self, k: int) -> pd.Series | None:
        """Read a column as dates or time differences; None if its cells are something else."""
        if k not in self._dates:
            self._dates[k] = self.read_dates(k)
        return self._dates[k]

    def read_dates(self, k: int) -> pd.Series | None:
        """Read what `dates` keeps."""
        cells = self.cells(k)
        if not len(cells) or any(read_number(cells[0], mark) is not None for mark in ".,"):
            return None
        try:
            return read_times([*cells])
        except UnclearTimes as error:
            self.refuse(
                0,
                f"expected times with one meaning, got {shown(cells[0])}. {error}",
                self.header[k],
            )

    def refuse(self, row: int | None, why: str, column: str | None = None) -> NoReturn:
        """Raise `RecordError` for a row, or for the header."""
        about = "" if column is None else f"column {shown(column)}: "
        place = self.path + self.place(row)
        raise RecordError(f"{place}: {about}{cut(' '.join(why.split()), SAID)}") from None

    def read(self, needs_outputs: bool = True) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Return X and y under the model's own names; every output is there where it is needed."""
        model = self.model
        names = self.trajectories()
        t = self.times(names)
        inputs = {name: self.input(name, names, t) for name in model.inputs}
        outputs = {
            name: self.output(name, needs_outputs)
            for name in model.outputs or ()
            if needs_outputs or self.find(name) is not None
        }
        states = {n: self.numbers(n) for n in model.states if self.find(n) is not None}
        t, kept = self.settled(t, names, [*inputs.values(), *outputs.values(), *states.values()])
        X = pd.DataFrame({TRAJECTORY: names, TIME: t, **inputs, **states})
        y = pd.DataFrame(outputs, index=X.index)
        return of_files(X.iloc[kept].reset_index(drop=True)), y.iloc[kept].reset_index(drop=True)

    # -- columns -----------------------------------------------------------------------------------

    def find(self, name: str) -> int | None:
        """Find a quantity of the model in the header, by its whole name or without its unit.

        If a column has no unit, the model's `columns` may give it: ``angle [deg]``.
        """
        wanted = self.model.columns.get(name, name)
        for is_it in _ways_to_find(wanted):
            found = [k for k, text in enumerate(self.header) if is_it(text)]
            if len(found) > 1:
                self.refuse(
                    None,
                    f"expected it once, got it {len(found)} times. Remedy: keep the right one, and "
                    f"rename or delete the others.",
                    wanted,
                )
            if found:
                return found[0]
        return None

    def column(self, name: str) -> int:
        """Return the column of a quantity, or raise `RecordError`."""
        found = self.find(name)
        if found is None:
            self.refuse(
                None,
                f"missing; the file has {listed(self.header)}. Remedy: {self.remedy(name)}",
                self.model.columns.get(name, name),
            )
        return found

    def unused(self) -> dict[str, str]:
        """Return the columns that match no quantity of the model, each with its unit."""
        model = self.model
        taken = {self.find(n) for n in (TIME, TRAJECTORY, *model.inputs, *model.states)}
        taken |= {self.find(n) for n in model.outputs or ()}
        taken |= {0} if stem(self.path).lower() == CONDITIONS else set()  # which names the files
        free = [text for k, text in enumerate(self.header) if k not in taken]
        return dict(map(split_title, free))

    def remedy(self, name: str) -> str:
        """Return the remedy for a missing column: the most similar ones of the unused columns."""
        last = f" {NO_TIME}" if name == TIME else ""
        near = self.nearest()
        if name not in near and (free := self.unused()):
            return (
                f"say in the model file what the {self.kind} calls it, in columns: "
                f"{{{name}: ...}}; not used so far: {listed(free)}.{last}"
            )
        if name not in near:
            if is_mark(self.model, name):
                return f"add it to the file, {values_of(name)}, or to a table {CONDITIONS}.csv."
            table = f", or to a table {CONDITIONS}.csv if it is the same all through a file"
            table = table if name in self.model.inputs else ""
            without = "." if name == TIME else ", or take it out of the model."
            return f"add it to the file{table}{without}{last}"
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
        free, missing = dict([*self.unused().items()][:COMPARED]), self.missing()
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
        missing = (name for name in names if self.find(name) is None)
        return {name: self.wanted_unit(name) for name in missing if name not in self.conditions}

    def called(self, name: str) -> tuple[str, ...]:
        """Return the possible names of a quantity in a file."""
        said = name_of(self.model.columns.get(name, name))
        return (said, name, TIME_NAME) if name == TIME else (said, name)

    def likeness(self, own: str, theirs: str) -> tuple[int, float]:
        """Return the similarity of a column's name to the possible names of a quantity."""
        return max(likeness(name, theirs) for name in self.called(own))

    def with_unit(self, name: str, title: str) -> str:
        """Return a column's title as the model's `columns` would give it, with its unit."""
        unit = self.unit_in_name(name, title)
        return f'"{title} [{unit}]"' if unit else as_yaml(title)

    def unit_in_name(self, name: str, title: str) -> str:
        """Return the unit at the end of a title such as time_ms, if it is not the model's."""
        wanted, (_, _, last) = self.wanted_unit(name), title.rpartition("_")
        if unit_of(title) or last == title or not wanted or plain_unit(last) == plain_unit(wanted):
            return ""
        if last.isdecimal():  # it counts columns
            return ""
        if name == TIME:
            return last if last in TIMES else ""
        if title != name and last in _DEGREES and conversion("K", wanted):
            last = _DEGREES[last]
        found = conversion(last, wanted)
        return last if found not in (None, (1.0, 0.0)) else ""

    def wanted_unit(self, name: str) -> str:
        """Return the model's unit of a quantity."""
        return "s" if name == TIME else self.model.unit(name)

    # -- numbers -----------------------------------------------------------------------------------

    def numbers(self, name: str) -> np.ndarray:
        """Read a column of numbers, NaN where it is empty."""
        k = self.column(name)
        self.warn_of_unit(name, k)
        self.warn_of_scale(name, k)
        cells, mark = self.cells(k), self.mark(k)
        values = [read_number(cell, mark) for cell in cells]
        for row, value in enumerate(values):
            if value is None or math.isinf(value):
                self.refuse_cell(row, k, name)
        factor, offset = self.conversion(name, k)
        return factor * np.array(values, dtype=float) + offset

    def mark(self, k: int) -> str:
        """Return the mark of the decimals in a column: by its own cells, else by other columns."""
        cells, own = self.cells(k), self.marks.get(k, "")
        if own or not self.marks:
            return own or "."
        everywhere = {mark for mark in self.marks.values() if mark}
        unclear = [row for row, cell in enumerate(cells) if may_be_two(cell)]
        if len(everywhere) == 1:
            return everywhere.pop()
        if unclear and (everywhere or not self.decimal_comma):
            self.refuse(
                unclear[0],
                f"expected a number with one meaning, got {shown(cells[unclear[0]])}, with "
                f"thousands or decimals. Remedy: write numbers with a decimal point, and without "
                f"separators of thousands.",
                self.header[k],
            )
        return "," if self.decimal_comma else "."

    @cached_property
    def marks(self) -> dict[int, str]:
        """The marks of the decimals by column; nothing where there is no comma at all."""
        model = self.model
        used = {self.find(n) for n in (TIME, *model.inputs, *model.states, *(model.outputs or ()))}
        columns = {k: self.cells(k) for k in used - {None} if k is not None}
        cells = (cell for column in columns.values() for cell in column)
        if not any(isinstance(cell, str) and "," in cell for cell in cells):
            return {}
        return {k: mark_of(cells) for k, cells in columns.items()}

    def refuse_cell(self, row: int, k: int, name: str) -> NoReturn:
        """Refuse a cell that holds no number."""
        cell, title = self.cells(k)[row], self.header[k]
        unit = _WITH_UNIT.fullmatch(cell) if isinstance(cell, str) else None
        if self.is_header(row):
            self.refuse(
                row,
                "expected a number, got the header again. Remedy: split the file there, if another "
                "record begins, or delete the line.",
                title,
            )
        if name == TIME and _DATE.search(str(cell)[:SHORT]):
            remedy = "write dates as 2026-01-31 12:00:00.005, or the time in seconds."
        elif unit and read_number(cell) is None:
            remedy = f"write the unit into the header, '{name} [{unit[2]}]', and the number alone."
        elif any(read_number(cell, mark) is not None for mark in ".,"):
            remedy = "write all numbers of a column with one mark of the decimals."
        elif re.search(r"\d", str(cell)[:SHORT]):
            remedy = "write numbers as 0.0015 or 1.5e-3, or leave the cell empty."
        elif name in self.model.inputs or name == TIME:
            remedy = "give a number in every row, or cut the record there."
        else:
            remedy = "leave the cell empty where nothing was measured."
        self.refuse(row, f"expected a number, got {shown(cell)}. Remedy: {remedy}", title)

    def is_header(self, row: int) -> bool:
        """Whether a row repeats the header."""
        texts = [str(self.cells(k)[row])[:SHORT].strip() for k in range(min(len(self.header), 50))]
        return sum(map(bool, texts)) > 0 and texts == [t[:SHORT].strip() for t in self.header[:50]]

    # -- units -------------------------------------------------------------------------------------

    def given_unit(self, name: str, k: int) -> str:
        """Return the unit of a column: in the header, under it, or in the model's `columns`."""
        title, below = self.header[k], self.units.get(k, "")
        above = bracketed_unit(title)
        if above and below and plain_unit(above) != plain_unit(below):
            self.refuse(
                None,
                f"expected one unit, got {above!r} in the header and {below!r} below. Remedy: "
                f"correct one of them.",
                title,
            )
        said = bracketed_unit(self.model.columns.get(name, ""))
        return above or below or said or unit_of(title)

    def warn_of_unit(self, name: str, k: int) -> None:
        """Warn if a column's name ends in a unit other than the one it is read in."""
        title, unit = self.header[k], self.unit_in_name(name, self.header[k])
        end = title.rpartition("_")[2]
        if unit and not self.given_unit(name, k):
            wanted = self.wanted_unit(name)
            warn_user(
                f"{self.path}{self.place(None)}: column {title!r} is read as {name} in {wanted}, "
                f"but its name ends in {end!r}. Remedy: say which it is in the model file: "
                f'columns: {{{name}: "{title} [{unit}]"}}, or "{title} [{wanted}]".',
                RecordWarning,
            )

    def warn_of_scale(self, name: str, k: int) -> None:
        """Warn if an output's expression is in a unit other than that of its column."""
        given = self.given_unit(name, k)
        told = not given or self.wanted_unit(name) or name not in (self.model.outputs or ())
        if told:
            return
        theirs, ours = read_unit(given), output_measure(self.model, name)
        if theirs is None or ours is None or not is_like(theirs, ours):
            return
        scale = ours.magnitude / theirs.magnitude
        if abs(scale - 1.0) > 1e-6:
            shown = to_text(self.model.outputs[name])
            warn_user(
                f"{self.path}{self.place(None)}: column {self.header[k]!r} is read as it stands, "
                f"in {given}, but the model's {name} = {shown} is in {unit_text(ours)}. Remedy: "
                f'convert it in the model file: outputs: {{{name}: "{scale:.6g}*({shown})"}}.',
                RecordWarning,
            )

    def conversion(self, name: str, k: int) -> tuple[float, float]:
        """Return factor and offset from a column's unit to the model's, or raise `RecordError`.

        Text in round brackets that is not a unit is treated as a remark.
        """
        wanted = self.wanted_unit(name)
        given, title = self.given_unit(name, k), self.header[k]
        if not (given and wanted) or (name == TIME and self.dates(k) is not None):
            return 1.0, 0.0
        if plain_unit(given) == plain_unit(wanted):
            return 1.0, 0.0
        may_be_remark = title.endswith(")") and bracketed_unit(title) == given
        found = conversion(given, wanted)
        if found is None and not (may_be_remark and read_unit(given) is None):
            self.refuse(
                None,
                f"expected the unit {wanted!r} of the model or one like it, got {shown(given)}. "
                f"Remedy: correct the header, or the unit in the model file.",
                title,
            )
        return found or (1.0, 0.0)

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
            got = shown(cell) if isinstance(cell, str) and cell else "nothing"
            self.refuse(
                row,
                f"expected a number, got {got}. Remedy: fill the gap or cut the record there.",
                self.header[k],
            )
        return values

    def knows(self, name: str) -> bool:
        """Return whether an input without a column is a condition of the file, or a mark."""
        is_known = name in self.conditions or is_mark(self.model, name)
        return is_known and self.find(name) is None

    def input(self, name: str, names: list[str], t: np.ndarray) -> np.ndarray:
        """Read an input: a column, a condition of the file, or a mark by the record's name."""
        if not self.knows(name):
            return self.finite(name)
        if name in self.conditions:
            return np.full(self.size, self.conditions[name])
        file, marks = stem(self.path), np.zeros(self.size)
        for own, rows in split_rows(t, names) if self.size else ():
            told = mark_by_name(name, (file, own, f"{file}/{own}"), t[rows] - t[rows[0]])
            if told is None:
                self.column(name)  # which refuses it
            marks[rows] = told
        return marks

    def output(self, name: str, needed: bool = True) -> np.ndarray:
        """Read a column that, where it is needed, has a number in some row."""
        values = self.numbers(name)
        if needed and values.size and np.all(np.isnan(values)):
            self.refuse(
                0,
                "expected a measured value, got none at all. Remedy: take the output out of the "
                "model, or give with this file another one that has it.",
                self.header[self.column(name)],
            )
        return values

    def refuse_unmeasured(self, measured: Iterable[str]) -> NoReturn:
        """Refuse files none of which has a value of some output."""
        name = next(name for name in self.model.outputs if name not in measured)
        self.column(name)
        self.refuse(
            0,
            "expected a measured value in some of the files, got none at all. Remedy: take the "
            "output out of the model, or add a file that has it.",
            name,
        )

    # -- records -----------------------------------------------------------------------------------

    def trajectories(self) -> list[str]:
        """Return the trajectory of every row; by default the file's stem."""
        k = self.find(TRAJECTORY)
        if k is None:
            return [stem(self.path)] * self.size
        cells = self.cells(k)
        for row, cell in enumerate(cells):
            if not isinstance(cell, str) and pd.isna(cell):
                self.refuse(row, "expected a name, got nothing.", self.header[k])
        return [f"{cell:.12g}" if isinstance(cell, float) else str(cell) for cell in cells]

    def times(self, names: list[str]) -> np.ndarray:
        """Read the time [s]: numbers, dates, or the samples' own where a sample time is given."""
        if self.sample_time is not None:
            t = np.empty(self.size)
            for _, rows in split_rows(t, names) if self.size else ():
                t[rows] = self.sample_time * np.arange(rows.size)
            self.check_overridden(t, names)
            return t
        k = self.column(TIME)
        dates = self.dates(k)
        return self.seconds(k) if dates is None else self.since_first(k, dates, names)

    def seconds(self, k: int) -> np.ndarray:
        """Read a time in numbers."""
        t, title = self.finite(TIME), self.header[k]
        unit = "" if self.given_unit(TIME, k) else other_unit(t)
        if unit:
            self.refuse(
                0,
                f"expected seconds, got {self.cells(k)[0]}. Remedy: {_of_clock(title, unit)}write "
                f"dates as 2026-01-31 12:00:00.005.",
                title,
            )
        ticks = whole_numbers(self.cells(k))
        return t if ticks is None else self.conversion(TIME, k)[0] * (ticks - ticks[0])

    def since_first(self, k: int, dates: pd.Series, names: list[str]) -> np.ndarray:
        """Return dates as seconds since the first row of each record."""
        bad = np.flatnonzero(dates.isna())
        if bad.size:
            row = int(bad[0])
            if self.is_header(row):
                self.refuse_cell(row, k, TIME)
            self.refuse(
                row,
                f"expected a time such as 2026-01-31 12:00:00.005, got "
                f"{shown(self.cells(k)[row])}. Remedy: write all times that way, or as seconds.",
                self.header[k],
            )
        ticks, tick = read_clock(dates, "t") or (np.zeros(0), 0.0)
        t = np.empty(self.size)
        for _, rows in split_rows(t, names):
            t[rows] = (ticks[rows] - ticks[rows[0]]) * tick
        return t

    def check_overridden(self, t: np.ndarray, names: list[str]) -> None:
        """Refuse rows out of order, and warn if `t` [s] overrides a column that tells otherwise."""
        k = self.find(TIME)
        if k is None:
            return
        try:
            dates = self.dates(k)
            own = self.finite(TIME) if dates is None else self.since_first(k, dates, names)
        except RecordError:  # a column that cannot be read contradicts nothing
            return
        clock = ClockColumn(self, k)
        for _, rows in split_rows(t, names) if t.size else ():
            told = clock.counted_on(own[rows], rows)
            clock.check(told, rows, may_stand=True)
            span, taken = told[-1] - told[0], t[rows[-1]] - t[rows[0]]
            if abs(span - taken) > 2 * usual_step(told) + DIFFERENT * taken:
                warn_user(
                    f"{self.path}{self.place(None)}: by the sample time a record of {rows.size} "
                    f"rows takes {taken:.6g} s, by the column {self.header[k]!r}, which it "
                    f"overrides, {span:.6g} s. Remedy: leave the sample time out, if the column is "
                    f"right.",
                    RecordWarning,
                )
                return

    def settled(
        self, t: np.ndarray, names: list[str], columns: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the time and the rows that are kept, or refuse a time that does not increase."""
        k = self.find(TIME)
        title = TIME if k is None else self.header[k]
        if not t.size:
            self.refuse(None, f"expected at least {MIN_SAMPLES} samples, got 0.", title)
        values = np.column_stack(columns) if columns else np.zeros((t.size, 0))
        clock = ClockColumn(self, k) if self.sample_time is None and k is not None else None
        t, dropped = t.copy(), np.zeros(t.size, dtype=bool)
        for name, rows in split_rows(t, names):
            if clock is not None:
                t[rows], dropped[rows] = clock.settled(t[rows], rows, values[rows])
            left = rows[~dropped[rows]]
            if left.size < MIN_SAMPLES:
                self.refuse(
                    rows[0],
                    f"expected at least {MIN_SAMPLES} samples in a record, got {left.size} in "
                    f"{shown(name)}.",
                    title,
                )
        if clock is not None:
            clock.tell()
        return t, np.flatnonzero(~dropped)


def _of_clock(title: str, unit: str) -> str:
    """Return the remedy for a clock in another unit; there is none for a date in one number."""
    if unit == "?":
        return ""
    seconds = f', or "{title} [s]" if it is in seconds' if unit == "d" else ""
    return (
        f"if it counts in {unit}, give the unit, in the header or in the model file: columns: "
        f'{{t: "{title} [{unit}]"}}{seconds}; or '
    )


def _ways_to_find(wanted: str) -> list[Callable[[str], bool]]:
    """Return the tests for a title, best first: itself, with a unit, without the model's unit."""
    ways: list[Callable[[str], bool]] = [
        lambda title: title == wanted,
        lambda title: is_called(title, wanted),
    ]
    if wanted.endswith("]"):
        bare = name_of(wanted)
        ways.append(lambda title: title == bare)
    return ways
