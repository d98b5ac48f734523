"""Expressions in C99, every operation in its order and one precision, and names in it."""

import ast
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import reduce

from sklearn_pgnn.exceptions import ModelError

#: precedence of operators
_OPERATIONS = {ast.Add: ("+", 1), ast.Sub: ("-", 1), ast.Mult: ("*", 2), ast.Div: ("/", 2)}
_COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
_UNARY, _ATOM = 3, 4
#: functions of ``math.h`` that an equation may need
_FUNCTIONS = "acos asin atan atan2 ceil cos cosh exp fabs floor log pow sin sinh sqrt tan tanh"
FUNCTIONS = frozenset(_FUNCTIONS.split())
#: integer exponents up to here are written as products, as in the simulation
MULTIPLIED = 16
PI, E = "3.141592653589793", "2.718281828459045"


@dataclass
class CPrinter:
    """Write expressions in C, and collect the powers and extremes whose helpers they call."""

    single: bool = False
    prefix: str = ""
    powers: set[int] = field(default_factory=set)
    extremes: set[str] = field(default_factory=set)

    def number(self, value: float) -> str:
        """Return a number's literal, with every digit that the precision holds.

        >>> CPrinter().number(2), CPrinter(single=True).number(0.1)
        ('2.0', '0.1f')
        """
        if self.single and value != 0 and not 1.2e-38 < abs(value) < 3.4e38:
            raise ModelError(
                f"to_c: {value:g} cannot be held by a float. Remedy: precision='double'."
            )
        return repr(float(value)) + ("f" if self.single else "")

    def write(self, expression: ast.expr, names: Mapping[str, str]) -> str:
        """Return an expression in C.

        >>> text = "-a*math.exp(-b**2) - (c - 1)"
        >>> CPrinter().write(ast.parse(text, mode="eval").body, {"a": "level"})
        '-level*exp(-power_2(b)) - (c - 1.0)'
        """
        return self._written(expression, names, 0)

    def all_powers(self) -> list[int]:
        """Return the helpers ``power_n`` that are needed, each after those it calls."""
        found = set(self.powers)
        for power in sorted(self.powers, reverse=True):
            while power > 3:
                power //= 2
                found.add(power)
        return sorted(found - {1})

    def _written(self, node, names, least: int) -> str:
        """Write a node, in parentheses if its precedence is lower than required."""
        text, binds = getattr(self, f"_{type(node).__name__}", self._refused)(node, names)
        return text if binds >= least else f"({text})"

    def _refused(self, node, names):
        raise ModelError(
            f"to_c: {ast.unparse(node)!r} has no form in C. Remedy: write the equation with "
            f"+ - * / ** and {', '.join(sorted(FUNCTIONS))}."
        )

    def _Name(self, node, names):
        return names.get(node.id, node.id), _ATOM

    def _Constant(self, node, names):
        return self.number(node.value), _ATOM

    def _Attribute(self, node, names):
        return {"pi": PI, "e": E}[node.attr] + ("f" if self.single else ""), _ATOM

    def _UnaryOp(self, node, names):
        sign = "-" if isinstance(node.op, ast.USub) else ""
        return sign + self._written(node.operand, names, _ATOM), _UNARY

    def _BinOp(self, node, names):
        if isinstance(node.op, ast.Pow):
            return self._power(node.left, node.right, names), _ATOM
        if type(node.op) not in _OPERATIONS:
            return self._refused(node, names)
        sign, binds = _OPERATIONS[type(node.op)]
        left = self._written(node.left, names, binds)
        right = self._written(node.right, names, binds + 1)
        return (f"{left} {sign} {right}" if binds == 1 else f"{left}{sign}{right}"), binds

    def _power(self, base, exponent, names):
        power = getattr(exponent, "value", None)
        if power == 1:
            return self._written(base, names, _ATOM)
        if power in range(2, MULTIPLIED + 1):
            self.powers.add(int(power))
            return f"{self.prefix}power_{int(power)}({self.write(base, names)})"
        return self._called("pow", [base, exponent], names)

    def _Call(self, node, names):
        if isinstance(node.func, ast.Attribute):
            return self._called(node.func.attr, node.args, names), _ATOM
        name = node.func.id
        if name == "abs":
            return self._called("fabs", node.args, names), _ATOM
        if name not in ("min", "max"):
            return self._refused(node, names)
        helper = {"min": "smaller", "max": "larger"}[name]
        self.extremes.add(helper)
        written = (self.write(argument, names) for argument in node.args)
        return reduce(lambda a, b: f"{self.prefix}{helper}({a}, {b})", written), _ATOM

    def _called(self, name: str, arguments: Iterable, names) -> str:
        if name not in FUNCTIONS:
            raise ModelError(f"to_c: the function {name} has no form in C.")
        written = ", ".join(self.write(argument, names) for argument in arguments)
        return f"{name}{'f' if self.single else ''}({written})"

    def _IfExp(self, node, names):
        parts = (self._written(part, names, 1) for part in (node.test, node.body, node.orelse))
        return "({} ? {} : {})".format(*parts), _ATOM

    def _Compare(self, node, names):
        (kind,), (right,) = node.ops, node.comparators
        if type(kind) not in _COMPARISONS:
            return self._refused(node, names)
        left, right = (self._written(part, names, 1) for part in (node.left, right))
        return f"{left} {_COMPARISONS[type(kind)]} {right}", 1


# -- names -----------------------------------------------------------------------------------------

_KEYWORDS = (
    "auto break case char const continue default do double else enum extern float for goto if "
    "inline int long register restrict return short signed sizeof static struct switch typedef "
    "union unsigned void volatile while _Bool"
)
#: names used by the code itself, and names that ``math.h`` may define
_TAKEN = "asm out p side t u x INFINITY NAN HUGE_VAL math_errhandling"
RESERVED = frozenset({*_KEYWORDS.split(), *_TAKEN.split(), *FUNCTIONS}) | {
    f"{f}f" for f in FUNCTIONS
}


def c_name(text: str) -> str:
    """Return a text as an identifier of C99.

    >>> c_name("golf robot"), c_name("μ"), c_name("2 tanks")
    ('golf_robot', 'u03bc', 'm2_tanks')
    """
    name = "".join(map(_letter, text.strip())) or "model"
    return f"m{name}" if name[0].isdigit() else name


def c_names(texts: Iterable[str], taken: Collection[str] = RESERVED) -> dict[str, str]:
    """Return a unique identifier for every text, none of them taken.

    >>> c_names(["x", "x_", "phi", "c0", "double"])
    {'x': 'x_', 'x_': 'x__', 'phi': 'phi', 'c0': 'c0_', 'double': 'double_'}
    """
    found: dict[str, str] = {}
    for text in texts:
        name = c_name(text)
        # c and digits are shared expressions in the code
        while name in taken or name in found.values() or (name[0] == "c" and name[1:].isdigit()):
            name += "_"
        found[text] = name
    return found


def _letter(c: str) -> str:
    if c.isascii() and (c.isalnum() or c == "_"):
        return c
    return f"u{ord(c):04x}" if c.isalnum() else "_"
