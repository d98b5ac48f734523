"""The clock of one record: counters that begin again, rows at one time, and what else it may be."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.trajectories.shown import cut, shown
from sklearn_pgnn.trajectories.tables import TIME
from sklearn_pgnn.user_line import warn_user

if TYPE_CHECKING:
    from sklearn_pgnn.trajectories.file_table import FileTable
import math
from numbers import Real

from sklearn_pgnn.exceptions import OptionError

#: sizes of counters, in the unit of the file
COUNTERS = (*(2.0**bits for bits in (8, 10, 12, 16, 20, 24, 31, 32)), 1e3, 1e4, 1e5, 1e6)
#: times [s] after which clocks begin again: a second, a minute, an hour, a day
ROUNDS = (1.0, 60.0, 3_600.0, 86_400.0)
#: how far [s] local time goes back in autumn, and a clock without AM and PM
OF_DATES = (3_600.0, 43_200.0)
#: largest part of the rows that may share their time with the row before, as at the events of a
#: simulation; more of them are a clock that is too coarse
AT_EVENTS = 0.2
#: shortest step [s] at which a clock counts tens of thousands of seconds
FASTEST = 2e-6
_TOO_COARSE = (
    "Remedy: log finer stamps, or give the sample interval: sample_time=0.01 [s] (--sample-time), "
    "which overrides the column."
)
_SORT = "Remedy: sort the rows by time."
_SPLIT = "Remedy: split the file there, or name each record in a column 'trajectory'."
#: what a clock since 1970 shows in other units than the second, below; a question mark is none
_EPOCHS = ((1e17, "ns"), (1e16, "?"), (1e14, "us"), (1e13, "?"), (1e11, "ms"))
#: days that spreadsheets and MATLAB count, and astronomers
_DAYS = ((20_000, 90_000), (700_000, 800_000), (2_440_000, 2_500_000))


class Backward(NamedTuple):
    """A row whose time does not increase, why, and the remedy."""

    row: int
    why: str


def usual_step(t: np.ndarray) -> float:
    """Return the median of the steps forward, NaN where there is none.

    >>> usual_step(np.array([0.0, 0.0, 0.5, 1.0, 0.5, 1.0]))
    0.5
    """
    steps = np.diff(t)
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else np.nan


def counted_on(t: np.ndarray, second: float, dated: bool = False) -> tuple[np.ndarray, float]:
    """Return a time that goes on where its counter began again, and the counter's size or 0."""
    step, drops = usual_step(t), np.flatnonzero(np.diff(t) < 0)
    if not drops.size or not np.isfinite(step):
        return t, 0.0
    sizes = t[drops] - t[drops + 1] + step
    for size in OF_DATES if dated else (*COUNTERS, *(second * r for r in ROUNDS)):
        again = np.abs(t[drops + 1] - t[0]) < step  # then each may be a record of its own
        if np.all(np.abs(sizes - size) <= step) and step < size / 8 and not again.any():
            onward = np.zeros(t.size)
            onward[drops + 1] = size
            return t + np.cumsum(onward), size
    return t, 0.0


