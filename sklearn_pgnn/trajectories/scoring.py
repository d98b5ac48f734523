"""The score of regressors whose y may have gaps."""

import numpy as np
from sklearn.base import RegressorMixin
from sklearn.metrics import r2_score

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.outputs import read_outputs, refuse_other_order


class GapScoreMixin(RegressorMixin):
    """A regressor that is scored on the measured samples only, as in its fit.

    If y has names, they are checked as in ``fit``, against the parameter ``model``.
    """

    def score(self, X, y, sample_weight=None):
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


def _mean_score(measured, predicted, weight) -> float:
    scores = [
        r2_score(y[seen], y_hat[seen], sample_weight=None if weight is None else weight[seen])
        for y, y_hat in zip(measured.T, predicted.T, strict=True)
        if (seen := ~np.isnan(y)).any()
    ]
    if not scores:
        raise RecordError("y: expected a measured sample to score by, got NaN in all.")
    return float(np.mean(scores))
