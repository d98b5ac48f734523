"""The folds that a number asks for: whole trajectories, by the time that the estimator reads."""

from sklearn.pipeline import Pipeline

from sklearn_pgnn.model_selection.trajectory_k_fold import TrajectoryKFold
from sklearn_pgnn.trajectories.tables import TIME, as_pandas


def own_folds(cv, estimator, X):
    """Return a splitter, or the folds of so many parts by the estimator's own time.

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
    >>> own_folds(3, PhysicsModelRegressor(lag, time_column=1), [[5.0, 0.0], [5.0, 0.1]])
    TrajectoryKFold(n_splits=3, random_state=None, shuffle=False, time_column=1)
    """
    if hasattr(cv, "split"):
        return cv
    return TrajectoryKFold(cv, time_column=time_column_of(estimator, X))


def time_column_of(estimator, X):
    """Return the column in which an estimator reads the time, as its parameters or its model say.

    Parameters
    ----------
    estimator : estimator
        Of a pipeline the first step that says it counts, of an estimator around another the inner.
    X : DataFrame or array of shape (n_samples, n_columns)
        What it is to be fitted to; the names of a model are those of a DataFrame.

    Returns
    -------
    int, str or None
        The column; None where it is the usual one.
    """
    if isinstance(estimator, Pipeline):
        said = (time_column_of(step, X) for _, step in estimator.steps)
        return next((column for column in said if column is not None), None)
    if hasattr(estimator, "time_column"):
        own = estimator.time_column
        return _named_by_model(estimator, X) if own is None else own
    inner = getattr(estimator, "estimator", getattr(estimator, "regressor", None))
    return None if inner is None else time_column_of(inner, X)


def _named_by_model(estimator, X) -> str | None:
    """Return what the model calls the time, where a table has such a column."""
    called = getattr(getattr(estimator, "model", None), "columns", {}).get(TIME)
    return called if called in getattr(as_pandas(X), "columns", ()) else None