def rows_at_one_time(t: np.ndarray, same: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows that repeat the one before, and those replaced by the next, at one time."""
    still = np.diff(t) == 0
    repeats = np.flatnonzero(still & same) + 1
    kept = np.delete(np.arange(t.size), repeats)
    replaced = kept[:-1][np.diff(t[kept]) == 0]
    if replaced.size > AT_EVENTS * kept.size:
        return repeats[:0], replaced[:0]
    return repeats, replaced


def backward(t: np.ndarray) -> Backward | None:
    """Return the first row whose time does not increase, with what its clock may be."""
    steps = np.diff(t)
    bad = np.flatnonzero(steps <= 0)
    if not bad.size:
        return None
    down = np.flatnonzero(steps < 0)
    if down.size <= 0.01 * bad.size or not down.size:
        return Backward(int(bad[0]) + 1, f"the stamps are too coarse. {_TOO_COARSE}")
    row = int(down[0]) + 1
    if down.size > 0.9 * steps.size:
        return Backward(row, f"the rows run backward in time. {_SORT}")
    return Backward(row, _why(t, row))


def _why(t: np.ndarray, row: int) -> str:
    step, drop = usual_step(t), t[row - 1] - t[row]
    if abs(t[row] - t[0]) <= 2 * step and row > 2:
        return f"the clock begins again, so this is another record. {_SPLIT}"
    if drop <= 20 * step:
        return f"the rows are out of order. {_SORT}"
    return f"the clock goes back. {_SORT[:-1]}, or if another record begins there: {_SPLIT[8:]}"


def other_unit(t: np.ndarray) -> str:
    """Return the unit that a time, which is said to be in seconds, seems to have; else nothing.

    Numbers above 1e11 are no seconds since 1970; a question mark stands for no unit at all. Days of
    a spreadsheet, now about 46 000, have a step that is round in seconds, not in days.
    """
    if not t.size or not np.isfinite(t).all():
        return ""
    size = float(np.abs(t).min())
    unit = next((unit for least, unit in _EPOCHS if size > least), "")
    days_told = any(low < t.min() and t.max() < high for low, high in _DAYS)
    if unit or not days_told or t.size < 3:
        return unit
    if not t[0] < t[-1] <= t[0] + 0.1 * t.size:
        return ""
    step = float(t[-1] - t[0]) / (t.size - 1)
    places = (10.0**-k for k in range(12) if np.allclose(np.round(t, k), t, 0, 1e-11))
    unsure = (next(places, 1e-11) + 2 * float(np.spacing(t[-1]))) / (t.size - 1)
    days = _is_round(86_400 * step, 86_400 * unsure) and not _is_round(step, unsure)
    return "d" if days or step < FASTEST else ""


def _is_round(step: float, unsure: float) -> bool:
    """Whether a step has three digits, or its rate two, as far as the step is sure."""
    near = (float(f"{step:.3g}"), 1 / float(f"{1 / step:.2g}"))
    return min(abs(round_one - step) for round_one in near) <= unsure


# -- the column of the time in a file --------------------------------------------------------------


class ClockColumn:
    """The column of the time, record by record."""

    def __init__(self, table: "FileTable", k: int):
        self.table, self.k = table, k
        self.second = 1.0 / table.conversion(TIME, k)[0]
        self.dated = table.dates(k) is not None
        self.said: dict[str, list[int]] = {}

    def settled(
        self, t: np.ndarray, rows: np.ndarray, values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the time [s] of a record and which of its rows are dropped."""
        dropped = np.zeros(t.size, dtype=bool)
        if np.all(np.diff(t) > 0):
            return t, dropped
        t = self.counted_on(t, rows)
        now, last = values[1:], values[:-1]
        same = ((now == last) | (np.isnan(now) & np.isnan(last))).all(axis=1)
        repeats, replaced = rows_at_one_time(t, same)
        self.note("rows repeat the one before and are left out", rows[repeats])
        self.note(
            "rows have the time of the next one, as simulations write steps, and are left out: "
            "the later row holds from there on",
            rows[replaced],
        )
        dropped[repeats] = dropped[replaced] = True
        self.check(t[~dropped], rows[~dropped])
        return t, dropped

    def counted_on(self, t: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return a time [s] that goes on where the clock of a record went back."""
        counted, size = counted_on(t * self.second, self.second, self.dated)
        if not size:
            return t
        why = (
            "as local time in autumn, or without AM and PM" if self.dated else "its counter's size"
        )
        self.note(
            f"the clock goes back by {size:.12g}, {why}: it is counted on", rows[1:][np.diff(t) < 0]
        )
        return counted / self.second

    def check(self, t: np.ndarray, rows: np.ndarray, may_stand: bool = False) -> None:
        """Refuse a time that still does not increase, or, where it may stand, decreases."""
        found = backward(t)
        if found is None or (may_stand and t[found.row] == t[found.row - 1]):
            return
        cells, here, before = self.table.cells(self.k), rows[found.row], rows[found.row - 1]
        got, last = (
            cut(str(cells[row]), 40) if self.dated else f"{t[place]:.12g}"
            for row, place in ((here, found.row), (before, found.row - 1))
        )
        self.table.refuse(
            here,
            f"expected time to increase, got {got} after {last} in {self.table.name_of(before)}: "
            f"{found.why}",
            self.table.header[self.k],
        )

    def note(self, what: str, rows: np.ndarray) -> None:
        """Remember rows of which something is to be said."""
        if rows.size:
            self.said.setdefault(what, []).extend(rows.tolist())

    def tell(self) -> None:
        """Warn of what was done, once for the whole file."""
        title = shown(self.table.header[self.k])
        for what, rows in self.said.items():
            count = f"{len(rows)} " if what.startswith("rows") else ""
            place = f"{self.table.path}{self.table.place(rows[0])}"
            warn_user(f"{place}: column {title}: {count}{what}.", RecordWarning)


# -- the sample interval as given by a user --------------------------------------------------------


def check_sample_interval(value: float, name: str = "interval", remedy: str = "") -> None:
    """Raise `OptionError` with a remedy unless an interval is a finite time [s] above 0."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if is_number and 0 < float(value) < math.inf:
        return
    text = f"{name}: expected the sample interval in seconds, a number above 0, got {value!r}."
    raise OptionError(f"{text} {remedy}".rstrip())
