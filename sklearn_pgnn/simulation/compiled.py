"""A model's source compiled to machine code, once a process, in some hundredths of a second."""

from functools import lru_cache

import numba
from numba import types

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.source import write_source
from sklearn_pgnn.simulation.straight_line import straight_line

_ARRAY = types.float64[::1]
SIGNATURE = types.void(types.float64, _ARRAY, _ARRAY, _ARRAY, _ARRAY, _ARRAY)
#: the type of a model's function as an argument of the time loop
FUNCTION = types.FunctionType(SIGNATURE)


def compile_model(model: PhysicsModel, wrt: tuple[str, ...] | None = None):
    """Compile a model's function.

    Parameters
    ----------
    model : PhysicsModel
        The model; its parameter values do not matter.
    wrt : tuple of str, optional
        Parameters to differentiate by; without it only rates and outputs are computed.

    Returns
    -------
    function : numba function
        To be called by the time loop.
    source : Source
        What was compiled.
    """
    source = write_source(model, wrt)
    return _compile(source.text), source


@lru_cache(maxsize=4096)
def _compile(text: str):
    """Compile assignments to a function of the time loop's type."""
    emitted = straight_line(text)

    def function(t, x, u, p, s, out):
        emitted(t, x, u, p, s, out)

    return numba.njit(SIGNATURE, error_model="numpy", no_cpython_wrapper=True)(function)
