"""A table of cells, as in a CSV file or on a sheet: its header, and the rows of units under it."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.units import NONE, conversion, read_unit
from sklearn_pgnn.trajectories.cell_text import NOTHING, UnclearTimes, read_number, read_times
from sklearn_pgnn.trajectories.file_table import FileTable
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY
from sklearn_pgnn.trajectories.shown import SHORT, listed
from sklearn_pgnn.trajectories.titles import is_called, name_of
from sklearn_pgnn.user_line import warn_user

_LIKE_NUMBER = re.compile(r"['\"]?[+-]?[\d.,]*\d")
#: rows in which the header is looked for
HEAD = 100
#: most rows between the header and the first sample
BELOW = 4


class CellTable(FileTable):
    """A file as rows of cells, each with the number of its line."""

    rows: list[list[Any]]
    lines: list[int]
    header_line: int

    def take(self, rows: list[list[Any]], lines: list[int]) -> None:
        """Take the rows of the file, and find what is header and what is units."""
        start = header_row(rows[:HEAD], self.model)
        self.header = [_text(cell) for cell in rows[start]]
        self.header_line = lines[start]
        self.rows, self.lines = rows[start + 1 :], lines[start + 1 :]
        while self.rows and (_is_empty(self.rows[-1]) or _is_text(self.rows[-1])):
            if not _is_empty(self.rows[-1]):
                self.tell_left_out(self.lines[-1], self.rows[-1])
            del self.rows[-1], self.lines[-1]
        self.check_header()
        self.take_units()
        if not self.units:
            above = (row for row in reversed(rows[:start]) if self.are_of_most(row))
            self.units = _told_units(next(above, ()), known=True)
        self.columns: dict[int, list[Any]] = {}

    def check_header(self) -> None:
        """Refuse a file that begins with numbers."""
        if all(_is_number(name) for name in self.header):
            wanted = wanted_names(self.model)[1:]
            self.refuse(
                None,
                f"expected a header with the names of the columns, got '{listed(self.header)}'. "
                f"Remedy: write them above the numbers, as in {listed(wanted)}.",
            )

    def take_units(self) -> None:
        """Take the rows without any number under the header: units, and what else they tell."""
        below = 0
        while below < min(BELOW, len(self.rows)) and (
            _is_text(row := self.rows[below]) or (_is_told(row) and _are_units(row))
        ):
            below += 1
        units = next((row for row in self.rows[:below] if _are_units(row)), None)
        for line, row in zip(self.lines[:below], self.rows[:below], strict=True):
            if row is not units:
                self.tell_left_out(line, row)
        self.units = _told_units(units or ())
        self.rows, self.lines = self.rows[below:], self.lines[below:]

    def are_of_most(self, row: Sequence[Any]) -> bool:
        """Whether a row above the header has units for most of its columns."""
        told = _told_units(row, known=True)
        many = 2 * len(told) > sum(map(bool, self.header)) and _is_told(row) and _are_units(row)
        return many and self.are_like_the_models(told)

    def quantities(self) -> tuple[str, ...]:
        """Return the time, the inputs and the outputs."""
        return TIME, *self.model.inputs, *(self.model.outputs or ())

    def are_like_the_models(self, units: Mapping[int, str]) -> bool:
        """Whether most units measure what the model's do: letters that count columns do not."""
        wanted = {
            k: self.wanted_unit(n) for n in self.quantities() if (k := self.find(n)) is not None
        }
        both = [(units[k], unit) for k, unit in wanted.items() if unit and k in units]
        return 2 * sum(conversion(*pair) is not None for pair in both) >= len(both)

    def tell_left_out(self, line: int, row: Sequence[Any]) -> None:
        """Warn of a row that is no sample."""
        told = listed(_text(cell) for cell in row if _text(cell))
        warn_user(
            f"{self.path}{self.place_of(line)}: this row has no number and is left out: {told}.",
            RecordWarning,
        )

    @property
    def size(self) -> int:
        """Number of samples."""
        return len(self.rows)

    def place(self, row: int | None) -> str:
        """Return the place of a row, or of the header."""
        return self.place_of(self.header_line if row is None else self.lines[row])

    def place_of(self, line: int) -> str:
        """Return the place of a line."""
        return f":{line}"

    def name_of(self, row: int) -> str:
        """Return the line of a row."""
        return f"line {self.lines[row]}"

    def cells(self, k: int) -> list[Any]:
        """Return the cells of a column."""
        if k not in self.columns:
            cells = (row[k] if k < len(row) else "" for row in self.rows)
            self.columns[k] = [cell.strip() if isinstance(cell, str) else cell for cell in cells]
        return self.columns[k]


