"""Pareto front of accuracy and physics over the weight of the physical loss."""

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from sklearn.base import clone
from sklearn.pipeline import Pipeline

from sklearn_pgnn.model_selection.trajectory_k_fold import own_folds
from sklearn_pgnn.trajectories.tables import as_columns, take_rows

#: default weights of the physical loss for a front
LAMBDAS = (0.0, 0.001, 0.01, 0.03, 0.1, 0.3, 0.6, 0.9)


def pareto_front(
    estimator,
    X,
    y,
    *,
    lambdas=LAMBDAS,
    X_test=None,
    y_test=None,
    cv=None,
    param="lambda_phy",
    n_jobs=None,
) -> pd.DataFrame:
    r"""Fit with several weights of the physical loss, and find those that are not dominated.

    .. math::
        e = \sqrt{\overline{\,\overline{(\hat y - y)^2}\,/\,s^2\,}}, \qquad
        r = \overline{h(\hat x)^2}

    with the spread :math:`s` (standard deviation) of every tested output and the dimensionless
    physical residuals :math:`h` of the prediction. A weight is on the front [1]_ if no other has
    both :math:`e` and :math:`r` smaller, or one smaller and the other equal.

    Parameters
    ----------
    estimator : estimator
        A network with a physical loss (`PGNNLRegressor`), or a pipeline that ends in one. Its last
        step has ``physics_residual(X)``, which gives an array of shape (n_samples, n_terms), NaN in
        rows that have none.
    X : DataFrame or array of shape (n_samples, n_columns)
        Training data: time, inputs, initial states.
    y : array-like of shape (n_samples, n_outputs) or (n_samples,)
        Measured outputs.
    lambdas : sequence of float, default=(0, 0.001, 0.01, 0.03, 0.1, 0.3, 0.6, 0.9)
        Weights to try.
    X_test, y_test : as X and y, optional
        Test data.
    cv : int or cross-validation splitter, optional
        Folds of X instead of test data; a number means `TrajectoryKFold` with the time column of
        the estimator. By default, without test data, 5.
    param : str, default="lambda_phy"
        Name of the weight's parameter, found in any step of a pipeline; or its full name.
    n_jobs : int, optional
        Processes to fit in; -1 means all.

    Returns
    -------
    DataFrame of shape (n_lambdas, 4)
        The weight under the parameter's name, ``error`` :math:`e`, ``physics`` :math:`r` and
        whether it is ``on_front``. A weight whose prediction is not finite has an infinite error.

    Raises
    ------
    ValueError
        If both `cv` and test data or only one of `X_test` and `y_test` are given, the parameter is
        not found, the last step has no physical residual, or an output is constant.

    References
    ----------
    .. [1] F. M. Rohrhofer, S. Posch, B. C. Geiger, "On the Pareto Front of Physics-Informed Neural
       Networks", 2021, arXiv:2105.00862.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> class Level(Ridge):
    ...     def physics_residual(self, X):
    ...         return np.diff(self.predict(X), prepend=0.0)  # physics: it hardly rises
    >>> X = np.arange(8.0)[:, None]
    >>> front = pareto_front(Level(), X, X, lambdas=(0.0, 10.0), X_test=X, y_test=X, param="alpha")
    >>> front["on_front"].tolist()
    [True, True]
    """
    sets = _test_sets(estimator, X, y, X_test, y_test, cv)
    name = _full_name(estimator, param)
    judged = Parallel(n_jobs=n_jobs)(
        delayed(_fit_and_judge)(clone(estimator).set_params(**{name: weight}), *each)
        for weight in lambdas
        for each in sets
    )
    spread = _spread([each[3] for each in sets])
    folds = [judged[i : i + len(sets)] for i in range(0, len(judged), len(sets))]
    squares = [np.nanmean(np.concatenate([e for e, _ in each]) ** 2, axis=0) for each in folds]
    error = np.array([np.sqrt(np.mean(square / spread**2)) for square in squares])
    physics = np.array([np.nanmean(np.concatenate([r for _, r in each]) ** 2) for each in folds])
    return pd.DataFrame(
        {
            param.rpartition("__")[2]: list(lambdas),
            "error": error,
            "physics": physics,
            "on_front": _not_dominated(error, physics),
        }
    )


# -- what is fitted, and on what it is tested ------------------------------------------------------


def _test_sets(estimator, X, y, X_test, y_test, cv) -> list[tuple]:
    """Return training and test sets: X, y, X_test, y_test of every fold."""
    if (X_test is None) != (y_test is None):
        raise ValueError("X_test, y_test: expected both or none, got one of them.")
    if X_test is not None and cv is not None:
        raise ValueError("expected either cv or X_test and y_test, got both.")
    if X_test is not None:
        return [(X, y, X_test, y_test)]
    splitter = own_folds(5 if cv is None else cv, estimator, X)
    return [
        (take_rows(X, train), take_rows(y, train), take_rows(X, test), take_rows(y, test))
        for train, test in splitter.split(X, y)
    ]


def _full_name(estimator, param) -> str:
    """Return the full name of the one parameter with this name, in any step."""
    known = estimator.get_params()
    found = [param] if param in known else [name for name in known if name.endswith(f"__{param}")]
    if len(found) != 1:
        raise ValueError(
            f"param: expected one parameter {param!r} in {type(estimator).__name__}, got "
            f"{', '.join(found) or 'none'}. Remedy: give the full name, such as 'step__{param}'."
        )
    return found[0]


def _fit_and_judge(estimator, X, y, X_test, y_test) -> tuple[np.ndarray, np.ndarray]:
    """Fit, and return the errors and the physical residuals of the prediction."""
    estimator.fit(X, y)
    predicted, measured = as_columns(estimator.predict(X_test)), as_columns(y_test)
    error = predicted - measured
    error[np.isfinite(measured) & ~np.isfinite(predicted)] = np.inf
    return error, _physics_residual(estimator, X_test)


def _physics_residual(estimator, X) -> np.ndarray:
    """Return the physical residuals of a prediction, by the last step of a fitted estimator."""
    if isinstance(estimator, Pipeline):
        before = estimator[:-1]
        return _physics_residual(estimator[-1], before.transform(X) if len(before) else X)
    if not hasattr(estimator, "physics_residual"):
        raise ValueError(
            f"{type(estimator).__name__} has no physics_residual(X). Remedy: end the pipeline in "
            f"an estimator that has, such as PGNNLRegressor."
        )
    return as_columns(estimator.physics_residual(X))


# -- what is judged --------------------------------------------------------------------------------


def _spread(measured) -> np.ndarray:
    """Return the standard deviation of every tested output."""
    spread = np.nanstd(np.concatenate([as_columns(y) for y in measured]), axis=0)
    still = np.flatnonzero(~(spread > 0))
    if still.size:
        raise ValueError(
            f"y: output {still[0]} is constant on the tested samples; an error relative to its "
            f"spread does not exist."
        )
    return spread


def _not_dominated(error, physics) -> np.ndarray:
    """Return which points no other point dominates."""
    points = np.column_stack([error, physics])
    no_worse = (points[:, None] <= points).all(axis=2)
    better = (points[:, None] < points).any(axis=2)
    return np.isfinite(points).all(axis=1) & ~(no_worse & better).any(axis=0)
