"""Equations before and after, as MathML and as text, with the numbers of their symbols."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.inspection.mathml import cases_mathml, equation_mathml, mathml_of
from sklearn_pgnn.inspection.numbers import number, typeset_unit
from sklearn_pgnn.physics.expressions import TIME, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class Number:
    """A parameter of an equation.

    `mathml` is its symbol, and the value has its unit; it `is_new` if the other model lacks it.
    """

    mathml: str
    value: str
    is_new: bool


@dataclass(frozen=True)
class Equation:
    """One equation of a model.

    `mathml` is in pieces between which a line may break, with the terms that the other model lacks
    marked, and empty where it would be too large to read; `cases` are these terms, case by case,
    empty if without cases. It is `changed` if it differs from that of the other model.
    """

    text: str
    mathml: str
    changed: bool
    cases: str = ""
    numbers: tuple[Number, ...] = ()


def equations_of(model: PhysicsModel, other: PhysicsModel, *, marks: bool = True) -> list[Equation]:
    """Write a model's equations, delays and those outputs that differ from another model's."""
    writer = _Writer(model, other, marks)
    rates = [
        writer.equation(
            f"{state}'",
            sympy.Derivative(symbol(state), symbol("t")),
            rate,
            other.equations.get(state),
        )
        for state, rate in model.equations.items()
    ]
    outputs = [
        writer.equation(output, symbol(output), shown, other.outputs.get(output))
        for output, shown in model.outputs.items()
        if other.outputs.get(output) != shown
    ]
    delays = [
        Equation(f"{name} acts with a delay of {delay}", "", other.delays.get(name) != delay)
        for name, delay in model.delays.items()
    ]
    return rates + outputs + delays


@dataclass(frozen=True)
class _Writer:
    model: PhysicsModel
    other: PhysicsModel
    marks: bool

    @property
    def moving(self) -> frozenset[sympy.Symbol]:
        """States, inputs and the time."""
        return frozenset({*map(symbol, (*self.model.states, *self.model.inputs)), TIME})

    def equation(self, name: str, left, right, before) -> Equation:
        """Write an equation against what its right side is in the other model, if it has it."""
        known = before if self.marks else None
        return Equation(
            f"{name} = {to_text(right)}",
            equation_mathml(left, right, known, self.moving),
            right != before,
            cases_mathml(right, known, self.moving),
            self._numbers(right),
        )

    def _numbers(self, right) -> tuple[Number, ...]:
        known = self.model.parameters
        names = sorted(str(s) for s in right.free_symbols if str(s) in known)
        return tuple(
            Number(
                mathml_of(symbol(name)),
                f"{number(known[name].value)} {typeset_unit(known[name].unit)}".rstrip(),
                name not in self.other.parameters,
            )
            for name in names
        )
