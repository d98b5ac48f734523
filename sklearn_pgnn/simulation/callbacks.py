"""External functions as compiled code calls them: by the address of a C function.

The function takes the addresses of its arguments and of its results. Where numba can compile it,
the address is that of machine code. Else it is one that calls Python: the time loops run without
Python's lock, and such a function takes it. An error inside of it cannot pass through compiled
code: what a function raises is NaN there, and noted; a signal's exception is kept, all further
calls give NaN at once, and `report_calls` raises it when Python has control again.
"""

import ctypes
import math
from collections.abc import Callable

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.external import ExternalFunction, take_failures
from sklearn_pgnn.simulation.native_function import native_function
from sklearn_pgnn.user_line import warn_user

_NUMBERS = ctypes.POINTER(ctypes.c_double)
_CALL = ctypes.CFUNCTYPE(None, _NUMBERS, _NUMBERS)


class _Stopped:
    """What ended a loop of compiled code from outside, if anything has."""

    by: BaseException | None = None


def addresses_of(function: ExternalFunction) -> tuple[int, int]:
    """Return the addresses of a C function that calls an external one, and of one in Python."""
    if function.token not in _KEPT:
        callback = _CALL(_guarded(function))
        python = ctypes.cast(callback, ctypes.c_void_p).value or 0
        native = native_function(function)
        address = native.address or python
        _KEPT[function.token] = callback, (address, address if native.never_fails else python)
    return _KEPT[function.token][1]


def _guarded(function: ExternalFunction) -> Callable:
    """Return a function out of which nothing is raised."""
    n, m = len(function.arguments), len(function.results)

    def guarded(point, out):
        found = (math.nan,) * m
        if _Stopped.by is None:
            try:
                found = function.compute(tuple(point[:n]))
            except BaseException as error:
                _Stopped.by = error
        for i, value in enumerate(found):
            out[i] = value

    return guarded


def report_calls() -> None:
    """Raise what stopped external functions, and warn of what they raised.

    A `SimulationWarning` names the line of each function once.
    """
    if _Stopped.by is not None:
        stopped, _Stopped.by = _Stopped.by, None
        raise stopped
    for said in take_failures():
        if said not in _SAID:
            _SAID.add(said)
            warn_user(
                f"{said}. Its value is NaN there, and a simulation that needs this value stops. "
                f"Remedy: make the function defined for all real arguments.",
                SimulationWarning,
            )


_KEPT: dict[str, tuple] = {}
_SAID: set[str] = set()
