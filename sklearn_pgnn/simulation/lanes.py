r"""Eight numbers at once, in vector registers: products; neurons' sums and hyperbolic tangents.

LLVM does not vectorise a row of a few numbers by itself: its loops are too short, and its
exponential function takes one number. With :math:`2v = n\ln 2 + r` and :math:`|r| \le \ln 2/2`

.. math:: \tanh v = 1 - \frac{2}{e^{2v} + 1}, \qquad e^{2v} = 2^n \sum_k \frac{r^k}{k!}

whose sum up to :math:`r^{13}` is exact to half a unit of the last digit.
"""

import math

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

#: numbers at once
LANES = 8
_FLOAT, _INT = ir.DoubleType(), ir.IntType(64)
_FLOATS, _INTS = ir.VectorType(_FLOAT, LANES), ir.VectorType(_INT, LANES)
#: added to a number below 2**51 it leaves the nearest integer in the last bits
_TO_NEAREST = 1.5 * 2.0**52
#: ln 2 in two parts, of which the first has few digits: its products with integers are exact
_LN2 = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_COEFFICIENTS = [1.0 / math.factorial(k) for k in range(14)]
#: from here on the tangent is one
_ONE_FROM = 20.0
#: bits of a float before its exponent, and the exponent of one
_FRACTION_BITS, _BIAS = 52, 1023


def data_of(context, builder, kind, value):
    """Return the LLVM pointer to the numbers of an array."""
    return context.make_array(kind)(context, builder, value).data


@intrinsic
def add_multiple(context, given, at, place, sums, row):
    """Add ``given[at] * given[place:]`` of all lanes to ``sums[row, place:]``."""

    def generate(context, builder, signature, values):
        at, place = values[1:3]
        data = data_of(context, builder, given, values[0])
        factor = _same(builder, builder.load(builder.gep(data, [at])))
        out = _row(context, builder, sums, *values[3:])
        product = builder.fmul(factor, _load(builder, data, place))
        _store(builder, builder.fadd(_load(builder, out, place), product), out, place)
        return context.get_dummy_value()

    return types.void(given, at, place, sums, row), generate


@intrinsic
def weigh(context, weights, bias, first, stride, n_in, given, row, sums, place):
    """Write ``weights[bias:] + sum_j weights[first + j*stride:] * given[row, j]`` of all lanes.

    They go to ``sums[row + 1, place:]``.
    """

    def generate(context, builder, signature, values):
        data = data_of(context, builder, weights, values[0])
        start, begin, step, count, z, layer, out, at = values[1:]
        z = _row(context, builder, given, z, layer)
        total = cgutils.alloca_once_value(builder, _load(builder, data, start))
        with cgutils.for_range(builder, count) as loop:
            place_of = builder.add(begin, builder.mul(loop.index, step))
            factor = _same(builder, builder.load(builder.gep(z, [loop.index])))
            column = _load(builder, data, place_of)
            builder.store(_fused(builder, column, factor, builder.load(total)), total)
        out = _row(context, builder, sums, out, builder.add(layer, _INT(1)))
        _store(builder, builder.load(total), out, at)
        return context.get_dummy_value()

    kinds = (weights, bias, first, stride, n_in, given, row, sums, place)
    return types.void(*kinds), generate


@intrinsic
def tanh_lanes(context, given, found, row, place):
    """Write the hyperbolic tangents of all lanes of ``given[row, place:]`` to ``found``."""

    def generate(context, builder, signature, values):
        v = _row(context, builder, given, values[0], values[2])
        out = _row(context, builder, found, values[1], values[2])
        _store(builder, _tanh(builder, _load(builder, v, values[3])), out, values[3])
        return context.get_dummy_value()

    return types.void(given, found, row, place), generate


def _tanh(builder, v):
    """Emit the hyperbolic tangent of a vector."""
    for sign, beyond in ((1.0, ">"), (-1.0, "<")):
        limit = _constant(sign * _ONE_FROM)
        v = builder.select(builder.fcmp_ordered(beyond, v, limit), limit, v)
    power = _exponential(builder, builder.fadd(v, v))
    share = builder.fdiv(_constant(2.0), builder.fadd(power, _constant(1.0)))
    return builder.fsub(_constant(1.0), share)


def _exponential(builder, v):
    """Emit the exponential function of a vector of moderate numbers."""
    moved = _fused(builder, v, _constant(1.0 / math.log(2.0)), _constant(_TO_NEAREST))
    n = builder.fsub(moved, _constant(_TO_NEAREST))
    r = v
    for part in _LN2:
        r = _fused(builder, n, _constant(-part), r)
    bits = builder.add(builder.bitcast(moved, _INTS), _constant(_BIAS, _INT))
    bits = builder.shl(bits, _constant(_FRACTION_BITS, _INT))
    return builder.fmul(_polynomial(builder, r), builder.bitcast(bits, _FLOATS))


def _polynomial(builder, r):
    """Emit the sum of the powers, pair by pair, so that few wait for each other."""
    terms = [_constant(value) for value in _COEFFICIENTS]
    while len(terms) > 1:
        pairs = zip(terms[::2], terms[1::2], strict=True)
        terms = [_fused(builder, odd, r, even) for even, odd in pairs]
        if len(terms) > 1 and len(terms) % 2:
            terms.append(_constant(0.0))
        r = builder.fmul(r, r)
    return terms[0]


def _fused(builder, a, b, c):
    """Emit a*b + c, in one operation where the processor has one."""
    kind = ir.FunctionType(_FLOATS, [_FLOATS] * 3)
    function = builder.module.declare_intrinsic(f"llvm.fmuladd.v{LANES}f64", (), kind)
    return builder.call(function, [a, b, c])


def _constant(value, kind=_FLOAT):
    return ir.Constant(ir.VectorType(kind, LANES), [kind(value)] * LANES)


def _same(builder, value):
    """Emit a vector of the same number."""
    single = builder.insert_element(ir.Constant(_FLOATS, ir.Undefined), value, ir.IntType(32)(0))
    nowhere = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [ir.IntType(32)(0)] * LANES)
    return builder.shuffle_vector(single, ir.Constant(_FLOATS, ir.Undefined), nowhere)


def _row(context, builder, kind, value, row):
    """Return the pointer to the beginning of an array's row."""
    array = context.make_array(kind)(context, builder, value)
    length = builder.extract_value(array.shape, 1)
    return builder.gep(array.data, [builder.mul(row, length)])


def _load(builder, data, place):
    pointer = builder.bitcast(builder.gep(data, [place]), _FLOATS.as_pointer())
    return builder.load(pointer, align=8)


def _store(builder, vector, data, place):
    pointer = builder.bitcast(builder.gep(data, [place]), _FLOATS.as_pointer())
    builder.store(vector, pointer, align=8)
