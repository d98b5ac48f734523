"""Equations as text: parsed by a whitelist of names and operators, never evaluated as code.

Text is parsed by Python's own ``ast`` and every node is looked up in a small table; anything that
is not in the table (attributes, calls of anything but the functions below, strings, comparisons) is
refused with its line and column.
"""

import ast
import math
import operator
import unicodedata
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import lru_cache
from math import comb, prod
from types import MappingProxyType
from typing import Any, NoReturn

import sympy
from sympy.printing.str import StrPrinter

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.external import External


def maximum(*values: sympy.Expr | float) -> sympy.Expr:
    """Return the largest of some values, without letting SymPy compare them.

    SymPy compares every pair by factoring their difference, which takes most of the time of
    a large equation. Here only equal values, and numbers, are merged.
    """
    return extreme(sympy.Max, values)


def minimum(*values: sympy.Expr | float) -> sympy.Expr:
    """Return the smallest of some values, see `maximum`."""
    return extreme(sympy.Min, values)


def bounded(value: sympy.Expr | float, limit: sympy.Expr | float) -> sympy.Expr:
    """Return a value, kept between minus a limit of at least 0 and the limit.

    >>> bounded(sympy.Symbol("x"), 1)
    Max(-1, Min(1, x))
    """
    return maximum(minimum(value, limit), -limit)


def extreme(kind: type[sympy.Max | sympy.Min], values: Iterable[sympy.Expr | float]) -> sympy.Expr:
    """Return the largest or the smallest of some values."""
    flat = [
        part
        for value in map(sympy.sympify, values)
        for part in (value.args if isinstance(value, kind) else (value,))
    ]
    numbers = [part for part in flat if part.is_comparable]
    others = [part for part in flat if not part.is_comparable]
    if numbers:
        others.append(kind(*numbers))
    return kind(*others, evaluate=False)


#: the functions an equation may use
FUNCTIONS = {
    "abs": sympy.Abs,
    "acos": sympy.acos,
    "asin": sympy.asin,
    "atan": sympy.atan,
    "atan2": sympy.atan2,
    "ceil": sympy.ceiling,
    "cos": sympy.cos,
    "cosh": sympy.cosh,
    "exp": sympy.exp,
    "floor": sympy.floor,
    "log": sympy.log,
    "max": maximum,
    "min": minimum,
    "sign": sympy.sign,
    "sin": sympy.sin,
    "sinh": sympy.sinh,
    "sqrt": sympy.sqrt,
    "tan": sympy.tan,
    "tanh": sympy.tanh,
}
_SEVERAL_ARGUMENTS = {"atan2": (2, 2), "max": (2, 20), "min": (2, 20)}
CONSTANTS = {"pi": sympy.pi}
#: what stands for the rate of a state in an output, as in der(v)
RATE = "der"
_UNARY: dict[type, Callable] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
#: operators of Python that an equation may not use
_OTHER_SIGNS = {
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.BitXor: "^",
    ast.FloorDiv: "//",
    ast.Invert: "~",
    ast.LShift: "<<",
    ast.MatMult: "@",
    ast.Mod: "%",
    ast.Not: "not",
    ast.RShift: ">>",
}
#: operators that follow each other in one sum or one product
_CHAINS: dict[type, Callable] = {
    ast.Add: sympy.Add,
    ast.Sub: sympy.Add,
    ast.Mult: sympy.Mul,
    ast.Div: sympy.Mul,
}
#: longest text and deepest nesting an equation may have
MAX_LENGTH, MAX_DEPTH, MAX_EXPONENT = 10_000, 60, 100
#: longest text of an expression that was derived, such as a rate by a mass matrix
MAX_DERIVED = 200_000
#: most factors with quantities in a product
MAX_FACTORS = 60
#: most bits a whole number may need after it is raised to a power
MAX_BITS = 2048
#: names that an equation may not give to a state, an input or a parameter
RESERVED = frozenset(FUNCTIONS) | frozenset(CONSTANTS) | {"t"}
TIME = sympy.Symbol("t", real=True)


def symbol(name: str) -> sympy.Symbol:
    """Return the real SymPy symbol of a quantity."""
    return sympy.Symbol(name, real=True)


