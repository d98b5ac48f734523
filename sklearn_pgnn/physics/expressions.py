"""Equations as text: parsed by a whitelist of names and operators, never evaluated as code.

Text goes through Python's own ``ast`` and every node is looked up in a small table; whatever is
not in the table (attributes, calls of anything but the functions below, strings, comparisons) is
refused with its line and column.
"""

import ast
import operator
from collections.abc import Collection

import sympy
from sympy.printing.str import StrPrinter

from sklearn_pgnn.exceptions import ModelError

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
    "max": sympy.Max,
    "min": sympy.Min,
    "sign": sympy.sign,
    "sin": sympy.sin,
    "sinh": sympy.sinh,
    "sqrt": sympy.sqrt,
    "tan": sympy.tan,
    "tanh": sympy.tanh,
}
_SEVERAL_ARGUMENTS = {"atan2": (2, 2), "max": (2, 20), "min": (2, 20)}
CONSTANTS = {"pi": sympy.pi}
_BINARY = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY = {ast.UAdd: operator.pos, ast.USub: operator.neg}
#: longest text and deepest nesting an equation may have
MAX_LENGTH, MAX_DEPTH, MAX_EXPONENT = 10_000, 60, 100
#: names that an equation may not give to a state, an input or a parameter
RESERVED = frozenset(FUNCTIONS) | frozenset(CONSTANTS) | {"t"}
TIME = sympy.Symbol("t", real=True)


def symbol(name: str) -> sympy.Symbol:
    """Give the real SymPy symbol of a quantity."""
    return sympy.Symbol(name, real=True)


def parse_expression(text: str | float, names: Collection[str], where: str = "expression"):
    """Turn the text of an equation into a SymPy expression.

    Parameters
    ----------
    text : str or number
        The right-hand side, e.g. ``"(-m*g*a*sin(phi) - d*omega + 4*torque)/J"``.
    names : collection of str
        The states, inputs and parameters that may appear; ``t`` (time) and ``pi`` always may.
    where : str
        What is parsed, for the error's text.

    Returns
    -------
    sympy.Expr
        The expression over real symbols.

    Raises
    ------
    ModelError
        If the text is no arithmetic expression or holds a name or a construct that is not
        allowed.

    Examples
    --------
    >>> parse_expression("-k*x/m", ["k", "x", "m"])
    -k*x/m
    """
    text = str(text)
    if len(text) > MAX_LENGTH:
        raise ModelError(f"{where}: expected at most {MAX_LENGTH} characters, got {len(text)}.")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        column = getattr(error, "offset", None) or 1
        raise ModelError(
            f"{where}: {text!r} is not an arithmetic expression (column {column})."
        ) from None
    expression = _Translator(frozenset(names), where).translate(tree.body, 0)
    if expression.has(sympy.zoo, sympy.nan, sympy.oo, -sympy.oo, sympy.I):
        raise ModelError(f"{where}: {text!r} has no finite real value ({expression}).")
    return expression


class _Translator:
    """Walk the syntax tree and build the expression node by node."""

    def __init__(self, names: frozenset[str], where: str):
        self.names = names
        self.where = where

    def refuse(self, node: ast.AST, why: str):
        column = getattr(node, "col_offset", 0) + 1
        raise ModelError(f"{self.where}: {why} (column {column}).")

    def translate(self, node: ast.AST, depth: int):
        if depth > MAX_DEPTH:
            self.refuse(node, f"expected at most {MAX_DEPTH} nested operations")
        translate = {
            ast.BinOp: self.binary,
            ast.UnaryOp: self.unary,
            ast.Call: self.call,
            ast.Name: self.name,
            ast.Constant: self.number,
        }.get(type(node))
        if translate is None:
            self.refuse(
                node,
                f"{ast.unparse(node)!r} is not allowed; use numbers, names, + - * / ** and "
                f"{', '.join(sorted(FUNCTIONS))}",
            )
        return translate(node, depth + 1)

    def binary(self, node, depth):
        operation = _BINARY.get(type(node.op))
        if operation is None:
            self.refuse(node, f"operator {type(node.op).__name__} is not allowed; use + - * / **")
        left, right = self.translate(node.left, depth), self.translate(node.right, depth)
        if operation is operator.pow and right.is_number and abs(right) > MAX_EXPONENT:
            self.refuse(node, f"expected an exponent of at most {MAX_EXPONENT}, got {right}")
        if operation is operator.truediv and right.is_zero:
            self.refuse(node, "division by zero")
        return operation(left, right)

    def unary(self, node, depth):
        operation = _UNARY.get(type(node.op))
        if operation is None:
            self.refuse(node, f"operator {type(node.op).__name__} is not allowed; use + or -")
        return operation(self.translate(node.operand, depth))

    def call(self, node, depth):
        name = node.func.id if isinstance(node.func, ast.Name) else None
        if name not in FUNCTIONS or node.keywords:
            self.refuse(
                node,
                f"{ast.unparse(node.func)!r} is not one of the functions "
                f"{', '.join(sorted(FUNCTIONS))}",
            )
        low, high = _SEVERAL_ARGUMENTS.get(name, (1, 1))
        if not low <= len(node.args) <= high:
            self.refuse(node, f"{name} takes {low} argument(s), got {len(node.args)}")
        return FUNCTIONS[name](*(self.translate(argument, depth) for argument in node.args))

    def name(self, node, depth):
        if node.id in CONSTANTS:
            return CONSTANTS[node.id]
        if node.id == "t":
            return TIME
        if node.id not in self.names:
            known = ", ".join(sorted(self.names)) or "none"
            self.refuse(node, f"unknown name {node.id!r}; known names are {known}")
        return symbol(node.id)

    def number(self, node, depth):
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            self.refuse(node, f"{node.value!r} is not a number")
        if isinstance(node.value, int) and abs(node.value) < 2**53:
            return sympy.Integer(node.value)
        return sympy.Float(float(node.value))


class _TextPrinter(StrPrinter):
    """SymPy's text, with the names of `FUNCTIONS` and every digit of a float."""

    def _print_Float(self, expr):
        return repr(float(expr))

    def _print_Function(self, expr):
        names = {function: name for name, function in FUNCTIONS.items()}
        name = names.get(expr.func, expr.func.__name__)
        return f"{name}({', '.join(map(self._print, expr.args))})"

    def _print_Abs(self, expr):
        return f"abs({self._print(expr.args[0])})"

    def _print_LatticeOp(self, expr):
        arguments = sorted(expr.args, key=sympy.default_sort_key)
        return f"{type(expr).__name__.lower()}({', '.join(map(self._print, arguments))})"

    def _print_ExpBase(self, expr):
        return f"exp({self._print(expr.exp)})"


def to_text(expression) -> str:
    """Write an expression as text that `parse_expression` reads back to the same value.

    Parameters
    ----------
    expression : sympy.Expr
        The expression.

    Returns
    -------
    str
        Its text; floats carry every digit.

    Examples
    --------
    >>> to_text(parse_expression("0.1*abs(x)", ["x"]))
    '0.1*abs(x)'
    """
    return _TextPrinter().doprint(expression)
