"""A function in Python that a model calls, compiled by numba where numba can.

What numba does not know is written otherwise before: ``p["mass"]`` is the element at that place,
and tables in lists are arrays. What is compiled is held against the function itself at some points.
"""

import ctypes
import dis
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from numbers import Number
from types import CellType, CodeType, FunctionType
from typing import Any

import numba
import numpy as np
from numba import carray, types

from sklearn_pgnn.physics.external import ExternalFunction, said_by
from sklearn_pgnn.priors.called_function import NEAR, NumericFunction
from sklearn_pgnn.priors.rigid_tree import TreeDynamics, TreeSlopes
from sklearn_pgnn.simulation import rigid_bodies

_NUMBERS = types.CPointer(types.float64)


@dataclass(frozen=True)
class Native:
    """What has become of a function in numba's hands.

    `address` is that of a C function of the addresses of arguments and results; it is 0 where there
    is none, and `why_not` says why. `compiled` keeps the machine code alive. One that `never_fails`
    gives numbers, NaN among them, that are all there is to know.
    """

    address: int = 0
    why_not: str = ""
    compiled: Any = None
    never_fails: bool = False


@cache
def native_function(function: ExternalFunction) -> Native:
    """Compile a function that equations call."""
    call = function.call
    if isinstance(call, TreeDynamics | TreeSlopes):
        rigid = rigid_bodies.compiled(call)
        return Native(rigid.address, compiled=rigid, never_fails=True)
    if not isinstance(call, NumericFunction):
        return Native(why_not="it is not written in Python")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numba's own, on how it compiles
            compiled = _compiled(call)
    except Exception as error:  # numba raises errors of many kinds
        return Native(why_not=said_by(error)[:300])
    for point in call.points:
        if not _same(_at(compiled, point, len(function.results)), call(point)):
            return Native(why_not="its compiled result differs")
    return Native(compiled.address, compiled=compiled)


def how_called(function: ExternalFunction) -> str:
    """Return how a model calls a function, in words."""
    native = native_function(function)
    if native.address:
        return "compiled by numba"
    return f"in Python, since numba cannot compile it ({native.why_not})"


def _compiled(call: NumericFunction):
    """Compile a function of time, states, inputs and parameters as one of two addresses."""
    n_x, n_u, n_p = map(len, call.parts)
    written = numba.njit(boundscheck=True)(_translated(call.function, _places(call.parts)))
    take = _taker(call)
    behind_x, behind_u = 1 + n_x, 1 + n_x + n_u
    n, m = behind_u + n_p, len(call.names or ())

    @numba.njit
    def native(point, out):
        given, found = carray(point, n), carray(out, m)
        try:
            take(
                written(given[0], given[1:behind_x], given[behind_x:behind_u], given[behind_u:]),
                found,
            )
        except Exception:
            found[:] = math.nan

    @numba.cfunc(types.void(_NUMBERS, _NUMBERS))
    def entry(point, out):
        native(point, out)

    return entry


def _taker(call: NumericFunction):
    """Return what writes the results of a function, whatever they come in, into an array."""
    names, sample = call.names, call.raw(call.points[0])
    if isinstance(sample, Mapping):

        @numba.njit
        def take(found, out):
            for i, name in enumerate(names):
                out[i] = found[name]

    elif isinstance(sample, Number):

        @numba.njit
        def take(found, out):
            out[0] = found

    else:

        @numba.njit
        def take(found, out):
            for i in range(len(names)):
                out[i] = found[i]

    return take


def _at(compiled, point, count: int) -> list[float]:
    out = (ctypes.c_double * count)()
    given = (ctypes.c_double * len(point))(*point)
    compiled.ctypes(given, out)
    return list(out)


def _same(found: Sequence[float], expected: Sequence[float]) -> bool:
    return all(abs(a - b) <= NEAR * max(1.0, abs(b)) for a, b in zip(found, expected, strict=True))


# -- what numba reads ------------------------------------------------------------------------------


def _places(parts) -> dict[str, int]:
    return {name: place for part in parts for place, name in enumerate(part)}


def _translated(function, places: Mapping[str, int]) -> FunctionType:
    """Return a function with names as places, and with lists as arrays."""
    if not isinstance(function, FunctionType):
        raise TypeError(f"expected a plain function, got {type(function).__name__}")
    code = _by_place(function.__code__, places)
    around = {
        name: _as_numba_knows(function.__globals__[name], places)
        for name in code.co_names
        if name in function.__globals__
    }
    cells = function.__closure__ or ()
    held = tuple(CellType(_as_numba_knows(cell.cell_contents, places)) for cell in cells)
    return FunctionType(code, around, function.__name__, function.__defaults__, held or None)


def _as_numba_knows(value, places):
    if isinstance(value, FunctionType):
        return numba.njit(boundscheck=True)(_translated(value, places))
    if isinstance(value, list):
        return np.array(value, dtype=float)
    if type(value) is tuple:
        return tuple(_as_numba_knows(part, places) for part in value)
    return value


def _by_place(code: CodeType, places: Mapping[str, int]) -> CodeType:
    """Return code in which an element by a quantity's name is the one at its place."""
    instructions, consts = list(dis.get_instructions(code)), list(code.co_consts)
    changed = bytearray(code.co_code)
    for instruction, after in pairwise(instructions):
        name = instruction.argval
        if instruction.opname == "LOAD_CONST" and _takes_element(after) and name in places:
            if places[name] not in consts[len(code.co_consts) :]:
                consts.append(places[name])
            number = consts.index(places[name], len(code.co_consts))
            if number > 255:
                raise ValueError("too many constants")
            changed[instruction.offset + 1] = number
    return code.replace(co_code=bytes(changed), co_consts=tuple(consts))


def _takes_element(instruction) -> bool:
    """Return whether an instruction takes an element, as ``p[...]`` does."""
    return instruction.opname == "BINARY_SUBSCR" or (
        instruction.opname == "BINARY_OP" and instruction.argrepr == "[]"
    )
