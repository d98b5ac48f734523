"""Straight-line code on numbers, compiled without numba's type inference.

A model's function is a list of assignments ``name = expression`` and ``out[i] = expression`` in
which everything is a ``float64``. There is nothing to infer, and inferring it takes numba ten times
as long as compiling it: the assignments are emitted here as LLVM instructions, inside one call that
numba compiles.
"""

import ast
import math
from functools import reduce

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_FLOAT, _INT = ir.DoubleType(), ir.IntType(64)
_NUMBER = types.float64
_OPERATIONS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_COMPARISONS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
#: whole exponents up to here are multiplied out
_MULTIPLIED = 16


def straight_line(text: str):
    """Return a function that numba compiles from assignments on numbers.

    Parameters
    ----------
    text : str
        Assignments, one a line, to names or to ``out[i]``; they read ``t``, names that stand
        before, and ``x[i]``, ``u[i]``, ``p[i]``, ``s[i]``.

    Returns
    -------
    numba intrinsic
        A function of ``(t, x, u, p, s, out)``, to be called in compiled code.

    Examples
    --------
    >>> import numpy as np
    >>> from numba import njit
    >>> square = straight_line("c = x[0]*t" + chr(10) + "out[0] = math.sin(c)**2")
    >>> @njit
    ... def run(t, x, out):
    ...     square(t, x, x, x, x, out)
    >>> out = np.zeros(1)
    >>> run(2.0, np.ones(1), out)
    >>> out.round(4)
    array([0.8268])
    """
    lines = ast.parse(text).body

    @intrinsic
    def emitted(context, t, x, u, p, s, out):
        def generate(context, builder, signature, values):
            arrays = {
                name: data_of(context, builder, kind, value)
                for name, kind, value in zip("xupso", signature.args[1:], values[1:], strict=True)
            }
            emitter = _Emitter(context, builder, {"t": values[0]}, arrays)
            for line in lines:
                emitter.assign(line)
            return context.get_dummy_value()

        return types.void(t, x, u, p, s, out), generate

    return emitted


def data_of(context, builder, kind, value):
    """Return the LLVM pointer to the numbers of an array; a pointer is one already."""
    if isinstance(kind, types.CPointer):
        return value
    return context.make_array(kind)(context, builder, value).data


class _Emitter:
    """Python's syntax tree of numbers, as instructions."""

    def __init__(self, context, builder, names, arrays):
        self.context, self.builder = context, builder
        self.names, self.arrays = names, arrays

    def assign(self, line):
        (target,), value = line.targets, self.number(line.value)
        if isinstance(target, ast.Name):
            self.names[target.id] = value
        else:
            self.builder.store(value, self._place(target))

    def number(self, node):
        return getattr(self, f"_{type(node).__name__}")(node)

    def _place(self, node):
        return self.builder.gep(
            self.arrays[node.value.id[0]], [ir.Constant(_INT, node.slice.value)]
        )

    def _Subscript(self, node):
        return self.builder.load(self._place(node))

    def _Name(self, node):
        return self.names[node.id]

    def _Constant(self, node):
        return ir.Constant(_FLOAT, float(node.value))

    def _Attribute(self, node):
        return ir.Constant(_FLOAT, getattr(math, node.attr))

    def _UnaryOp(self, node):
        value = self.number(node.operand)
        return self.builder.fneg(value) if isinstance(node.op, ast.USub) else value

    def _BinOp(self, node):
        if isinstance(node.op, ast.Pow):
            return self._power(self.number(node.left), node.right)
        left, right = self.number(node.left), self.number(node.right)
        if isinstance(node.op, ast.Mod):
            whole = self._call("floor", [self.builder.fdiv(left, right)])
            return self.builder.fsub(left, self.builder.fmul(right, whole))
        return getattr(self.builder, _OPERATIONS[type(node.op)])(left, right)

    def _power(self, base, exponent):
        if isinstance(exponent, ast.Constant) and exponent.value in range(1, _MULTIPLIED + 1):
            return self._multiplied(base, int(exponent.value))
        return self._call("pow", [base, self.number(exponent)])

    def _multiplied(self, base, exponent):
        if exponent == 1:
            return base
        half = self._multiplied(base, exponent // 2)
        square = self.builder.fmul(half, half)
        return self.builder.fmul(square, base) if exponent % 2 else square

    def _Call(self, node):
        values = [self.number(value) for value in node.args]
        if isinstance(node.func, ast.Attribute):
            return self._call(node.func.attr, values)
        if node.func.id == "abs":
            return self._call("fabs", values)
        sign = {"min": "<", "max": ">"}[node.func.id]
        return reduce(lambda a, b: self._choose(self._compare(sign, b, a), b, a), values)

    def _call(self, name, values):
        if name in ("floor", "ceil", "fabs"):
            function = self.builder.module.declare_intrinsic(f"llvm.{name}", [_FLOAT])
            return self.builder.call(function, values)
        signature = _NUMBER(*[_NUMBER] * len(values))
        return self.context.get_function(getattr(math, name), signature)(self.builder, values)

    def _IfExp(self, node):
        return self._choose(
            self._condition(node.test), self.number(node.body), self.number(node.orelse)
        )

    def _choose(self, condition, value, other):
        return self.builder.select(condition, value, other)

    def _condition(self, node):
        if isinstance(node, ast.BoolOp):
            join = self.builder.and_ if isinstance(node.op, ast.And) else self.builder.or_
            return reduce(join, map(self._condition, node.values))
        if isinstance(node, ast.UnaryOp):
            return self.builder.not_(self._condition(node.operand))
        if isinstance(node, ast.Constant):
            return ir.Constant(ir.IntType(1), bool(node.value))
        (kind,), (right,) = node.ops, node.comparators
        return self._compare(_COMPARISONS[type(kind)], self.number(node.left), self.number(right))

    def _compare(self, sign, left, right):
        kind = self.builder.fcmp_unordered if sign == "!=" else self.builder.fcmp_ordered
        return kind(sign, left, right)
