"""The median of several fits of one regressor with different random numbers."""

import warnings
from collections.abc import Mapping
from numbers import Integral
from typing import Any, Self

import numpy as np
from joblib import Parallel, delayed
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import RandomState, Table
from sklearn_pgnn.estimators.simulated_predictions import one_simulation_warning
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.model_selection.outer_estimator import (
    OuterEstimatorMixin,
    method_of,
    parameters_named,
)
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.validation import GapScoreMixin
from sklearn_pgnn.user_line import warn_user

#: predictions that differ by less than this share of their size are the same
SAME = 1e-12


class EnsembleRegressor(OuterEstimatorMixin, MetaEstimatorMixin, GapScoreMixin, BaseEstimator):
    r"""Fit a regressor several times with different random numbers, and predict the median.

    .. math:: \hat y_k = \operatorname{median}_i \, \hat y^{(i)}_k

    Networks trained from different initial weights fit the records alike and differ elsewhere, so
    that together they are closer to the truth than most of them alone [1]_, and one that ended in a
    bad minimum, or whose free run diverges, does not count. Their spread shows where the records
    carry little information; for intervals of a given coverage see `ConformalRegressor`.

    Each fit predicts every trajectory in free run; the median is not a trajectory of any single
    fit.

    Parameters
    ----------
    estimator : regressor
        Regressor to fit, alone or in a pipeline: `PGNNLRegressor`, or any that uses random numbers.
    n_estimators : int, default=5
        Number of fits.
    random_state : int, RandomState instance or None, default=0
        Draws every ``random_state`` of the regressor and of the estimators in it.
    n_jobs : int, optional
        Processes to fit in; -1 means all.

    Attributes
    ----------
    estimators_ : list of regressors
        The fits.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

    See Also
    --------
    ConformalRegressor : Intervals of any regressor, including this one.

    References
    ----------
    .. [1] B. Lakshminarayanan, A. Pritzel, C. Blundell, "Simple and scalable predictive uncertainty
       estimation using deep ensembles", NeurIPS 2017, arXiv:1612.01474.

    Examples
    --------
    >>> from sklearn.neural_network import MLPRegressor
    >>> from sklearn_pgnn import PhysicsModel, ResidualRegressor
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 20, 401)
    >>> X, y = np.column_stack([t, np.sin(t)]), np.sin(t - 1.2)
    >>> residual = ResidualRegressor(lag, MLPRegressor(hidden_layer_sizes=(8,), solver="lbfgs"))
    >>> ensemble = EnsembleRegressor(residual, n_estimators=3).fit(X, y)
    >>> predicted, spread = ensemble.predict(X, return_std=True)
    >>> len(ensemble.estimators_), predicted.shape, spread.shape
    (3, (401,), (401,))
    """

    _fitted = "_first"

    def __init__(
        self,
        estimator: Any,
        n_estimators: int = 5,
        *,
        random_state: RandomState = 0,
        n_jobs: int | None = None,
    ):
        self.estimator = estimator
        self.n_estimators = n_estimators
        self.random_state = random_state
        self.n_jobs = n_jobs

    def fit(self, X: Table, y: Table, **fit_params: Any) -> Self:
        """Fit the regressor `n_estimators` times.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As the regressor takes it.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs.
        **fit_params
            Passed on to every fit.

        Returns
        -------
        self : EnsembleRegressor
            The fitted regressor.

        Raises
        ------
        OptionError
            If `n_estimators` is not at least 1, or the regressor has no parameter ``random_state``.

        Warns
        -----
        UserWarning
            If all fits predict the same for X: the regressor uses no random numbers, or learns
            every sample by heart.
        """
        count, names = self.n_estimators, parameters_named(self.estimator, "random_state")
        if not isinstance(count, Integral) or count < 1:
            raise OptionError(f"n_estimators: expected an integer >= 1, got {count!r}.")
        if not names:
            raise OptionError(
                f"estimator: expected one with a parameter 'random_state', got {self.estimator!r}, "
                f"whose fits would all be the same. Remedy: fit it alone."
            )
        draw = check_random_state(self.random_state)
        seeds = [{name: int(draw.randint(2**31 - 1)) for name in names} for _ in range(count)]
        calls = (delayed(_fit)(self.estimator, each, X, y, fit_params) for each in seeds)
        self.estimators_: list = Parallel(self.n_jobs)(calls)
        self._warn_of_same_fits(X)
        return self

    def _warn_of_same_fits(self, X: Table) -> None:
        """Warn where the fits differ by rounding only, whose spread tells nothing."""
        if self.n_estimators == 1:
            return
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            first, *others = self.estimators_
            reference = np.asarray(first.predict(X))
            limit = SAME * np.max(np.abs(reference))
            are_same = all(
                np.all(np.abs(np.asarray(each.predict(X)) - reference) <= limit) for each in others
            )
        if are_same:
            warn_user(
                f"estimator: the {self.n_estimators} fits of {self.estimator!r} predict the same "
                f"for X, so that it uses no random numbers, or learns every sample by heart; a "
                f"spread of 0 says nothing. Remedy: fit it alone; ConformalRegressor gives "
                f"intervals."
            )

    @property
    def _first(self) -> Any:
        return self.estimators_[0]

    def predict(self, X: Table, return_std: bool = False) -> Any:
        """Return the median of the fits' predictions.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.
        return_std : bool, default=False
            Whether to also return the standard deviation of the fits' predictions.

        Returns
        -------
        y : ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.
        std : ndarray of the same shape
            Standard deviation of the fits' predictions, if asked for.
        """
        each = self._each("predict", X)
        middle = np.median(each, axis=0)
        return (middle, np.std(each, axis=0)) if return_std else middle

    def _ask(self, method: str, *args: Any) -> np.ndarray:
        """Return the median over the fits of a method's result."""
        return np.median(self._each(method, *args), axis=0)

    def _each(self, method: str, *args: Any) -> np.ndarray:
        """Return a method's result for every fit."""
        check_is_fitted(self)
        with one_simulation_warning():
            found = [np.asarray(method_of(each, method)(*args)) for each in self.estimators_]
        return np.stack(found)

    def _model_of_y(self) -> PhysicsModel | None:
        models = parameters_named(self.estimator, "model").values()
        return next((model for model in models if model is not None), None)


def _fit(
    estimator: Any, seeds: Mapping[str, int], X: Table, y: Table, fit_params: Mapping[str, Any]
) -> Any:
    """Fit a copy with its own random seeds."""
    return clone(estimator).set_params(**seeds).fit(X, y, **fit_params)
