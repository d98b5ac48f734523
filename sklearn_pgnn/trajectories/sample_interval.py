"""The sample interval as given by a user."""

import math
from numbers import Real

from sklearn_pgnn.exceptions import OptionError


def check_sample_interval(value, name: str = "interval", remedy: str = "") -> None:
    """Raise `OptionError` unless a sample interval is a finite time above 0.

    Parameters
    ----------
    value : float
        The sample interval [s].
    name : str, default="interval"
        The option's name.
    remedy : str, optional
        What the message proposes.

    Examples
    --------
    >>> check_sample_interval(0.01)
    >>> check_sample_interval(0, remedy="Remedy: interval=0.01.")
    Traceback (most recent call last):
        ...
    sklearn_pgnn.exceptions.OptionError: interval: expected the sample interval in seconds, a \
number above 0, got 0. Remedy: interval=0.01.
    """
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if is_number and 0 < float(value) < math.inf:
        return
    text = f"{name}: expected the sample interval in seconds, a number above 0, got {value!r}."
    raise OptionError(f"{text} {remedy}".rstrip())
