"""The folds that a number asks for: whole trajectories, as the estimator reads them."""

from functools import partial

from sklearn.pipeline import Pipeline

from sklearn_pgnn.model_selection.trajectory_k_fold import TrajectoryKFold
from sklearn_pgnn.trajectories.reader import TRAJECTORY
from sklearn_pgnn.trajectories.tables import TIME, as_pandas


def own_folds(cv, estimator, X):
    """Return a splitter, or the folds of so many parts by the columns that the estimator reads.

    Parameters
    ----------
    cv : int or cross-validation splitter
        A splitter, which stays as it is, or the number of folds.
    estimator : estimator
        Whose folds they are, alone or in a pipeline.
    X : DataFrame or array of shape (n_samples, n_columns)
        What it is to be fitted to.

    Returns
    -------
    cross-validation splitter
        The splitter.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModel, PhysicsModelRegressor
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> folds = own_folds(3, PhysicsModelRegressor(lag, time_column=1), [[5.0, 0.0], [5.0, 0.1]])
    >>> type(folds).__name__, folds.n_splits, folds.time_column
    ('TrajectoryKFold', 3, 1)
    """
    return cv if hasattr(cv, "split") else TrajectoryKFold(cv, **columns_of(estimator, X))


def columns_of(estimator, X) -> dict:
    """Return where an estimator reads time and trajectory, as its parameters or its model say.

    Parameters
    ----------
    estimator : estimator
        Of a pipeline the first step that says it counts, of an estimator around another the inner.
    X : DataFrame or array of shape (n_samples, n_columns)
        What it is to be fitted to; the names of a model are those of a DataFrame.

    Returns
    -------
    dict of str to int, str or None
        ``time_column`` and ``trajectory_column`` of `TrajectoryKFold`; None where it is the usual
        one.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_pgnn import PhysicsModel, PhysicsModelRegressor
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y"}, columns={"trajectory": "run"})
    >>> columns_of(PhysicsModelRegressor(lag), pd.DataFrame({"t": [0.0], "run": [1]}))
    {'time_column': None, 'trajectory_column': 'run'}
    """
    return {
        "time_column": _first_said(estimator, partial(_time_column, X=X)),
        "trajectory_column": _first_said(estimator, partial(_named_by_model, TRAJECTORY, X=X)),
    }


def _first_said(estimator, say):
    """Return what an estimator of trajectories, or the first one inside it, says."""
    if isinstance(estimator, Pipeline):
        said = (_first_said(step, say) for _, step in estimator.steps)
        return next((column for column in said if column is not None), None)
    if hasattr(estimator, "time_column"):
        return say(estimator)
    inner = getattr(estimator, "estimator", getattr(estimator, "regressor", None))
    return None if inner is None else _first_said(inner, say)


def _time_column(estimator, X):
    """Return the parameter for the time, else what the model calls it."""
    own = estimator.time_column
    return _named_by_model(TIME, estimator, X) if own is None else own


def _named_by_model(quantity, estimator, X) -> str | None:
    """Return what the model calls a quantity, where a table has such a column."""
    called = getattr(getattr(estimator, "model", None), "columns", {}).get(quantity)
    return called if called in getattr(as_pandas(X), "columns", ()) else None
