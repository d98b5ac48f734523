"""The rows of every trajectory of a table, and a single split of them into three sets."""

from collections.abc import Sequence
from itertools import pairwise
from numbers import Integral

import numpy as np
import pandas as pd
from sklearn.utils import check_consistent_length, check_random_state

from sklearn_pgnn.annotations import Column, RandomState, Table
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES, TIME, TRAJECTORY, split_rows
from sklearn_pgnn.trajectories.tables import as_table, is_named, read_clock, take_rows

WAYS = ("trajectory", "time")


def read_pieces(X, groups=None, time_column=None, trajectory_column=None) -> list[np.ndarray]:
    """Find the rows of every trajectory: by groups, a column, or where time does not increase."""
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
    """Return for every trajectory whether some of its outputs are measured; without y all are."""
    if y is None:
        return np.ones(len(pieces), dtype=bool)
    empty = pd.isna(np.asarray(y))
    return np.array([not empty[rows].all() for rows in pieces])


def deal_in_order(lengths, shares) -> list[np.ndarray]:
    """Split trajectories in order so that the samples come nearest to shares, at least one each."""
    ends = np.cumsum(lengths)
    wanted = np.cumsum(shares)[:-1] * ends[-1]
    cuts, last = [], 0
    for i, samples in enumerate(wanted):
        nearest = int(np.argmin(np.abs(ends - samples))) + 1
        last = min(max(nearest, last + 1), len(ends) - len(wanted) + i)
        cuts.append(last)
    return np.split(np.arange(len(ends)), cuts)


def train_validation_test_split(
    X: Table,
    y: Table,
    *,
    sizes: Sequence[float] = (0.6, 0.2, 0.2),
    by: str = "trajectory",
    shuffle: bool = False,
    random_state: RandomState = None,
    time_column: Column | None = None,
    trajectory_column: str | None = None,
) -> list:
    """Split records into a training, a validation and a test set.

    Parameters
    ----------
    X : DataFrame or array-like of shape (n_samples, n_columns)
        The table, as the estimators read it.
    y : DataFrame or array-like of shape (n_samples, n_outputs) or (n_samples,)
        Measured outputs.
    sizes : tuple of three float, default=(0.6, 0.2, 0.2)
        Shares of the samples; they sum to one.
    by : {"trajectory", "time"}, default="trajectory"
        Whether trajectories stay whole (every set gets at least one), or each is cut in order, its
        beginning for training and its end for testing. A piece that begins inside a trajectory has
        no known initial state unless X gives the states in that row too; the model's
        `initial_state` is used instead.
    shuffle : bool, default=False
        Whether to shuffle the trajectories; not possible with ``by="time"``.
    random_state : int, RandomState instance or None, default=None
        Controls the shuffling.
    time_column : int or str, optional
        Column of X that holds the time; by default ``"t"``, the first where the columns
        have no names.
    trajectory_column : str, optional
        Column of X that names the trajectory of every row; by default ``"trajectory"``, if X has
        it.

    Returns
    -------
    X_train, X_validation, X_test, y_train, y_validation, y_test : DataFrame or array
        The parts, in the order of the table; a DataFrame stays one and keeps its index.

    Raises
    ------
    ValueError
        If `sizes` is not three shares, there are too few trajectories or samples, pieces would be
        read as one trajectory, or X has no such column.

    Examples
    --------
    >>> X = np.column_stack([np.tile([0.0, 0.1], 5), np.arange(10)])  # five trajectories
    >>> X_train, X_validation, X_test, *_ = train_validation_test_split(X, X[:, 1])
    >>> print(X_train[:, 1], X_validation[:, 1], X_test[:, 1])
    [0. 1. 2. 3. 4. 5.] [6. 7.] [8. 9.]
    """
    if len(sizes) != 3 or min(sizes) <= 0 or not np.isclose(sum(sizes), 1):
        raise ValueError(f"sizes: expected three shares above 0 that sum to 1, got {sizes!r}.")
    if by not in WAYS:
        raise ValueError(f"by: expected one of {', '.join(WAYS)}, got {by!r}.")
    if by == "time" and shuffle:
        raise ValueError("shuffle: time has an order. Remedy: shuffle=False, or by='trajectory'.")
    check_consistent_length(X, y)
    columns = {"time_column": time_column, "trajectory_column": trajectory_column}
    pieces = read_pieces(X, **columns)
    if by == "time":
        parts = _cut_each(pieces, sizes)
    else:
        parts = _deal(pieces, sizes, check_random_state(random_state) if shuffle else None)
    for part in parts:
        refuse_merging(X, part, **columns)
    rows = [np.sort(np.concatenate(part)) for part in parts]
    return [take_rows(table, each) for table in (X, y) for each in rows]


def _deal(pieces, sizes, rng) -> list[list[np.ndarray]]:
    """Distribute whole trajectories over the sets."""
    if len(pieces) < 3:
        raise ValueError(
            f"X: expected at least 3 trajectories, one for each part, got {len(pieces)}. Remedy: "
            f"by='time' cuts each of them, or record more."
        )
    order = np.arange(len(pieces)) if rng is None else rng.permutation(len(pieces))
    parts = deal_in_order([len(pieces[i]) for i in order], sizes)
    return [[pieces[i] for i in np.sort(order[part])] for part in parts]


def _cut_each(pieces, sizes) -> list[list[np.ndarray]]:
    """Cut every trajectory in order."""
    cut = []
    for i, rows in enumerate(pieces):
        ends = np.rint(np.cumsum(sizes)[:2] * len(rows)).astype(int)
        cut.append(np.split(rows, ends))
        least = min(map(len, cut[-1]))
        if least < MIN_SAMPLES:
            raise ValueError(
                f"X: a part of trajectory number {i}, which has {len(rows)} samples, would have "
                f"{least}; expected at least {MIN_SAMPLES}. Remedy: by='trajectory', or leave it "
                f"out."
            )
    return [list(part) for part in zip(*cut, strict=True)]


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
    named = is_named(X)
    if time_column is not None:
        named = isinstance(X, pd.DataFrame) and not isinstance(time_column, Integral)
    t = _time_by_name(X, time_column) if named else _nth(X, time_column)
    clock = read_clock(pd.Series(t), "X: time")
    if clock is not None:
        return (clock[0] - clock[0][0]) * clock[1]
    t = np.asarray(t, dtype=float)
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise ValueError(f"X: time is {t[bad[0]]} in row {bad[0]}; expected a finite number.")
    return t


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
