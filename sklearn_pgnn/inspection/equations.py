"""Equations before and after, as MathML and as text."""

from dataclasses import dataclass

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter

from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel

#: beyond so many operations an equation is shown as text only
MAX_OPERATIONS = 400


@dataclass(frozen=True)
class Equation:
    """One equation of a model.

    Parameters
    ----------
    text : str
        As text.
    mathml : str
        As MathML, empty where it would be too large to read.
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


def _equation(name: str, left, right, changed: bool) -> Equation:
    return Equation(f"{name} = {to_text(right)}", _mathml(left, right), changed)


def _mathml(left, right) -> str:
    if right.count_ops() > MAX_OPERATIONS:
        return ""
    printer = MathMLPresentationPrinter({"mul_symbol": "dot"})
    body = "".join((_part(printer, left), "<mo>=</mo>", _part(printer, right)))
    return f'<math displaystyle="true"><mrow>{body}</mrow></math>'


def _part(printer, expression) -> str:
    if isinstance(expression, sympy.Derivative):
        return f"<mover>{_part(printer, expression.expr)}<mo>&#x2D9;</mo></mover>"
    # as a function of its own an exponential is not pressed into a fraction
    return printer._print(expression.replace(sympy.exp, sympy.Function("exp"))).toxml()
