"""Intervals of any regressor's free runs, from its errors on held-out trajectories."""

from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, MetaEstimatorMixin, RegressorMixin, clone
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import ArrayLike, Table
from sklearn_pgnn.estimators.progress import progress_printer
from sklearn_pgnn.model_selection.outer_estimator import OuterEstimatorMixin
from sklearn_pgnn.model_selection.trajectory_k_fold import columns_of, own_folds
from sklearn_pgnn.model_selection.trajectory_rows import are_measured, read_pieces
from sklearn_pgnn.simulation.intervals import (
    check_coverage,
    interval_around,
    quantile_of,
    warn_of_few_records,
)
from sklearn_pgnn.trajectories.tables import as_columns, take_rows

#: maximum number of folds by default: every fold takes a fit
FOLDS = 6


class ConformalRegressor(OuterEstimatorMixin, MetaEstimatorMixin, RegressorMixin, BaseEstimator):
    r"""Prediction intervals for any regressor, from its errors on held-out trajectories.

    .. math:: \hat y_k \pm q_o, \qquad
              q_o = \text{the } c \text{ quantile of } |y_{ko} - \hat y^{(-f)}_{ko}|

    with the coverage :math:`c`, over all samples :math:`k` of output :math:`o`, each predicted by
    the fit without its own fold :math:`f` (cross-conformal prediction [1]_, [2]_, with whole
    trajectories as folds, their samples pooled). It assumes nothing about the regressor or the
    distribution of the errors, only that later trajectories are like those of the training: as
    long, with similar inputs and noise, from initial states that are known equally well. The more
    trajectories, the closer the coverage on another one is to :math:`c`; with few it scatters.
    :math:`n` trajectories cannot guarantee more than :math:`n/(n + 1)` [3]_, so that 0.9 needs at
    least 9, and 0.99 at least 99: beyond that the interval is that of the errors that were seen,
    and `predict_interval` warns.

    Parameters
    ----------
    estimator : regressor
        Any regressor: `SINDYcRegressor`, `PGNNLRegressor`, `ResidualRegressor`, a pipeline.
    cv : int or cross-validation splitter, optional
        Folds; a number means `TrajectoryKFold` with the time column of the regressor. By default
        as many as there are trajectories with measured outputs, but at most 6.
    verbose : int, default=0
        Whether to print a line for every fold.

    Attributes
    ----------
    estimator_ : regressor
        Fitted to all trajectories.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

    See Also
    --------
    PhysicsModelRegressor.predict_interval : From the parameters' covariance, without further fits.
    GreyBoxRegressor.predict_interval : From the folds that chose its depth.

    References
    ----------
    .. [1] V. Vovk, "Cross-conformal predictors", Annals of Mathematics and Artificial Intelligence
       74, 2015, :doi:`10.1007/s10472-013-9368-4`.
    .. [2] R. F. Barber, E. J. Candes, A. Ramdas, R. J. Tibshirani, "Predictive inference with the
       jackknife+", Annals of Statistics 49(1), 2021, :doi:`10.1214/20-AOS1965`.
    .. [3] J. Lei, M. G'Sell, A. Rinaldo, R. J. Tibshirani, L. Wasserman, "Distribution-free
       predictive inference for regression", Journal of the American Statistical Association
       113(523), 2018, :doi:`10.1080/01621459.2017.1307116`.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModel, ResidualRegressor
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.tile(np.linspace(0, 20, 401), 4)
    >>> X = np.column_stack([t, np.repeat([1.0, 2.0, 3.0, 4.0], 401)])
    >>> noise = 0.1 * np.random.default_rng(0).normal(size=len(X))
    >>> y = X[:, 1] * (1 - np.exp(-t / 2)) + noise
    >>> low, high = ConformalRegressor(ResidualRegressor(lag)).fit(X, y).predict_interval(X)
    >>> print(round(float(np.mean((low <= y) & (y <= high))), 1))
    0.9
    """

    def __init__(self, estimator: Any, *, cv: Any = None, verbose: int = 0):
        self.estimator = estimator
        self.cv = cv
        self.verbose = verbose

    def fit(self, X: Table, y: Table, groups: ArrayLike | None = None) -> Self:
        """Fit the regressor to all trajectories, and once without each fold.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As the regressor takes it.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs; NaN where there is none.
        groups : array-like of shape (n_samples,), optional
            Trajectory of every row for the folds, as `cv` takes it; overrides X.

        Returns
        -------
        self : ConformalRegressor
            The fitted regressor.

        Raises
        ------
        ValueError
            If there are too few trajectories for folds, or the regressor rejects X or y.
        """
        self.estimator_ = clone(self.estimator).fit(X, y)
        left = []
        held_out = np.full(as_columns(y).shape, np.nan)
        for train, test in self._splitter(X, y, groups).split(X, y, groups):
            fitted = clone(self.estimator).fit(take_rows(X, train), take_rows(y, train))
            predicted = as_columns(fitted.predict(take_rows(X, test)))
            left.append(np.abs(predicted - as_columns(take_rows(y, test))))
            held_out[test] = left[-1]
            if self.verbose:
                progress_printer(self)(f"fold {len(left)}: largest error {np.nanmax(left[-1]):.4g}")
        self._left = np.sort(np.concatenate(left), axis=0)
        self._n_records = self._count_records(X, y, groups, held_out)
        return self

    def _count_records(
        self, X: Table, y: Table, groups: ArrayLike | None, held_out: np.ndarray
    ) -> int:
        """Return the number of trajectories with errors, of the output that has fewest.

        Rows of a table without a time and without trajectories stand for themselves.
        """
        try:
            pieces = read_pieces(X, groups, **columns_of(self.estimator, X))
        except ValueError:
            pieces = [np.array([row]) for row in range(len(held_out))]
        counts = [int(are_measured(pieces, column).sum()) for column in held_out.T]
        return min((count for count in counts if count), default=0)

    def score(self, X: Table, y: Table, sample_weight: ArrayLike | None = None) -> float:
        """Return the score of the regressor that was fitted to all trajectories.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs.
        sample_weight : array-like of shape (n_samples,), optional
            Weights of the samples.

        Returns
        -------
        float
            The score, 1 at best.
        """
        weights = {} if sample_weight is None else {"sample_weight": sample_weight}
        return self._ask("score", X, y, **weights)

    def predict_interval(self, X: Table, coverage: float = 0.9) -> tuple[np.ndarray, np.ndarray]:
        """Return the interval in which the measured outputs are expected.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.
        coverage : float, default=0.9
            Share of the measurements that should lie in the interval.

        Returns
        -------
        low, high : ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Bounds of the interval.

        Raises
        ------
        OptionError
            If `coverage` is not a share between 0 and 1.

        Warns
        -----
        RecordWarning
            If the trajectories of the fit are too few to guarantee that coverage: the message says
            how many are needed, and the largest coverage that these can guarantee.
        """
        check_is_fitted(self)
        check_coverage(coverage)
        warn_of_few_records(coverage, self._n_records)
        return interval_around(np.asarray(self.predict(X)), quantile_of(self._left, coverage))

    def _splitter(self, X: Table, y: Table, groups: ArrayLike | None) -> Any:
        cv = self.cv
        if cv is None:
            pieces = read_pieces(X, groups, **columns_of(self.estimator, X))
            cv = max(2, min(FOLDS, int(are_measured(pieces, y).sum())))
        return own_folds(cv, self.estimator, X)
