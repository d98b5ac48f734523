"""External functions as compiled code calls them: by the address of a C function.

The time loops run without Python's lock; such a function takes it. An error inside of it cannot
pass through compiled code: what a function raises is NaN there, and noted; a signal's exception is
kept, all further calls give NaN at once, and `report_calls` raises it when Python has control
again.
"""

import ctypes
import math
import warnings
from collections.abc import Callable
from functools import cache

from sklearn_pgnn.exceptions import ModelError, SimulationWarning
from sklearn_pgnn.physics.external import class_of, take_failures


class _Stopped:
    """What ended a loop of compiled code from outside, if anything has."""

    by: BaseException | None = None


@cache
def address_of(name: str) -> int:
    """Return the address of a C function of doubles that calls an external function.

    Parameters
    ----------
    name : str
        Name of its class, see `sklearn_pgnn.physics.external.external`.

    Returns
    -------
    int
        The address, which is valid as long as the process lives.

    Raises
    ------
    ModelError
        If there is none of that name in this process.
    """
    made = class_of(name)
    if made is None:
        raise ModelError(f"expected a function that equations can call, got {name!r}.")
    kind = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * len(made.places))
    callback = kind(_guarded(made.number))
    _KEPT.append(callback)
    return ctypes.cast(callback, ctypes.c_void_p).value or 0


def _guarded(number: Callable) -> Callable:
    """Return a function out of which nothing is raised."""

    def guarded(*values):
        if _Stopped.by is not None:
            return math.nan
        try:
            return number(*values)
        except BaseException as error:
            _Stopped.by = error
            return math.nan

    return guarded


def report_calls() -> None:
    """Raise what stopped external functions, and warn of what they raised.

    Warns
    -----
    SimulationWarning
        With the line of the function, once for each.
    """
    if _Stopped.by is not None:
        stopped, _Stopped.by = _Stopped.by, None
        raise stopped
    for said in take_failures():
        if said not in _SAID:
            _SAID.add(said)
            warnings.warn(
                f"{said}. Its value is not a number there, and a simulation that needs it ends. "
                f"Remedy: a function that is defined for all numbers.",
                SimulationWarning,
                stacklevel=3,
            )


_KEPT: list = []
_SAID: set[str] = set()
