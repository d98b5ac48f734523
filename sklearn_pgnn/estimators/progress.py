"""Verbose output of the estimators."""

from collections.abc import Callable

#: takes one line of text
PrintLine = Callable[[str], None]


def silence(text: str) -> None:
    """Do nothing: the progress of a search without ``verbose``."""


def progress_printer(estimator) -> PrintLine:
    """Return a function that prints a line if the estimator is verbose, and else does nothing.

    Parameters
    ----------
    estimator : estimator
        Has a parameter ``verbose``.

    Returns
    -------
    callable
        Takes a line of text.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModelRegressor
    >>> progress_printer(PhysicsModelRegressor(None, verbose=1))("3 records")
    [PhysicsModelRegressor] 3 records
    """
    if not estimator.verbose:
        return silence
    name = type(estimator).__name__

    def print_line(text: str) -> None:
        print(f"[{name}] {text}", flush=True)

    return print_line
