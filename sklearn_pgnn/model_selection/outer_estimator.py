"""Estimators inside others: their parameters, and the methods that are delegated to them."""

from collections.abc import Callable
from typing import Any

import numpy as np
from sklearn.pipeline import Pipeline
from sklearn.utils import get_tags
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted


def parameters_named(estimator, name: str) -> dict[str, Any]:
    """Return the parameters with a given own name, by full name, of an estimator and all in it."""
    found = estimator.get_params().items()
    return {full: value for full, value in found if full.rpartition("__")[2] == name}


def inner_has(method: str):
    """Return a decorator for a method that is available if the inner estimator has it."""

    def check(outer) -> bool:
        return has_method(getattr(outer, outer._fitted, outer.estimator), method)

    return available_if(check)


def has_method(estimator, method: str) -> bool:
    """Return whether an estimator, or a pipeline's last step, has a method that takes X first."""
    if hasattr(estimator, method) or not isinstance(estimator, Pipeline):
        return hasattr(estimator, method)
    return has_method(estimator.steps[-1][1], method)


def method_of(estimator, method: str) -> Callable:
    """Return a method that takes X first, behind the transformers of a pipeline."""
    if hasattr(estimator, method) or not isinstance(estimator, Pipeline):
        return getattr(estimator, method)
    last = method_of(estimator.steps[-1][1], method)

    def behind_the_others(X, *args, **kwargs):
        for _, step in estimator.steps[:-1]:
            X = X if step in (None, "passthrough") else step.transform(X)
        return last(X, *args, **kwargs)

    return behind_the_others


class OuterEstimatorMixin:
    """A meta-estimator that fits and queries another one, its parameter ``estimator``.

    What a pipeline's last step can do beyond scikit-learn's methods, it can do behind the others.
    """

    #: attribute that holds the fitted estimator
    _fitted = "estimator_"

    @property
    def n_features_in_(self) -> int:
        """Number of columns of X."""
        return getattr(self, self._fitted).n_features_in_

    @property
    def feature_names_in_(self) -> np.ndarray:
        """Names of the columns of X, if it has any."""
        return getattr(self, self._fitted).feature_names_in_

    @inner_has("predict")
    def predict(self, X):
        """Predict with the fitted estimator.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.
        """
        return self._ask("predict", X)

    @inner_has("predict_states")
    def predict_states(self, X):
        """Simulate the states with the fitted estimator, if it can.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.

        Returns
        -------
        ndarray of shape (n_samples, n_states)
            The states.
        """
        return self._ask("predict_states", X)

    @inner_has("predict_ahead")
    def predict_ahead(self, X, y, steps=1):
        """Predict every sample from earlier outputs with the fitted estimator, if it can.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs, NaN where there is none.
        steps : int, default=1
            Prediction horizon in samples.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.
        """
        return self._ask("predict_ahead", X, y, steps)

    def _ask(self, method: str, *args, **kwargs):
        """Return the result of a method of the fitted estimator."""
        check_is_fitted(self)
        return method_of(getattr(self, self._fitted), method)(*args, **kwargs)

    def __sklearn_is_fitted__(self):
        """Return whether there is a fitted estimator."""
        return hasattr(self, self._fitted)

    def __sklearn_tags__(self):
        tags, inner = super().__sklearn_tags__(), get_tags(self.estimator)
        tags.estimator_type = inner.estimator_type
        tags.input_tags, tags.target_tags = inner.input_tags, inner.target_tags
        tags.regressor_tags = inner.regressor_tags
        return tags