def parse_expression(
    text: str | float,
    names: Collection[str],
    where: str = "expression",
    external: Mapping[str, type[External]] = MappingProxyType({}),
    let: Mapping[str, sympy.Expr] = MappingProxyType({}),
    longest: int = MAX_LENGTH,
) -> sympy.Expr:
    """Turn the text of an equation into a SymPy expression.

    `names` may appear, and ``t`` (time) and ``pi`` always; `external` are further functions
    (`sklearn_pgnn.physics.external`), and `let` names that stand for an expression. `where`
    describes the text in error messages; `longest` is its most characters. The symbols are real.
    """
    text = str(text).strip()
    if len(text) > longest:
        raise ModelError(f"{where}: expected at most {longest} characters, got {len(text)}.")
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        column = getattr(error, "offset", None) or 1
        raise ModelError(
            f"{where}: {_short(text)} is not an arithmetic expression (column {column})."
        ) from None
    try:
        return _Translator(text, names, where, external, let).expression(tree.body)
    except RecursionError:
        raise ModelError(f"{where}: {_short(text)} is nested too deeply.") from None


def standard_form(
    expression: sympy.Expr, names: tuple[str, ...], where: str = "expression"
) -> sympy.Expr:
    """Return the form that parsing an expression's own text yields: equal texts, equal forms."""
    known, held = _by_same_name(names), _held(expression)
    own = tuple(known[name] for name in held if name in known)
    return _reread(expression, own if len(own) == len(held) else names, where)


@lru_cache(maxsize=128)
def _by_same_name(names: tuple[str, ...]) -> dict[str, str]:
    return {same_name(name): name for name in names}


@lru_cache(maxsize=16384)
def _held(expression: sympy.Expr) -> tuple[str, ...]:
    """Return the names in an expression: SymPy walks through it for them."""
    return tuple(sorted(same_name(each.name) for each in expression.free_symbols - {TIME}))


@lru_cache(maxsize=16384)
def _reread(expression: sympy.Expr, names: tuple[str, ...], where: str) -> sympy.Expr:
    external = {call.func.__name__: call.func for call in expression.atoms(External)}
    text = _RereadPrinter().doprint(expression)
    return parse_expression(text, names, where, external, longest=MAX_DERIVED)


def same_name(name: str) -> str:
    """Return a name in the normal form of Python's parser: both characters for mu become one."""
    return unicodedata.normalize("NFKC", name)


def _short(text: str) -> str:
    """Quote a text, truncated if it is long."""
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


def _as_reread(expression: sympy.Expr) -> sympy.Expr:
    """Normalise an expression so that its text reads back to the same expression.

    SymPy may keep more digits than a float has, and a Max(0, 1) inside a Min.
    """
    exact = {x: sympy.Float(float(x)) for x in expression.atoms(sympy.Float)}
    expression = expression.xreplace(exact)
    if not expression.has(sympy.Max, sympy.Min):
        return expression
    return expression.replace(
        lambda part: isinstance(part, sympy.Max | sympy.Min),
        lambda part: extreme(part.func, part.args),
    )


def _about_operator(operation: ast.operator) -> str:
    """Return why an operator between two values is refused, in the user's notation."""
    sign = _OTHER_SIGNS[type(operation)]
    if sign == "^":
        return "'^' is no operator here; use ** for a power, as in x**2"
    return f"operator {sign!r} is not allowed; use + - * / **"


def _tower(expression: sympy.Expr) -> float:
    """Return the largest product of the exponents of powers that contain each other."""
    if expression.is_Atom:
        return 1.0
    if isinstance(expression, sympy.Pow) and expression.exp.is_number:
        return max(1.0, abs(float(expression.exp)) * _tower(expression.base))
    return max(map(_tower, expression.args))


