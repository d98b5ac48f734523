"""What scikit-learn expects of every estimator's X, before it is read as records."""

from sklearn.utils.validation import validate_data


def validate_table(estimator, X, *, reset: bool):
    """Refuse what is no table, and keep or compare the number and the names of its columns.

    Parameters
    ----------
    estimator : estimator
        Gets `n_features_in_` and, of a DataFrame, `feature_names_in_`.
    X : DataFrame or array-like of shape (n_samples, n_columns)
        The table; NaN is left to `read_records`, which knows where it may stand.
    reset : bool
        Whether to keep what X has (in `fit`), or to compare it with what was kept.

    Returns
    -------
    DataFrame or ndarray
        The table; a DataFrame as it came.

    Raises
    ------
    ValueError
        If X is sparse, complex, empty or not two-dimensional, or its columns have changed.

    Examples
    --------
    >>> from sklearn.base import BaseEstimator
    >>> estimator = BaseEstimator()
    >>> validate_table(estimator, [[0.0, 1.0], [0.1, 1.0]], reset=True).shape
    (2, 2)
    >>> estimator.n_features_in_
    2
    """
    if hasattr(X, "columns"):
        validate_data(estimator, X, reset=reset, skip_check_array=True)
        return X
    return validate_data(estimator, X, reset=reset, ensure_all_finite="allow-nan")
