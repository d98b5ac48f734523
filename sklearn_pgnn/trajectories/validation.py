"""What scikit-learn expects of every estimator: checks of X and y, scores, and tags."""

from os import PathLike

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.metrics import r2_score
from sklearn.utils import Tags
from sklearn.utils.validation import validate_data

from sklearn_pgnn.annotations import ArrayLike, Table
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.reader import read_outputs, refuse_other_order
from sklearn_pgnn.trajectories.tables import as_table, is_named


def check_model(model: object, *, optional: bool = False) -> None:
    """Raise `TypeError` unless the parameter ``model`` is a `PhysicsModel`.

    >>> check_model("model.yaml")
    Traceback (most recent call last):
        ...
    TypeError: model: expected a PhysicsModel, got str 'model.yaml'. Remedy: \
PhysicsModel.from_yaml('model.yaml').
    """
    if isinstance(model, PhysicsModel) or (optional and model is None):
        return
    expected = "a PhysicsModel or None" if optional else "a PhysicsModel"
    got = "None" if model is None else f"{type(model).__name__} {_short(model)}"
    a_path = isinstance(model, str | PathLike)
    call = f"PhysicsModel.from_yaml({_short(model)})" if a_path else "PhysicsModel(states, ...)"
    raise TypeError(f"model: expected {expected}, got {got}. Remedy: {call}.")


def _short(value: object) -> str:
    text = repr(str(value) if isinstance(value, PathLike) else value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def require_target(estimator: BaseEstimator, X: Table, y: Table) -> None:
    """Raise `ValueError` if `fit` got no y, in scikit-learn's words, or rows in another order."""
    if y is None:
        raise ValueError(
            f"{type(estimator).__name__} requires y to be passed, but the target y is None."
        )
    refuse_other_order(X, y)


def refuse_fit_params(estimator: BaseEstimator, fit_params: dict) -> None:
    """Raise `OptionError` for weights of samples, `TypeError` for what `fit` knows not."""
    given = [name for name, value in fit_params.items() if value is not None]
    if "sample_weight" in given:
        raise OptionError(
            f"sample_weight: expected none, for {type(estimator).__name__} weighs all measured "
            f"samples alike. Remedy: leave it out; a sample whose y is NaN does not count."
        )
    unknown = [name for name in fit_params if name != "sample_weight"]
    if unknown:
        raise TypeError(
            f"{type(estimator).__name__}.fit: expected X and y, got {unknown[0]!r} as well. "
            f"Remedy: leave it out; what is a parameter of the estimator is set by its "
            f"constructor or set_params."
        )


def validate_table(estimator: BaseEstimator, X: Table, *, reset: bool) -> Table:
    """Refuse invalid tables; with `reset` store the columns' number and names, else compare."""
    X = as_table(X, getattr(estimator, "time_column", None))
    if isinstance(X, pd.DataFrame):
        validate_data(estimator, X, reset=reset, skip_check_array=True)
    else:
        X = validate_data(estimator, X, reset=reset, ensure_all_finite="allow-nan")
    names = getattr(estimator, "feature_names_in_", None)
    if names is None or is_named(X):
        return X
    return pd.DataFrame(X).set_axis(names, axis=1)


# -- the score of regressors whose y may have gaps -------------------------------------------------


class GapScoreMixin(RegressorMixin):
    """A regressor that is scored on the measured samples only, as in its fit.

    If y has names, they are checked as in ``fit``, against the parameter ``model``.
    """

    def score(self, X: Table, y: Table, sample_weight: ArrayLike | None = None) -> float:
        """Return the coefficient of determination of `predict` over the measured samples.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs, NaN where there is no value: such samples are left out, and so is an
            output without any value.
        sample_weight : array-like of shape (n_samples,), optional
            Weights of the samples.

        Returns
        -------
        float
            1 at best; the mean over the outputs.

        Raises
        ------
        ValueError
            If y is not as in `fit`, has the index of X in another order, or nothing was measured.
        """
        refuse_other_order(X, y)
        predicted = np.asarray(self.predict(X))
        predicted = predicted.reshape(len(predicted), -1)
        measured = read_outputs(self._model_of_y(), y, len(predicted))
        if measured.shape != predicted.shape:
            raise RecordError(
                f"y: expected shape {predicted.shape}, as predictions have, got {measured.shape}."
            )
        weight = None if sample_weight is None else np.asarray(sample_weight)
        return _mean_score(measured, predicted, weight)

    def _model_of_y(self) -> PhysicsModel | None:
        """Return the model whose outputs the columns of y are."""
        return getattr(self, "model", None)


def _mean_score(measured: np.ndarray, predicted: np.ndarray, weight: np.ndarray | None) -> float:
    scores = [
        r2_score(y[seen], y_hat[seen], sample_weight=None if weight is None else weight[seen])
        for y, y_hat in zip(measured.T, predicted.T, strict=True)
        if (seen := ~np.isnan(y)).any()
    ]
    if not scores:
        raise RecordError("y: expected a measured sample to score by, got NaN in all.")
    return float(np.mean(scores))


# -- tags ------------------------------------------------------------------------------------------


def tags_of_records(tags: Tags, has_time: bool = True) -> Tags:
    """Return a regressor's tags: states may be NaN, and random numbers follow no physical model.

    >>> from sklearn.linear_model import Ridge
    >>> tags_of_records(Ridge().__sklearn_tags__()).input_tags.allow_nan
    True
    """
    tags.input_tags.allow_nan = has_time
    tags.regressor_tags.poor_score = has_time
    return tags