class _Translator:
    """Walk the syntax tree and build the expression node by node."""

    def __init__(
        self,
        text: str,
        names: Collection[str],
        where: str,
        external: Mapping[str, type[External]],
        let: Mapping[str, sympy.Expr],
    ):
        self.text, self.let, self.room = text, dict(let), MAX_LENGTH
        self.functions: dict[str, Callable] = {**FUNCTIONS, **dict(external)}
        self.names = {same_name(name): name for name in names}
        self.where = where

    def expression(self, node: ast.expr) -> sympy.Expr:
        """Translate a whole equation."""
        expression = self.translate(node, 0)
        if expression.has(sympy.zoo, sympy.nan, sympy.oo, -sympy.oo, sympy.I):
            self.refuse(node, f"{self.quote(node)} has no finite real value")
        for power in expression.atoms(sympy.Pow):
            self.check_exponent(node, power.exp)
        for number in expression.atoms(sympy.Number):
            self.check_number(node, number)
        return _as_reread(expression)

    def refuse(self, node: ast.expr, why: str) -> NoReturn:
        line = self.text.encode().splitlines()[node.lineno - 1]
        column = len(line[: node.col_offset].decode()) + 1
        raise ModelError(f"{self.where}: {why} (column {column}).")

    def quote(self, node: ast.expr) -> str:
        return _short(ast.get_source_segment(self.text, node) or "")

    def translate(self, node: ast.expr, depth: int) -> sympy.Expr:
        if depth > MAX_DEPTH:
            self.refuse(node, f"expected at most {MAX_DEPTH} nested operations")
        ways: dict[type, Callable[..., sympy.Expr]] = {
            ast.BinOp: self.binary,
            ast.UnaryOp: self.unary,
            ast.Call: self.call,
            ast.Name: self.name,
            ast.Constant: self.number,
        }
        translate = ways.get(type(node))
        if translate is None:
            self.refuse(
                node,
                f"{self.quote(node)} is not allowed; use numbers, names, + - * / ** and "
                f"{', '.join(sorted(FUNCTIONS))}",
            )
        value = translate(node, depth + 1)
        self.check_number(node, value)
        return value

    def check_number(self, node: ast.expr, value: sympy.Expr) -> None:
        """Refuse numbers that a float cannot hold; the check at every node keeps them small."""
        number = value if value.is_number else value.as_coeff_Mul()[0]
        try:
            size = abs(float(number))
        except (TypeError, OverflowError):
            size = math.nan
        if not math.isfinite(size) or (size == 0 and not number.is_zero):
            self.refuse(node, f"{self.quote(node)} has no finite real value")

    def check_exponent(self, node: ast.expr, exponent: sympy.Expr) -> None:
        if exponent.is_number and abs(float(exponent)) > MAX_EXPONENT:
            self.refuse(node, f"expected an exponent of at most {MAX_EXPONENT}, got {exponent}")

    def binary(self, node: ast.BinOp, depth: int) -> sympy.Expr:
        if type(node.op) in _CHAINS:
            return self.chain(node, depth)
        if not isinstance(node.op, ast.Pow):
            self.refuse(node.right, _about_operator(node.op))
        base, exponent = self.translate(node.left, depth), self.translate(node.right, depth)
        self.check_power(node, base, exponent)
        return base**exponent

    def chain(self, node: ast.BinOp, depth: int) -> sympy.Expr:
        """Translate a chain such as a + b - c at once, so that a long sum is not nested deeply.

        A product of many factors is also kept as written; SymPy would expand 2*(a + b).
        """
        together = _CHAINS[type(node.op)]
        links: list[Any] = [node]
        while _CHAINS.get(type(getattr(links[-1].left, "op", None))) is together:
            links.append(links[-1].left)
        first, operands = links[-1].left, []
        while together is sympy.Mul and isinstance(getattr(first, "op", None), ast.USub):
            first = first.operand
            operands.append(sympy.Integer(-1))
        operands.append(self.translate(first, depth))
        operands += [self.operand(link, depth) for link in reversed(links)]
        factors = sum(bool(each.free_symbols) for each in operands)
        if together is sympy.Mul and factors > MAX_FACTORS:  # derivatives grow with their square
            self.refuse(node, f"expected at most {MAX_FACTORS} factors, got {factors}")
        return together(*operands)

    def operand(self, link: ast.BinOp, depth: int) -> sympy.Expr:
        """Return the operand that a link adds to a sum or multiplies into a product."""
        value = self.translate(link.right, depth)
        if isinstance(link.op, ast.Sub):
            return -value
        if not isinstance(link.op, ast.Div):
            return value
        if value.is_zero:
            self.refuse(link, "division by zero")
        return 1 / value

    def check_power(self, node: ast.expr, base: sympy.Expr, exponent: sympy.Expr) -> None:
        """Refuse a power before it is taken: SymPy raises whole numbers digit by digit."""
        self.check_exponent(node, exponent)
        together = _tower(base) * abs(float(exponent)) if exponent.is_number else 0.0
        if together > MAX_EXPONENT:
            self.refuse(
                node,
                f"expected an exponent of at most {MAX_EXPONENT}, got {together:g}",
            )
        number = base.as_coeff_Mul()[0]
        if number.is_Rational and exponent.is_number:
            bits = max(int(number.p).bit_length(), int(number.q).bit_length())
            if bits * abs(float(exponent)) > MAX_BITS:
                self.refuse(node, f"{self.quote(node)} has no finite real value")

    def unary(self, node: ast.UnaryOp, depth: int) -> sympy.Expr:
        operation = _UNARY.get(type(node.op))
        if operation is None:
            sign = _OTHER_SIGNS[type(node.op)]
            self.refuse(node, f"operator {sign!r} is not allowed; use + or -")
        return operation(self.translate(node.operand, depth))

    def call(self, node: ast.Call, depth: int) -> sympy.Expr:
        name = node.func.id if isinstance(node.func, ast.Name) else None
        if name == RATE:
            return self.rate(node)
        if name not in self.functions or node.keywords:
            self.refuse(
                node,
                f"{self.quote(node.func)} is not one of the functions "
                f"{', '.join(sorted(FUNCTIONS))}",
            )
        low, high = self.numbers_of_arguments(name)
        if not low <= len(node.args) <= high:
            wanted = str(low) if low == high else f"{low} to {high}"
            self.refuse(node, f"{name} takes {wanted} argument(s), got {len(node.args)}")
        return self.functions[name](*(self.translate(argument, depth) for argument in node.args))

    def numbers_of_arguments(self, name: str) -> tuple[int, int]:
        """Return the least and the largest number of arguments of a function."""
        if name in FUNCTIONS:
            return _SEVERAL_ARGUMENTS.get(name, (1, 1))
        count = len(self.functions[name].places)  # type: ignore[attr-defined]
        return count, count

    def name(self, node: ast.Name, depth: int) -> sympy.Expr:
        if node.id in CONSTANTS:
            return CONSTANTS[node.id]
        if node.id == "t":
            return TIME
        if node.id in self.let:
            return self.written_out(node, node.id)
        if node.id not in self.names:
            known = (
                ", ".join(sorted(filter(str.isidentifier, {*self.names.values(), *self.let})))
                or "none"
            )
            self.refuse(node, f"unknown name {node.id!r}; known names are {known}")
        return symbol(self.names[node.id])

    def rate(self, node: ast.Call) -> sympy.Expr:
        """Return the rate of a state, written der(v)."""
        name = ast.unparse(node) if len(node.args) == 1 and not node.keywords else ""
        if name not in self.let:
            self.refuse(
                node, f"{self.quote(node)} is not the rate of a state; only an output may have one"
            )
        return self.written_out(node, name)

    def written_out(self, node: ast.expr, name: str) -> sympy.Expr:
        """Return what a name stands for; names in names in names may stand for a lot."""
        self.room -= sum(1 for _ in sympy.preorder_traversal(self.let[name]))
        if self.room < 0:
            self.refuse(node, f"expected at most {MAX_LENGTH} operands when written out, got more")
        return self.let[name]

    def number(self, node: ast.Constant, depth: int) -> sympy.Expr:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            self.refuse(node, f"{self.quote(node)} is not a number")
        if isinstance(node.value, int):
            return sympy.Integer(node.value)
        return sympy.Float(node.value)


