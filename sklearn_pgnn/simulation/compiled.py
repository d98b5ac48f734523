"""How the time loops call a model: one function a model, by its address.

The loops of `stepping`, `kalman` and `network_loop` are compiled once and kept on disk. They take a
model's function as its address, an integer, and call it by `call`, always with the same arguments:
what to do, two numbers and the data of eight arrays, see `sklearn_pgnn.simulation.model_function`.
Nothing is allocated, counted or checked at a call. numba's own function objects and arrays would
do, too (`PLAIN_CALLS`), and give the same numbers, but what they check at every call takes longer
than the mathematics.
"""

import os
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numba
from numba import types
from numba.extending import intrinsic

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.callbacks import report_calls
from sklearn_pgnn.simulation.lanes import data_of
from sklearn_pgnn.simulation.machine_code import SIGNATURE, CodeMemory, machine_code
from sklearn_pgnn.simulation.model_function import emit_model_function
from sklearn_pgnn.simulation.source import Source, write_source

_FLOATS, _TABLE, _BITS = types.float64[::1], types.float64[:, ::1], types.boolean[::1]
_SCALARS = (types.int64, types.float64, types.float64)
_BY_ARRAYS = types.void(*_SCALARS, _FLOATS, _TABLE, *[_FLOATS] * 4, _BITS, _FLOATS)

#: whether functions are called as numba's function objects; set by the environment before import
PLAIN_CALLS = os.environ.get("SKLEARN_PGNN_PLAIN_CALLS", "0") == "1"
#: the type of a model's function as an argument of the time loop
FUNCTION = types.FunctionType(_BY_ARRAYS) if PLAIN_CALLS else types.int64
#: most functions that are kept in case they are used again; each takes some 20 kB, and a diagnosis
#: of a small model compiles 60
MOST = 1024


@dataclass(frozen=True)
class ModelFunction:
    """A model's compiled function, at an address that is valid as long as it lives."""

    argument: Any
    memory: CodeMemory | None = None


def compile_model(model: PhysicsModel, wrt: tuple[str, ...] | None = None, method: str = "rk4"):
    """Compile a model's function."""
    report_calls()  # a loop that was stopped from outside may have been followed by nothing else
    source = write_source(model, wrt)
    return _compile(source, method), source


@lru_cache(maxsize=MOST)
def _compile(source: Source, method: str) -> ModelFunction:
    """Compile a model's function, unless it is among those that were used last."""
    if not PLAIN_CALLS:
        return ModelFunction(*machine_code(source, method))

    @intrinsic
    def emitted(context, task, t, h, x, S, u, u_end, p, s, stuck, out):
        def generate(context, builder, signature, values):
            arrays = zip(signature.args[3:], values[3:], strict=True)
            data = [data_of(context, builder, kind, value) for kind, value in arrays]
            emit_model_function(builder, source, method, [*values[:3], *data])
            return context.get_dummy_value()

        return types.void(task, t, h, x, S, u, u_end, p, s, stuck, out), generate

    @numba.njit(_BY_ARRAYS, error_model="numpy", no_cpython_wrapper=True)
    def function(task, t, h, x, S, u, u_end, p, s, stuck, out):
        emitted(task, t, h, x, S, u, u_end, p, s, stuck, out)

    return ModelFunction(function)


@intrinsic
def _call_address(context, function, task, t, h, x, S, u, u_end, p, s, stuck, out):
    """Call the function at an address with three numbers and the data of eight arrays."""
    kinds = (task, t, h, x, S, u, u_end, p, s, stuck, out)

    def generate(context, builder, signature, values):
        arrays = zip(signature.args[4:], values[4:], strict=True)
        given = [*values[1:4], *(data_of(context, builder, kind, value) for kind, value in arrays)]
        builder.call(builder.inttoptr(values[0], SIGNATURE.as_pointer()), given)
        return context.get_dummy_value()

    return types.void(function, *kinds), generate


@numba.njit(error_model="numpy")
def _call_object(function, task, t, h, x, S, u, u_end, p, s, stuck, out):
    function(task, t, h, x, S, u, u_end, p, s, stuck, out)


#: how a time loop calls a model's function, see `sklearn_pgnn.simulation.model_function`:
#: ``call(function, task, t, h, x, S, u, u_end, p, s, stuck, out)``
call = _call_object if PLAIN_CALLS else _call_address
