"""Equations before and after, as MathML and as text, with the numbers of their symbols."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import PRECEDENCE

from sklearn_pgnn.inspection.numbers import number, typeset_unit
from sklearn_pgnn.physics.expressions import TIME, expanded, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel

#: digits of a number in an equation; as text it has all
DIGITS = 6
#: beyond so many operations an equation is shown as text only
MAX_OPERATIONS = 400
#: characters, as text, beyond which a sum may be broken between its terms
LINE = 60
#: characters, as text, that fit a printed page; what is longer and cannot be broken gets smaller
PAGE = 80
_MINUS, _DOT = "<mo>&#x2212;</mo>", "<mo>&#xB7;</mo>"
_OPEN, _CLOSE = '<mo stretchy="false">(</mo>', '<mo stretchy="false">)</mo>'
_ELSE = "<mtext>else</mtext>"
_RATE = '<mo stretchy="false" class="rate">&#x2D9;</mo>'


def cases_of(expression: sympy.Expr, moving) -> list[tuple[sympy.Expr, sympy.Expr]]:
    """Return values and conditions, the last one true, of an expression with cases of one kind."""
    return _by_sign(expression) or _by_dead_zone(expression) or _by_limits(expression, set(moving))


def _by_sign(expression):
    """Return the cases of a direction of motion."""
    about = {part.args[0] for part in expression.atoms(sympy.sign)}
    if len(about) != 1 or expression.has(sympy.Max, sympy.Min):
        return []
    (of,) = about
    cases = []
    for sign, condition in ((1, of > 0), (-1, of < 0)):
        value = expression.subs({sympy.sign(of): sign, sympy.Abs(of): sign * of})
        cases.append((expanded(value), condition))
    return cases


def _by_dead_zone(expression):
    """Return the cases of what acts above one end and below another."""
    above = [part for part in expression.atoms(sympy.Max) if sympy.S.Zero in part.args]
    below = [part for part in expression.atoms(sympy.Min) if sympy.S.Zero in part.args]
    if len(above) != 1 or len(below) != 1 or len(expression.atoms(sympy.Max, sympy.Min)) != 2:
        return []
    (top,), (bottom,) = above, below
    over, under = _other(top, sympy.S.Zero), _other(bottom, sympy.S.Zero)
    return [
        (expression.xreplace({top: over, bottom: sympy.S.Zero}), over > 0),
        (expression.xreplace({top: sympy.S.Zero, bottom: under}), under < 0),
        (expression.xreplace({top: sympy.S.Zero, bottom: sympy.S.Zero}), sympy.true),
    ]


def _by_limits(expression, moving):
    """Return the cases of what stays between two ends."""
    parts = expression.atoms(sympy.Max, sympy.Min)
    outer = [part for part in parts if _inner(part) is not None]
    if len(outer) != 1 or len(parts) != 2:
        return []
    (whole,), inner = outer, _inner(outer[0])
    end = _other(whole, inner)
    free = [arg for arg in inner.args if arg.free_symbols & moving]
    if len(free) != 1:
        return []
    (value,), other = free, _other(inner, free[0])
    low, high = (end, other) if isinstance(whole, sympy.Max) else (other, end)
    return [
        (expression.xreplace({whole: high}), value > high),
        (expression.xreplace({whole: low}), value < low),
        (expression.xreplace({whole: value}), sympy.true),
    ]


def _other(part, one):
    """Return the other argument of two."""
    return next(arg for arg in part.args if arg != one)


def _inner(part):
    """Return the limit inside a limit of the other kind; None where there is none."""
    kind = sympy.Min if isinstance(part, sympy.Max) else sympy.Max
    found = [arg for arg in part.args if isinstance(arg, kind)]
    return found[0] if len(found) == 1 and len(part.args) == 2 == len(found[0].args) else None


class Printer(MathMLPresentationPrinter):
    """Prints products with numbers and constants before what is `moving`, such as states."""

    def __init__(self, moving: Collection[sympy.Symbol] = ()):
        super().__init__({"mul_symbol": "dot"})
        self.moving = set(moving)

    def _print_Mul(self, expr):
        row = self.dom.createElement("mrow")
        if expr.could_extract_minus_sign():
            row.appendChild(self._operator("-"))
            expr = -expr
        above, below = sympy.fraction(expr)
        if below != 1:
            fraction = self.dom.createElement("mfrac")
            fraction.appendChild(self._print(above))
            fraction.appendChild(self._print(below))
            row.appendChild(fraction)
            return row
        if not expr.is_Mul:
            row.appendChild(self._print(expr))
            return row
        factors = sorted(expr.as_ordered_factors(), key=self._rank)
        for place, factor in enumerate(factors):
            if place:
                row.appendChild(self._operator("\u00b7"))
            row.appendChild(self.parenthesize(factor, PRECEDENCE["Mul"]))
        return row

    def _print_Float(self, expr):
        if not 1e-4 <= abs(expr) < 1e6:
            return super()._print_Float(expr)
        written = self.dom.createElement("mn")
        written.appendChild(self.dom.createTextNode(number(float(expr), DIGITS)))
        return written

    def _rank(self, factor) -> int:
        if factor.is_number or not self.moving:
            return 0
        return 2 if factor.free_symbols & self.moving else 1

    def _operator(self, sign: str):
        operator = self.dom.createElement("mo")
        operator.appendChild(self.dom.createTextNode(sign))
        return operator


def mathml_of(expression, moving: Collection[sympy.Symbol] = ()) -> str:
    """Return an expression as MathML, constants before what is `moving`."""
    return _math(_part(Printer(moving), expression), expression)


def equation_mathml(left, right, before=None, moving: Collection[sympy.Symbol] = ()) -> str:
    """Return an equation as MathML in pieces, what has been added marked; empty if too large."""
    if right.count_ops() > MAX_OPERATIONS:
        return ""
    printer = Printer(moving)
    said = f"{_part(printer, left)}<mo>=</mo>"
    above, below = sympy.fraction(right)
    terms = above.as_ordered_terms()
    added = added_terms(right, before)
    if len(terms) == 1:
        return _math(said + _marked(_part(printer, right), bool(added)), right)
    signed = [
        _marked(_signed(printer, term, first=place == 0), term in added)
        for place, term in enumerate(terms)
    ]
    if len(to_text(right)) <= LINE:
        whole = "".join(signed)
        if below != 1:
            whole = f"<mfrac><mrow>{whole}</mrow>{_part(printer, below)}</mfrac>"
        return _math(said + whole, right)
    if below != 1:
        said += f"<mfrac><mn>1</mn>{_part(printer, below)}</mfrac>{_DOT}{_OPEN}"
    pieces = [said + signed[0], *signed[1:]]
    pieces[-1] += _CLOSE if below != 1 else ""
    return " ".join(_math(piece, term) for piece, term in zip(pieces, terms, strict=True))


def cases_mathml(right, before, moving: Collection[sympy.Symbol]) -> str:
    """Return what was added to a right side, case by case; empty where it has no cases."""
    added = added_terms(right, before)
    ends = [term for term in added if term.has(sympy.Max, sympy.Min)]
    others = [term for term in added if term not in ends]
    return " ".join(_cases(sympy.Add(*terms), moving) for terms in (others, ends) if terms).strip()


def _cases(added, moving) -> str:
    cases, printer = cases_of(added, moving), Printer(moving)
    if not cases:
        return ""
    rows = (
        f"<mtr><mtd>{_part(printer, value)}</mtd>"
        f"<mtd>{_ELSE if when == sympy.true else _part(printer, when)}</mtd></mtr>"
        for value, when in cases
    )
    table = f'<mrow><mo stretchy="true">{{</mo><mtable>{"".join(rows)}</mtable></mrow>'
    return _math(f"{_part(printer, added)}<mo>=</mo>{table}", added)


def added_terms(right, before) -> list:
    """Return the terms of a right side that were not there before, its denominator left out."""
    if before is None or right == before:
        return []
    (above, below), (was_above, was_below) = map(sympy.fraction, (right, before))
    known = {*sympy.Add.make_args(before)}
    if below == was_below:
        known |= {*sympy.Add.make_args(was_above)}
    return [term for term in above.as_ordered_terms() if term not in known]


def _marked(body: str, is_added: bool) -> str:
    return f'<mrow class="added">{body}</mrow>' if is_added else body


def _math(body: str, expression) -> str:
    """Wrap MathML; an equation wider than a page says by how many, for print."""
    body = body.replace("<mo>-</mo>", _MINUS).replace("<mn>-", "<mn>&#x2212;")
    pages = min(math.ceil(len(to_text(expression)) / PAGE), 4)
    css = f' class="pages-{pages}"' if pages > 1 else ""
    return f'<math displaystyle="true"{css}><mrow>{body}</mrow></math>'


def _signed(printer: Printer, term, *, first: bool) -> str:
    """Write a term of a sum with the sign before it."""
    if first:
        return _part(printer, term)
    minus = term.could_extract_minus_sign()
    sign = "&#x2212;" if minus else "+"
    return f'<mo form="infix">{sign}</mo>{_part(printer, -term if minus else term)}'


def _part(printer: Printer, expression) -> str:
    if isinstance(expression, sympy.Derivative):
        return f'<mover accent="true">{_part(printer, expression.expr)}{_RATE}</mover>'
    # as a function of its own an exponential is not pressed into a fraction
    return printer._print(expression.replace(sympy.exp, sympy.Function("exp"))).toxml()


@dataclass(frozen=True)
class Number:
    """A parameter with its unit, its symbol in MathML, and whether the other model lacks it."""

    mathml: str
    value: str
    is_new: bool


@dataclass(frozen=True)
class Equation:
    """An equation in pieces of MathML, its new terms by case, and whether it changed."""

    text: str
    mathml: str
    changed: bool
    cases: str = ""
    numbers: tuple[Number, ...] = ()


def equations_of(model: PhysicsModel, other: PhysicsModel, *, marks: bool = True) -> list[Equation]:
    """Write a model's equations, delays and those outputs that differ from another model's."""
    moving = frozenset({*map(symbol, (*model.states, *model.inputs)), TIME})

    def write(name: str, left, right, before) -> Equation:
        known = before if marks else None
        return Equation(
            f"{name} = {to_text(right)}",
            equation_mathml(left, right, known, moving),
            right != before,
            cases_mathml(right, known, moving),
            _numbers(right, model, other),
        )

    rates = [
        write(f"{s}'", sympy.Derivative(symbol(s), symbol("t")), rate, other.equations.get(s))
        for s, rate in model.equations.items()
    ]
    outputs = [
        write(output, symbol(output), shown, other.outputs.get(output))
        for output, shown in model.outputs.items()
        if other.outputs.get(output) != shown
    ]
    delays = [
        Equation(f"{name} acts with a delay of {delay}", "", other.delays.get(name) != delay)
        for name, delay in model.delays.items()
    ]
    return rates + outputs + delays


def _numbers(right, model: PhysicsModel, other: PhysicsModel) -> tuple[Number, ...]:
    known = model.parameters
    return tuple(
        Number(
            mathml_of(symbol(name)),
            f"{number(known[name].value)} {typeset_unit(known[name].unit)}".rstrip(),
            name not in other.parameters,
        )
        for name in sorted(str(s) for s in right.free_symbols if str(s) in known)
    )