class _TextPrinter(StrPrinter):
    """SymPy's text, with the names of `FUNCTIONS` and every digit of a float."""

    def _print_Float(self, expr: sympy.Float) -> str:
        return repr(float(expr))

    def _print_Function(self, expr: sympy.Expr) -> str:
        names = {function: name for name, function in FUNCTIONS.items()}
        name = names.get(expr.func, expr.func.__name__)
        return f"{name}({', '.join(map(self._print, expr.args))})"

    def _print_Abs(self, expr: sympy.Abs) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_LatticeOp(self, expr: sympy.Expr) -> str:
        arguments = sorted(expr.args, key=sympy.default_sort_key)
        return f"{type(expr).__name__.lower()}({', '.join(map(self._print, arguments))})"

    def _print_ExpBase(self, expr: sympy.exp) -> str:
        return f"exp({self._print(expr.exp)})"

    def _print_Exp1(self, expr: sympy.Expr) -> str:
        return "exp(1)"


class _RereadPrinter(_TextPrinter):
    """The text in which a call of an external function has a name that can be read back."""

    printmethod = "_pythoncode"


def to_text(expression: sympy.Basic) -> str:
    """Write an expression as text that `parse_expression` reads back to the same value.

    A call of an external function, which has no equation, is written for display only.

    Floats carry every digit.
    """
    return _TextPrinter().doprint(expression)


# -- multiplied out, where that does not take a lot of memory and time -----------------------------


#: most terms that an expression may have when it is multiplied out
MAX_TERMS = 2000


def expanded(expression: sympy.Expr, **hints: bool) -> sympy.Expr:
    """Return `sympy.expand` of an expression; the expression itself beyond `MAX_TERMS` terms."""
    return sympy.expand(expression, **hints) if _work(expression) <= MAX_TERMS else expression


def _work(expression: sympy.Expr) -> int:
    """Return a bound of all terms that are written when an expression is multiplied out."""
    inside = sum(_work(each) for each in expression.args if not each.is_Atom)
    return max(_terms(expression), inside)


def _terms(expression: sympy.Expr) -> int:
    r"""Return a bound of the terms: :math:`\binom{n + k - 1}{n}` of the n-th power of k terms."""
    if expression.is_Add:
        return sum(map(_terms, expression.args))
    if expression.is_Mul:
        return prod(map(_terms, expression.args))
    if expression.is_Pow and expression.exp.is_number:
        power, terms = int(abs(expression.exp)), _terms(expression.base)
        return comb(power + terms - 1, power) if terms <= MAX_TERMS else terms
    return 1
