"""Parameters of an estimator, or of estimators in it, by their own names."""


def parameters_named(estimator, name: str) -> dict[str, object]:
    """Return the parameters with a given name, of an estimator and of all estimators in it.

    They are by full name; `name` is without a prefix.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> from sklearn.pipeline import make_pipeline
    >>> parameters_named(make_pipeline(Ridge(alpha=2.0)), "alpha")
    {'ridge__alpha': 2.0}
    """
    found = estimator.get_params().items()
    return {full: value for full, value in found if full.rpartition("__")[2] == name}
