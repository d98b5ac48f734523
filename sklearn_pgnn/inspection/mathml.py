"""Expressions as MathML: long sums in pieces between which a line may break, added terms marked."""

import math
from collections.abc import Collection

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import PRECEDENCE

from sklearn_pgnn.inspection.cases import cases_of
from sklearn_pgnn.inspection.numbers import number
from sklearn_pgnn.physics.expressions import to_text

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
_RATE = '<mo stretchy="false" class="rate">&#x2D9;</mo>'


class Printer(MathMLPresentationPrinter):
    """Prints products with numbers and constants before what moves.

    `moving` are states, inputs and the time; by default nothing is sorted.
    """

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
            row.appendChild(self._fraction(above, below))
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

    def _fraction(self, above, below):
        fraction = self.dom.createElement("mfrac")
        fraction.appendChild(self._print(above))
        fraction.appendChild(self._print(below))
        return fraction


def mathml_of(expression, moving: Collection[sympy.Symbol] = ()) -> str:
    """Return an expression as MathML.

    Constants are written before what is `moving`.
    """
    return _math(_part(Printer(moving), expression), expression)


def equation_mathml(left, right, before=None, moving: Collection[sympy.Symbol] = ()) -> str:
    """Return an equation as MathML.

    `before` is what its right side was: what has been added is marked. The text is in pieces
    between which a line may break, and empty where it is too large to read.
    """
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
        f"<mtr><mtd>{_part(printer, value)}</mtd><mtd>{_condition(printer, when)}</mtd></mtr>"
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


def _condition(printer: Printer, when) -> str:
    return "<mtext>else</mtext>" if when == sympy.true else _part(printer, when)


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
    minus = term.could_extract_minus_sign()
    if first:
        return _part(printer, term)
    sign = "&#x2212;" if minus else "+"
    return f'<mo form="infix">{sign}</mo>{_part(printer, -term if minus else term)}'


def _part(printer: Printer, expression) -> str:
    if isinstance(expression, sympy.Derivative):
        return f'<mover accent="true">{_part(printer, expression.expr)}{_RATE}</mover>'
    # as a function of its own an exponential is not pressed into a fraction
    return printer._print(expression.replace(sympy.exp, sympy.Function("exp"))).toxml()
