"""The column of the time in a file: its rows at one time, its order, and what is said of them."""

from typing import TYPE_CHECKING

import numpy as np

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.trajectories.clock import backward, counted_on, rows_at_one_time
from sklearn_pgnn.trajectories.shown import cut, shown
from sklearn_pgnn.trajectories.tables import TIME
from sklearn_pgnn.user_line import warn_user

if TYPE_CHECKING:
    from sklearn_pgnn.trajectories.file_table import FileTable


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
