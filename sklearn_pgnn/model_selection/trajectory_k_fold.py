"""Cross-validation by whole trajectories, as the estimator reads them."""

from collections.abc import Iterator
from functools import partial
from numbers import Integral
from typing import ClassVar

import numpy as np
from sklearn.model_selection import BaseCrossValidator
from sklearn.pipeline import Pipeline
from sklearn.utils import check_random_state

from sklearn_pgnn.annotations import ArrayLike, Column, RandomState, Table
from sklearn_pgnn.model_selection.trajectory_rows import (
    are_measured,
    deal_in_order,
    read_pieces,
    refuse_merging,
)
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY
from sklearn_pgnn.trajectories.tables import as_pandas


class TrajectoryKFold(BaseCrossValidator):
    """Split records into folds of whole trajectories, balanced by samples.

    Samples of one trajectory are far from independent; a fold that shares a trajectory with its
    training set rewards memorisation. The trajectories are read from X itself, so the splitter can
    be used wherever scikit-learn takes a ``cv``. Unless shuffled, trajectories keep their order,
    and neighbours share a fold.

    A search that saves time by using fewer samples (``resource="n_samples"``, the default of
    `HalvingRandomSearchCV` and `HalvingGridSearchCV`) draws single rows, which the estimators
    refuse; choose another resource, such as ``resource="max_iter"``, or `HalvingBayesSearchCV`.

    Parameters
    ----------
    n_splits : int, default=5
        Number of folds, at least 2.
    shuffle : bool, default=False
        Whether to shuffle the trajectories.
    random_state : int, RandomState instance or None, default=None
        Controls the shuffling.
    time_column : int or str, optional
        Column of X that holds the time; by default ``"t"``, the first where the columns
        have no names. Where a column names the trajectories the time is not read.
    trajectory_column : str, optional
        Column of X that names the trajectory of every row; by default ``"trajectory"``, if X has
        it.

    See Also
    --------
    train_validation_test_split : Splits once, into three sets.

    Examples
    --------
    >>> X = np.column_stack([np.tile([0.0, 0.1], 3), np.arange(6)])  # three trajectories
    >>> for train, test in TrajectoryKFold(3).split(X):
    ...     print(train, test)
    [2 3 4 5] [0 1]
    [0 1 4 5] [2 3]
    [0 1 2 3] [4 5]
    """

    # under metadata routing too, groups are taken where they are given
    __metadata_request__split: ClassVar = {"groups": True}

    def __init__(
        self,
        n_splits: int = 5,
        *,
        shuffle: bool = False,
        random_state: RandomState = None,
        time_column: Column | None = None,
        trajectory_column: str | None = None,
    ):
        self.n_splits = n_splits
        self.shuffle = shuffle
        self.random_state = random_state
        self.time_column = time_column
        self.trajectory_column = trajectory_column

    def split(
        self, X: Table, y: Table = None, groups: ArrayLike | None = None
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Generate the rows of every training and test set.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_columns)
            The table, as the estimators read it.
        y : array-like of shape (n_samples, n_outputs), optional
            Measured outputs. Trajectories without any (NaN or None) are in every training set and
            in no test set; otherwise y is not used.
        groups : array-like of shape (n_samples,), optional
            Trajectory of every row; overrides X.

        Yields
        ------
        train : ndarray
            Rows of the training set.
        test : ndarray
            Rows of the test set.

        Raises
        ------
        ValueError
            If there are fewer trajectories than folds, `n_splits` is not a number above one, or X
            has no such column.
        """
        return super().split(X, y, groups)

    def get_n_splits(self, X: object = None, y: object = None, groups: object = None) -> int:
        """Return the number of folds.

        Parameters
        ----------
        X, y, groups : object
            Not read.

        Returns
        -------
        int
            The number of folds.
        """
        return self.n_splits

    def _iter_test_indices(self, X=None, y=None, groups=None):
        columns = self.time_column, self.trajectory_column
        pieces = read_pieces(X, groups, *columns)
        order = np.flatnonzero(are_measured(pieces, y))
        if not isinstance(self.n_splits, Integral) or self.n_splits < 2:
            raise ValueError(f"n_splits: expected an integer above 1, got {self.n_splits!r}.")
        if len(order) < self.n_splits:
            fewer = f"n_splits={len(order)}, or " if len(order) > 1 else ""
            things = "trajectory" if len(order) == 1 else "trajectories"
            raise ValueError(
                f"n_splits: expected at most as many folds as trajectories with a measured output, "
                f"got {self.n_splits} folds and {len(order)} {things}. Remedy: {fewer}more "
                f"records; a long one can be cut (train_validation_test_split, by='time')."
            )
        if self.shuffle:
            check_random_state(self.random_state).shuffle(order)
        lengths = [len(pieces[i]) for i in order]
        for fold in deal_in_order(lengths, np.full(self.n_splits, 1 / self.n_splits)):
            tested = np.isin(np.arange(len(pieces)), order[fold])
            for side in (tested, ~tested):
                kept = [pieces[i] for i in np.flatnonzero(side)]
                refuse_merging(X, kept, groups, *columns)
            yield np.concatenate([pieces[i] for i in np.flatnonzero(tested)])


def own_folds(cv, estimator, X):
    """Return a splitter; a number means `TrajectoryKFold` with the estimator's columns."""
    return cv if hasattr(cv, "split") else TrajectoryKFold(cv, **columns_of(estimator, X))


def columns_of(estimator, X) -> dict:
    """Return the columns of time and trajectory, as an estimator's parameters or model say.

    In a pipeline the first step that has them counts, in a meta-estimator the inner estimator; the
    names of a model refer to a DataFrame. Return ``time_column`` and ``trajectory_column`` of
    `TrajectoryKFold`; None means the default column.
    """
    return {
        "time_column": _first_said(estimator, partial(_time_column, X=X)),
        "trajectory_column": _first_said(estimator, partial(_named_by_model, TRAJECTORY, X=X)),
    }


def _first_said(estimator, say):
    """Return a column of an estimator of trajectories, or of the first one inside it."""
    if isinstance(estimator, Pipeline):
        said = (_first_said(step, say) for _, step in estimator.steps)
        return next((column for column in said if column is not None), None)
    if hasattr(estimator, "time_column"):
        return say(estimator)
    inner = getattr(estimator, "estimator", getattr(estimator, "regressor", None))
    return None if inner is None else _first_said(inner, say)


def _time_column(estimator, X):
    """Return the parameter for the time, else the model's name for it."""
    own = estimator.time_column
    return _named_by_model(TIME, estimator, X) if own is None else own


def _named_by_model(quantity, estimator, X) -> str | None:
    """Return the model's name for a quantity, if a table has such a column."""
    called = getattr(getattr(estimator, "model", None), "columns", {}).get(quantity)
    return called if called in getattr(as_pandas(X), "columns", ()) else None
