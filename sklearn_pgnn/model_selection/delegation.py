"""Methods that an estimator around another one has where that has them."""

from sklearn.utils.metaestimators import available_if


def inner_has(fitted: str, method: str):
    """Return the decorator of a method that is there where the estimator inside has it.

    Parameters
    ----------
    fitted : str
        Attribute that holds the fitted estimator; before the fit ``estimator`` is asked.
    method : str
        The method.

    Returns
    -------
    callable
        The decorator.
    """

    def check(outer) -> bool:
        return hasattr(getattr(outer, fitted, outer.estimator), method)

    return available_if(check)
