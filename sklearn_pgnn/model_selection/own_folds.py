"""Folds for a number as ``cv``: whole trajectories, as the estimator reads them."""

from functools import partial

from sklearn.pipeline import Pipeline

from sklearn_pgnn.model_selection.trajectory_k_fold import TrajectoryKFold
from sklearn_pgnn.trajectories.reader import TRAJECTORY
from sklearn_pgnn.trajectories.tables import TIME, as_pandas


def own_folds(cv, estimator, X):
    """Return a splitter; a number means `TrajectoryKFold` with the estimator's columns.

    A splitter is returned as it is; the estimator is alone or in a pipeline.
    """
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
