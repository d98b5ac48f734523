"""A single split of records into training, validation and test sets."""

from collections.abc import Sequence

import numpy as np
from sklearn.utils import check_consistent_length, check_random_state

from sklearn_pgnn.annotations import Column, RandomState, Table
from sklearn_pgnn.model_selection.trajectory_rows import (
    deal_in_order,
    read_pieces,
    refuse_merging,
)
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES
from sklearn_pgnn.trajectories.tables import take_rows

WAYS = ("trajectory", "time")


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
    _check(sizes, by, shuffle)
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


def _check(sizes, by, shuffle) -> None:
    if len(sizes) != 3 or min(sizes) <= 0 or not np.isclose(sum(sizes), 1):
        raise ValueError(f"sizes: expected three shares above 0 that sum to 1, got {sizes!r}.")
    if by not in WAYS:
        raise ValueError(f"by: expected one of {', '.join(WAYS)}, got {by!r}.")
    if by == "time" and shuffle:
        raise ValueError("shuffle: time has an order. Remedy: shuffle=False, or by='trajectory'.")


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
