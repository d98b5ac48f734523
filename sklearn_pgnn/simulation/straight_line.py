"""Assignments on numbers, emitted as LLVM instructions without numba's type inference.

A model's source is a list of assignments ``name = expression`` and ``out[i] = expression`` in which
everything is a ``float64``. There is nothing to infer, and inferring it takes numba ten times as
long as compiling it.
"""

import ast
import math
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache, reduce

from llvmlite import ir

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.external import class_of
from sklearn_pgnn.simulation.outside_calls import OutsideCalls

FLOAT, INT = ir.DoubleType(), ir.IntType(64)
_OPERATIONS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_COMPARISONS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
#: functions that LLVM knows; all others are those of the C library
_INTRINSICS = ("ceil", "cos", "exp", "fabs", "floor", "log", "pow", "sin", "sqrt")
#: whole exponents up to here are multiplied out
_MULTIPLIED = 16


class Assignments:
    """A model's source, one assignment a line, parsed: what its entries are, and what they need.

    >>> lines = Assignments("c = x[0]*t" + chr(10) + "out[0] = 2*c" + chr(10) + "out[1] = 0")
    >>> lines.is_zero(0), lines.is_zero(1), [name for name, _ in lines.needed([0])]
    (False, True, ['c'])
    """

    def __init__(self, text: str):
        self.entries: dict[int, ast.expr] = {}
        self._lines: dict[str, ast.expr] = {}
        for line in map(_parsed, text.splitlines()):
            (target,), value = line.targets, line.value
            if isinstance(target, ast.Name):
                self._lines[target.id] = value
            else:
                self.entries[target.slice.value] = value  # type: ignore[attr-defined]

    @property
    def places(self) -> list[tuple[str, int]]:
        """The array and index of everything that is read."""
        lines = (*self._lines.values(), *self.entries.values())
        nodes = (node for line in lines for node in ast.walk(line))
        read = [node for node in nodes if isinstance(node, ast.Subscript)]
        return [(node.value.id, node.slice.value) for node in read]  # type: ignore[attr-defined]

    def is_zero(self, entry: int) -> bool:
        """Return whether an entry is the constant zero."""
        node = self.entries[entry]
        return isinstance(node, ast.Constant) and node.value == 0

    def needed(self, entries: Iterable[int]) -> list[tuple[str, ast.expr]]:
        """Return the lines that some of the entries need, in their order."""
        names = set().union(*(_names(self.entries[entry]) for entry in entries))
        kept = []
        for name in reversed(self._lines):
            if name in names:
                names |= _names(self._lines[name])
                kept.append((name, self._lines[name]))
        return kept[::-1]


@lru_cache(maxsize=4096)
def _parsed(line: str) -> ast.Assign:
    """Parse a line; most are those of another model."""
    return ast.parse(line).body[0]  # type: ignore[return-value]


def _names(expression: ast.expr) -> set[str]:
    return {node.id for node in ast.walk(expression) if isinstance(node, ast.Name)}


def emit_entries(
    builder: ir.IRBuilder,
    lines: Assignments,
    entries: Sequence[int],
    t,
    read: Callable[[str, int], ir.Value],
) -> list[ir.Value]:
    """Emit entries of a model's source; ``read(array, i)`` returns an array's element."""
    emitter = _Emitter(builder, t, read)
    for name, expression in lines.needed(entries):
        emitter.names[name] = emitter.number(expression)
    return [emitter.number(lines.entries[entry]) for entry in entries]


class _Emitter:
    """Python's syntax tree of numbers, as instructions."""

    def __init__(self, builder, t, read):
        self.builder, self.read = builder, read
        self.names = {"t": t}
        self.outside = OutsideCalls(builder)

    def number(self, node):
        return getattr(self, f"_{type(node).__name__}")(node)

    def _Subscript(self, node):
        return self.read(node.value.id, node.slice.value)

    def _Name(self, node):
        return self.names[node.id]

    def _Constant(self, node):
        return ir.Constant(FLOAT, float(node.value))

    def _Attribute(self, node):
        return ir.Constant(FLOAT, getattr(math, node.attr))

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
        if node.func.id not in ("min", "max"):
            return self._call_outside(node.func.id, values)
        sign = {"min": "<", "max": ">"}[node.func.id]
        return reduce(lambda a, b: self._choose(self._compare(sign, b, a), b, a), values)

    def _call(self, name, values):
        module, kinds = self.builder.module, [FLOAT] * len(values)
        if name in _INTRINSICS:
            known = module.declare_intrinsic(f"llvm.{name}", [FLOAT], ir.FunctionType(FLOAT, kinds))
            return self.builder.call(known, values)
        return self.builder.call(_of_the_c_library(module, name, kinds), values)

    def _call_outside(self, name, values):
        """Call an external function; what it does to the world is not known."""
        made = class_of(name)
        if made is None:
            raise ModelError(f"expected a function that equations can call, got {name!r}.")
        return self.outside.number(made, values)

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


def _of_the_c_library(module, name, kinds):
    """Declare a function that depends on nothing but its arguments."""
    known = module.globals.get(name)
    if known is None:
        known = ir.Function(module, ir.FunctionType(FLOAT, kinds), name)
        known.attributes.add("nounwind")
        known.attributes.add("readnone")
    return known
