"""Calls of external functions, and the difference quotients of them, as LLVM instructions.

A call computes all results of a function at one point, and every point once: the results at a point
serve all rates, those beside it all slopes by one argument. The slopes are those of
`sklearn_pgnn.physics.external`.
"""

import sys
from math import nan

from llvmlite import ir
from numba.core import cgutils

from sklearn_pgnn.physics.external import JUMP, SMALL, External
from sklearn_pgnn.simulation.callbacks import addresses_of

FLOAT, INT = ir.DoubleType(), ir.IntType(64)
NUMBERS = FLOAT.as_pointer()
CALL = ir.FunctionType(ir.VoidType(), [NUMBERS, NUMBERS]).as_pointer()


class OutsideCalls:
    """The calls among the instructions of one evaluation of a model's function."""

    def __init__(self, builder):
        self.builder = builder
        self._results: dict[tuple, list] = {}
        self._beside: dict[tuple, tuple] = {}
        self._rooms: dict[str, tuple] = {}

    def number(self, made: type[External], values):
        """Emit a result of a function, or a slope of it.

        `made` is what is called, see `sklearn_pgnn.physics.external.external`. The number is NaN
        where an argument is not finite.
        """
        return self._slope(made, list(values), made.by)

    def _slope(self, made, values, by):
        if not by:
            return self._value(made, values)
        (*rest, i), b = by, self.builder
        here, (low, high) = values[i], self._points_beside(values[i], len(made.by))
        before, at, behind = (
            self._slope(made, [*values[:i], x, *values[i + 1 :]], rest) for x in (low, here, high)
        )
        left = b.fdiv(b.fsub(at, before), b.fsub(here, low))
        right = b.fdiv(b.fsub(behind, at), b.fsub(high, here))
        whole = b.fdiv(b.fsub(behind, before), b.fsub(high, low))
        sizes = self._size(left), self._size(right)
        least = b.select(b.fcmp_ordered("<", sizes[1], sizes[0]), right, left)
        apart, limit = self._size(b.fsub(right, left)), b.fmul(FLOAT(JUMP), self._size(least))
        return b.select(b.fcmp_ordered(">", apart, limit), least, whole)

    def _points_beside(self, value, order):
        """Return the values a step before and behind one, the same for all who ask."""
        key = (_identity(value), order)
        if key not in self._beside:
            b, size = self.builder, self._size(value)
            size = b.select(b.fcmp_ordered(">", size, FLOAT(SMALL)), size, FLOAT(SMALL))
            step = b.fmul(FLOAT(sys.float_info.epsilon ** (1 / (2 + order))), size)
            self._beside[key] = b.fsub(value, step), b.fadd(value, step), value
        return self._beside[key][:2]

    def _size(self, value):
        module = self.builder.module
        return self.builder.call(module.declare_intrinsic("llvm.fabs", [FLOAT]), [value])

    def _value(self, made, values):
        key = (made.function.token, made.places, *map(_identity, values))
        if key not in self._results:
            self._results[key] = [values, self._call(made, values)]
        return self._results[key][1][made.result]

    def _call(self, made, values):
        """Emit the call at a point; return all results."""
        b, function = self.builder, made.function
        point, out = self._room(function)
        given = dict(zip(made.places, values, strict=True))
        for i in range(len(function.arguments)):
            b.store(given.get(i, FLOAT(nan)), b.gep(point, [INT(i)]))
        count = range(len(function.results))
        places = [b.gep(out, [INT(i)]) for i in count]
        for place in places:
            b.store(FLOAT(nan), place)
        address, python = addresses_of(function)
        with b.if_then(self._all_finite(values), likely=True):
            b.call(b.inttoptr(INT(address), CALL), [point, out])
            if python != address:
                found = [b.load(place) for place in places]
                with b.if_then(b.not_(self._all_finite(found)), likely=False):
                    b.call(b.inttoptr(INT(python), CALL), [point, out])
        return [b.load(place) for place in places]

    def _room(self, function):
        """Return where the arguments and the results of a function stand."""
        if function.token not in self._rooms:
            self._rooms[function.token] = tuple(
                cgutils.alloca_once(self.builder, FLOAT, size=INT(max(1, len(names))))
                for names in (function.arguments, function.results)
            )
        return self._rooms[function.token]

    def _all_finite(self, values):
        b, total = self.builder, FLOAT(0.0)
        for value in values:
            total = b.fadd(total, b.fmul(value, FLOAT(0.0)))
        return b.fcmp_ordered("ord", total, total)


def _identity(value):
    """Return what two values have in common that are the same."""
    return ("constant", value.constant) if isinstance(value, ir.Constant) else id(value)
