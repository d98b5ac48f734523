"""The rows of every trajectory of a table, and how whole trajectories are distributed."""

from itertools import pairwise
from numbers import Integral

import numpy as np
import pandas as pd

from sklearn_pgnn.trajectories import split_rows
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY
from sklearn_pgnn.trajectories.tables import as_table, is_named, read_clock


def read_pieces(X, groups=None, time_column=None, trajectory_column=None) -> list[np.ndarray]:
    """Find the rows of every trajectory in a table.

    Its column ``trajectory`` is decisive; without it a trajectory begins wherever time does not
    increase. `groups`, the trajectory of every row, overrides X. The time is by default in ``"t"``,
    the first column where the columns have no names. The trajectories are in the order of their
    first rows.

    Examples
    --------
    >>> [rows.tolist() for rows in read_pieces([[0.0, 5.0], [0.1, 5.0], [0.0, 7.0]])]
    [[0, 1], [2]]
    """
    X = as_table(X, time_column)
    names = _named(X, trajectory_column) if groups is None else np.asarray(groups)
    if names is not None:
        return [rows for _, rows in split_rows(np.empty(len(names)), names)]
    return [rows for _, rows in split_rows(_read_time(X, time_column))]


def refuse_merging(X, pieces, groups=None, time_column=None, trajectory_column=None) -> None:
    """Raise `ValueError` for trajectories that would be read as one when concatenated.

    Without a column ``trajectory`` a new trajectory is recognised by a time that does not
    increase. If a trajectory is left out, its neighbours may no longer be distinguishable.

    `pieces` are row numbers of the trajectories that stay together, in the order of the table; if
    `groups` are given, nothing is checked.

    Examples
    --------
    >>> X = [[0.0], [0.1], [0.0], [0.9], [0.4], [1.0]]
    >>> first, second, third = read_pieces(X)
    >>> refuse_merging(X, [first, third])
    Traceback (most recent call last):
        ...
    ValueError: X: the trajectories that end in row 1 and begin in row 4 would be read as one, \
since time keeps increasing from 0.1 s to 0.4 s. Remedy: give X a column 'trajectory'.
    """
    X = as_table(X, time_column)
    if groups is not None or _named(X, trajectory_column) is not None:
        return
    t = _read_time(X, time_column)
    for before, after in pairwise(pieces):
        end, start = before[-1], after[0]
        if t[start] > t[end]:
            raise ValueError(
                f"X: the trajectories that end in row {end} and begin in row {start} would be read "
                f"as one, since time keeps increasing from {t[end]:g} s to {t[start]:g} s. Remedy: "
                f"give X a column 'trajectory'."
            )


def are_measured(pieces, y) -> np.ndarray:
    """Return for every trajectory whether some of its outputs are measured.

    `pieces` are row numbers of every trajectory; y is NaN or None where there is none, and without
    y all are measured.

    Examples
    --------
    >>> are_measured([np.array([0, 1]), np.array([2])], [1.0, np.nan, np.nan]).tolist()
    [True, False]
    """
    if y is None:
        return np.ones(len(pieces), dtype=bool)
    empty = pd.isna(np.asarray(y))
    return np.array([not empty[rows].all() for rows in pieces])


def deal_in_order(lengths, shares) -> list[np.ndarray]:
    """Split trajectories in order so that the numbers of samples come nearest to given shares.

    `lengths` are samples of every trajectory, at least as many as shares, which sum to one. Return
    the numbers of the trajectories in every part, at least one each.
    """
    ends = np.cumsum(lengths)
    wanted = np.cumsum(shares)[:-1] * ends[-1]
    cuts, last = [], 0
    for i, samples in enumerate(wanted):
        nearest = int(np.argmin(np.abs(ends - samples))) + 1
        last = min(max(nearest, last + 1), len(ends) - len(wanted) + i)
        cuts.append(last)
    return np.split(np.arange(len(ends)), cuts)


def _column(X, name) -> np.ndarray | None:
    """Return a column by its name; None where there is none."""
    if not isinstance(X, pd.DataFrame) or name not in X.columns:
        return None
    return X[name].to_numpy()


def _named(X, trajectory_column) -> np.ndarray | None:
    """Return the trajectory of every row; None where no column names it."""
    names = _column(X, TRAJECTORY if trajectory_column is None else trajectory_column)
    if names is None and trajectory_column is not None:
        columns = ", ".join(map(str, getattr(X, "columns", ()))) or "columns without names"
        raise ValueError(
            f"trajectory_column: expected a column of X, got {trajectory_column!r}; X has "
            f"{columns}. Remedy: name one of these, or leave it out if the time separates the "
            f"trajectories."
        )
    return names


def _read_time(X, time_column) -> np.ndarray:
    """Read the time [s] of every row."""
    t = _time_by_name(X, time_column) if _has_names(X, time_column) else _nth(X, time_column)
    clock = read_clock(pd.Series(t), "X: time")
    if clock is not None:
        return (clock[0] - clock[0][0]) * clock[1]
    t = np.asarray(t, dtype=float)
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise ValueError(f"X: time is {t[bad[0]]} in row {bad[0]}; expected a finite number.")
    return t


def _has_names(X, time_column) -> bool:
    """Whether the time is identified by its name, as the estimators read a table."""
    if time_column is None:
        return is_named(X)
    return isinstance(X, pd.DataFrame) and not isinstance(time_column, Integral)


def _time_by_name(X, time_column) -> np.ndarray:
    t = _column(X, TIME if time_column is None else time_column)
    if t is None:
        raise ValueError(
            f"X: no column 'trajectory' and no time {time_column or TIME!r} among "
            f"{', '.join(map(str, X.columns))}. Remedy: name the time by time_column=..., where "
            f"folds are asked for by cv=TrajectoryKFold(..., time_column=...); or give X a column "
            f"'trajectory'."
        )
    return t


def _nth(X, time_column) -> np.ndarray:
    X = np.asarray(X)
    number = 0 if time_column is None else time_column
    width = X.shape[1] if X.ndim == 2 else 0
    if not isinstance(number, Integral) or not -width <= int(number) < width:
        raise ValueError(
            f"time_column: expected a column number below {width}, for X of shape {X.shape} has no "
            f"names, got {number!r}."
        )
    return X[:, number]