def wanted_names(model: PhysicsModel) -> list[str]:
    """Return what the model calls the columns of a file."""
    names = (TRAJECTORY, TIME, *model.inputs, *(model.outputs or ()))
    called = [model.columns.get(name, name) for name in names]
    return [*called, *(name_of(name) for name in called if name.endswith("]"))]


def quantities_in(row: Sequence[Any], names: Sequence[str]) -> int:
    """Return how many names a row has, be it with units."""
    titles = [text for cell in row if (text := _text(cell)).startswith(tuple(names))]
    return sum(any(title == n or is_called(title, n) for title in titles) for n in names)


def header_row(rows: Sequence[Sequence[Any]], model: PhysicsModel) -> int:
    """Return the row that names most of the model's quantities, else that above the numbers."""
    names = wanted_names(model)
    found = [quantities_in(row, names) for row in rows]
    return found.index(max(found)) if max(found) > 0 else _above_numbers(rows)


def _above_numbers(rows: Sequence[Sequence[Any]]) -> int:
    """Return the first of the rows of texts above the numbers, of more than half their width."""
    widths = [_width(row) for row in rows]
    numbers = [any(map(_is_number, row)) for row in rows]
    usual = Counter(w for w, is_data in zip(widths, numbers, strict=True) if is_data)
    most = usual.most_common(1)[0][0] if usual else widths[0]
    data = [is_data and width >= most for is_data, width in zip(numbers, widths, strict=True)]
    header = next((k for k in range(len(rows)) if all(data[k : k + 3]) and data[k]), len(rows))
    while header > 0 and _is_told(rows[header - 1]) and 2 * widths[header - 1] > most:
        header -= 1
    return header if header < len(rows) else 0


def _width(row: Sequence[Any]) -> int:
    """Return the number of cells up to the last that is not empty."""
    return max((k + 1 for k, cell in enumerate(row) if _text(cell)), default=0)


def _is_empty(row: Sequence[Any]) -> bool:
    return not _width(row)


def _text(cell: Any) -> str:
    return "" if cell is None else str(cell).strip().strip("\u200b\ufeff")


def _is_number(cell: Any) -> bool:
    return any(read_number(cell, mark) is not None for mark in ".,")


def _is_told(row: Sequence[Any]) -> bool:
    """Whether a row has texts, and neither a number nor a date; a unit may be a 1."""
    told = [cell for cell in row if _text(cell).lower() not in NOTHING]
    numbers = [cell for cell in told if _is_number(cell)]
    ones = all(_text(cell) == "1" for cell in numbers)
    fewer = 2 * len(numbers) < len(told)
    return ones and fewer and not any(_is_sample(cell) for cell in told)


def _is_text(row: Sequence[Any]) -> bool:
    """Whether a row has texts, and not even a 1."""
    return _is_told(row) and not any(_text(cell) == "1" for cell in row)


def _is_sample(cell: Any) -> bool:
    """Whether a cell is a time, or begins as a number does; a unit may begin with a 1."""
    if _LIKE_NUMBER.match(_text(cell)) and not _text(cell).startswith("1"):
        return True
    try:
        return not _is_number(cell) and read_times([cell]) is not None
    except UnclearTimes:
        return True


def _are_units(row: Sequence[Any]) -> bool:
    """Whether most of what is told are units."""
    units = [_unit(cell) for cell in row if _text(cell)]
    return sum(map(_is_known, units)) > len(units) / 2


def _told_units(row: Sequence[Any], known: bool = False) -> dict[int, str]:
    """Return what a row of units tells by column, or only those that are known."""
    units = {k: unit for k, cell in enumerate(row) if (unit := _unit(cell))}
    return {k: unit for k, unit in units.items() if not known or _is_known(unit)}


def _is_known(unit: str) -> bool:
    return unit in NONE or (len(unit) < SHORT and read_unit(unit) is not None)


def _unit(cell: Any) -> str:
    """Return what a cell in a row of units tells, without brackets."""
    text = _text(cell)
    for pair in ("[]", "()", "{}", "<>"):
        if text[:1] == pair[0] and text[-1:] == pair[1]:
            return text[1:-1].strip()
    return text
