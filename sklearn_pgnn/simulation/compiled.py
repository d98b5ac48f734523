"""A model's source compiled to machine code, once a process, within hundredths of a second.

The loops do not know a model's function, they call it by its address. numba's own function objects
and arrays would do, too (`PLAIN_CALLS`), but what they check and count at every call takes longer
than the mathematics.
"""

import os
from functools import cache

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.source import write_source
from sklearn_pgnn.simulation.straight_line import data_of, straight_line

_ARRAY = types.float64[::1]
_POINTER = types.CPointer(types.float64)
_BY_ARRAYS = types.void(types.float64, *[_ARRAY] * 5)
_BY_POINTERS = types.void(types.float64, *[_POINTER] * 5)

#: whether functions are called as numba's function objects; set by the environment before import
PLAIN_CALLS = os.environ.get("SKLEARN_PGNN_PLAIN_CALLS", "0") == "1"
#: the type of a model's function as an argument of the time loop
FUNCTION = types.FunctionType(_BY_ARRAYS) if PLAIN_CALLS else types.int64


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
    function : int or numba function
        What the time loops call by `call`: the function's address, or itself (`PLAIN_CALLS`).
    source : Source
        What was compiled.
    """
    source = write_source(model, wrt)
    function = _compile(source.text)
    return function if PLAIN_CALLS else function.address, source


@cache
def _compile(text: str):
    """Compile assignments to a function; it is cached, since its address is passed on."""
    emitted = straight_line(text)

    def function(t, x, u, p, s, out):
        emitted(t, x, u, p, s, out)

    if PLAIN_CALLS:
        return numba.njit(_BY_ARRAYS, error_model="numpy", no_cpython_wrapper=True)(function)
    return numba.cfunc(_BY_POINTERS, error_model="numpy")(function)


@intrinsic
def _call_address(context, function, t, x, u, p, s, out):
    """Call the function at an address with the time and the data of five arrays."""

    def generate(context, builder, signature, values):
        pointer = ir.DoubleType().as_pointer()
        called = ir.FunctionType(ir.VoidType(), [ir.DoubleType(), *[pointer] * 5])
        address = builder.inttoptr(values[0], called.as_pointer())
        arrays = zip(signature.args[2:], values[2:], strict=True)
        data = [data_of(context, builder, kind, value) for kind, value in arrays]
        builder.call(address, [values[1], *data])
        return context.get_dummy_value()

    return types.void(function, t, x, u, p, s, out), generate


@numba.njit(error_model="numpy")
def _call_object(function, t, x, u, p, s, out):
    function(t, x, u, p, s, out)


#: how a time loop calls a model's function: ``call(function, t, x, u, p, s, out)``
call = _call_object if PLAIN_CALLS else _call_address
