"""The sample interval as given by a user."""

import math
from numbers import Real

from sklearn_pgnn.exceptions import OptionError


def check_sample_interval(value, name: str = "interval", remedy: str = "") -> None:
    """Raise `OptionError` unless a sample interval is a finite time above 0.

    It is in seconds; `remedy` is what the message proposes.
    """
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if is_number and 0 < float(value) < math.inf:
        return
    text = f"{name}: expected the sample interval in seconds, a number above 0, got {value!r}."
    raise OptionError(f"{text} {remedy}".rstrip())
