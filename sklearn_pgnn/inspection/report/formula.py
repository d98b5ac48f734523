"""The formula for what no cause explains: its terms with units and intervals, and its model."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy

from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis
from sklearn_pgnn.inspection.case import Samples
from sklearn_pgnn.inspection.equations import mathml_of
from sklearn_pgnn.inspection.evidence import effort_name
from sklearn_pgnn.inspection.numbers import measured, number, times, typeset_unit
from sklearn_pgnn.inspection.report.causes import file_of
from sklearn_pgnn.inspection.report.parameters import fitted_again
from sklearn_pgnn.inspection.words import dependence, place_name
from sklearn_pgnn.physics.expressions import TIME, parse_expression, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.places import is_effort, unit_at
from sklearn_pgnn.physics.port import inertia_at
from sklearn_pgnn.simulation.uncertainty import Estimate, estimate_of, standard_errors


@dataclass(frozen=True)
class Term:
    """A term of the formula.

    `name` is what its coefficient is called in the model; `expression` is without the coefficient,
    `largest`, the largest magnitude in the records, with it.
    """

    name: str
    expression: sympy.Expr
    coefficient: Estimate
    largest: float


@dataclass(frozen=True)
class FoundFormula:
    """The formula of a diagnosis that has one."""

    diagnosis: ModelDiagnosis

    @property
    def part(self):
        """The missing part."""
        return self.diagnosis.discrepancy_

    @property
    def model(self) -> PhysicsModel:
        """The model with the formula."""
        return self.part.model

    @property
    def unit(self) -> str:
        """Unit of what the formula says: of an effort, a rate, or of the input or output."""
        return unit_at(self.model, self.part.target)

    @cached_property
    def samples(self) -> Samples:
        """The records, with states and inputs as the model has them."""
        return Samples.of(self.diagnosis.records_, self.model, self.model)

    @cached_property
    def terms(self) -> list[Term]:
        """The terms."""
        records = self.diagnosis.records_
        expected = records.problem.states.expected_starts(self.model, records.windows)
        errors = standard_errors(fitted_again(self.diagnosis), *expected)
        known = (*self.model.states, *self.model.inputs)
        found = []
        effect = self.part.effect
        for name, text in zip(effect.names().values(), effect.terms, strict=True):
            expression = parse_expression(text, known)
            coefficient = estimate_of(self.model, name, errors)
            size = np.nanmax(np.abs(self.samples.value(expression)))
            largest = float(abs(coefficient.value) * size)
            found.append(Term(name, expression, coefficient, largest))
        return found

    def coefficient_unit(self, term: Term) -> str:
        """Return the unit of a coefficient: that of the formula by that of its term."""
        below = _unit_of(term.expression, self.model)
        above = typeset_unit(self.unit) or "1"
        return f"{above} / ({below})" if below else typeset_unit(self.unit)


def _unit_of(expression: sympy.Expr, model: PhysicsModel) -> str:
    """Return the unit of a product of powers of quantities; empty where it has none."""
    powers: dict[str, int] = {}
    for factor in sympy.Mul.make_args(expression):
        base, power = factor.as_base_exp()
        inner = base.args[0] if isinstance(base, sympy.Abs) else base
        if inner.is_Symbol:
            unit = "s" if str(inner) == "t" else model.unit(str(inner))
            powers[unit] = powers.get(unit, 0) + int(power)
    raised = (
        unit if n == 1 else f"({unit})^{n}" if set(unit) & set(" */^") else f"{unit}^{n}"
        for unit, n in powers.items()
        if unit
    )
    return " · ".join(map(typeset_unit, raised))


def told_formula(formula: FoundFormula) -> dict:
    """Return what a report shows of a formula: plain text by the template's variable."""
    part, model = formula.part, formula.model
    moving = {*map(symbol, (*model.states, *model.inputs)), TIME}
    port = None
    if part.target in model.inertia and not is_effort(model, part.target):
        port = model.port(part.target)  # the rate stands for a force
    force = "" if port is None else port.unit
    expression = sympy.Add(*(symbol(term.name) * term.expression for term in formula.terms))
    return {
        "place": place_name(formula.diagnosis.model, part.target),
        "dependence": dependence(formula.diagnosis, part),
        "left": times(part.error),
        "unit": typeset_unit(formula.unit) or "-",
        "force": typeset_unit(force),
        "effort": effort_name(model, port) if port else "",
        "inertia": to_text(inertia_at(port, model)) if port and force else "",
        "mathml": mathml_of(expression, moving),
        "terms": [
            {
                "name": term.name,
                "mathml": mathml_of(term.expression, moving),
                "value": measured(c.value, c.low, c.high, formula.coefficient_unit(term)),
                "largest": f"{number(term.largest, 3)} {typeset_unit(formula.unit)}".rstrip(),
            }
            for term in formula.terms
            for c in [term.coefficient]
        ],
        "file": file_of(model),
    }
