"""Cross-validation by whole trajectories."""

from numbers import Integral
from typing import ClassVar

import numpy as np
from sklearn.model_selection import BaseCrossValidator
from sklearn.utils import check_random_state

from sklearn_pgnn.model_selection.trajectory_rows import (
    are_measured,
    deal_in_order,
    read_pieces,
    refuse_merging,
)


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
        n_splits=5,
        *,
        shuffle=False,
        random_state=None,
        time_column=None,
        trajectory_column=None,
    ):
        self.n_splits = n_splits
        self.shuffle = shuffle
        self.random_state = random_state
        self.time_column = time_column
        self.trajectory_column = trajectory_column

    def split(self, X, y=None, groups=None):
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

    def get_n_splits(self, X=None, y=None, groups=None):
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
        self._check(len(order))
        if self.shuffle:
            check_random_state(self.random_state).shuffle(order)
        lengths = [len(pieces[i]) for i in order]
        for fold in deal_in_order(lengths, np.full(self.n_splits, 1 / self.n_splits)):
            tested = np.isin(np.arange(len(pieces)), order[fold])
            for side in (tested, ~tested):
                kept = [pieces[i] for i in np.flatnonzero(side)]
                refuse_merging(X, kept, groups, *columns)
            yield np.concatenate([pieces[i] for i in np.flatnonzero(tested)])

    def _check(self, n_trajectories):
        if not isinstance(self.n_splits, Integral) or self.n_splits < 2:
            raise ValueError(f"n_splits: expected an integer above 1, got {self.n_splits!r}.")
        if n_trajectories < self.n_splits:
            fewer = f"n_splits={n_trajectories}, or " if n_trajectories > 1 else ""
            things = "trajectory" if n_trajectories == 1 else "trajectories"
            raise ValueError(
                f"n_splits: expected at most as many folds as trajectories with a measured output, "
                f"got {self.n_splits} folds and {n_trajectories} {things}. Remedy: {fewer}more "
                f"records; a long one can be cut (train_validation_test_split, by='time')."
            )
