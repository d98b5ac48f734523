"""Equations before and after, as MathML and as text."""

from dataclasses import dataclass

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter

from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel

#: beyond so many operations an equation is shown as text only
MAX_OPERATIONS = 400
#: characters, as text, beyond which a sum may be broken between its terms
LINE = 60
#: characters, as text, that fit a printed page; what is longer and cannot be broken gets smaller
PAGE = 80
_MINUS, _DOT = "<mo>&#x2212;</mo>", "<mo>&#xB7;</mo>"
_OPEN, _CLOSE = '<mo stretchy="false">(</mo>', '<mo stretchy="false">)</mo>'
_RATE = '<mo stretchy="false" class="rate">&#x2D9;</mo>'


@dataclass(frozen=True)
class Equation:
    """One equation of a model.

    Parameters
    ----------
    text : str
        As text.
    mathml : str
        As MathML, in pieces between which a line may break; empty where it would be too large to
        read.
    changed : bool
        Whether the other model has it otherwise.
    """

    text: str
    mathml: str
    changed: bool


def equations_of(model: PhysicsModel, other: PhysicsModel) -> list[Equation]:
    """Write a model's equations, delays and those outputs that differ from another model's.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    other : PhysicsModel
        The model it is compared with.

    Returns
    -------
    list of Equation
        State by state, then outputs, then delays.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
    >>> [equation.text for equation in equations_of(lag, lag)]
    ["y' = -y/T"]
    """
    rates = [
        _equation(
            f"{state}'",
            sympy.Derivative(symbol(state), symbol("t")),
            rate,
            other.equations.get(state) != rate,
        )
        for state, rate in model.equations.items()
    ]
    outputs = [
        _equation(output, symbol(output), shown, True)
        for output, shown in model.outputs.items()
        if other.outputs.get(output) != shown
    ]
    delays = [
        Equation(f"{name} acts {delay} late", "", other.delays.get(name) != delay)
        for name, delay in model.delays.items()
    ]
    return rates + outputs + delays


def mathml_of(expression) -> str:
    """Return an expression as MathML.

    Parameters
    ----------
    expression : sympy.Expr
        The expression.

    Returns
    -------
    str
        The MathML text.
    """
    return _math(_part(MathMLPresentationPrinter({"mul_symbol": "dot"}), expression), expression)


def _equation(name: str, left, right, changed: bool) -> Equation:
    return Equation(f"{name} = {to_text(right)}", _mathml(left, right), changed)


def _mathml(left, right) -> str:
    if right.count_ops() > MAX_OPERATIONS:
        return ""
    printer = MathMLPresentationPrinter({"mul_symbol": "dot"})
    said = f"{_part(printer, left)}<mo>=</mo>"
    above, below = sympy.fraction(right)
    terms = above.as_ordered_terms()
    if len(to_text(right)) <= LINE or len(terms) == 1:
        return _math(said + _part(printer, right), right)
    if below != 1:
        said += f"<mfrac><mn>1</mn>{_part(printer, below)}</mfrac>{_DOT}{_OPEN}"
    signed = [_signed(printer, term, first=term is terms[0]) for term in terms]
    pieces = [said + signed[0], *signed[1:]]
    pieces[-1] += _CLOSE if below != 1 else ""
    return " ".join(_math(piece, term) for piece, term in zip(pieces, terms, strict=True))


def _math(body: str, expression) -> str:
    """Wrap MathML; an equation wider than a page carries its scale, for print."""
    body = body.replace("<mo>-</mo>", _MINUS).replace("<mn>-", "<mn>&#x2212;")
    size = len(to_text(expression)) / PAGE
    style = f' style="--pages: {size:.2f}"' if size > 1 else ""
    return f'<math displaystyle="true"{style}><mrow>{body}</mrow></math>'


def _signed(printer, term, *, first: bool) -> str:
    """Write a term of a sum with the sign before it."""
    minus = term.could_extract_minus_sign()
    if first:
        return _part(printer, term)
    sign = "&#x2212;" if minus else "+"
    return f'<mo form="infix">{sign}</mo>{_part(printer, -term if minus else term)}'


def _part(printer, expression) -> str:
    if isinstance(expression, sympy.Derivative):
        return f'<mover accent="true">{_part(printer, expression.expr)}{_RATE}</mover>'
    # as a function of its own an exponential is not pressed into a fraction
    return printer._print(expression.replace(sympy.exp, sympy.Function("exp"))).toxml()
