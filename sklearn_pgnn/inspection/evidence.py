"""The evidence for a cause in the user's records: the missing part without it, and its law."""

import numpy as np
import sympy

from sklearn_pgnn.inspection.balance import Samples
from sklearn_pgnn.inspection.case import Case, make_case
from sklearn_pgnn.inspection.curves import Evidence, Line, even_grid
from sklearn_pgnn.inspection.motion_evidence import cut_rate, implied_parameter, missing_force
from sklearn_pgnn.inspection.signal_evidence import felt_input, residual_over_time, shown_output
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.inspection.words import place_name
from sklearn_pgnn.physics.expressions import parse_expression
from sklearn_pgnn.physics.places import unit_at

#: function that computes each kind of characteristic; None where the records do not show it
DRAWN = {
    "force": missing_force,
    "rate": cut_rate,
    "input": felt_input,
    "output": shown_output,
    "parameter": implied_parameter,
}


def find_evidence(diagnosis, cause) -> Evidence:
    """Return the evidence for a named cause: the characteristic that its effect declares."""
    return evidence_of(make_case(diagnosis, cause))


def evidence_of(case: Case) -> Evidence:
    """Return the evidence for the cause of a case."""
    curve = case.effect.characteristic(case.full)
    drawn = None if curve is None else DRAWN[curve.shows](case, curve)
    return residual_over_time(case) if drawn is None else drawn


def missing_evidence(diagnosis) -> Evidence:
    """Return the evidence for a formula: what the records show at its place, against its value.

    With the formula's value :math:`g(x)` and what is left beside it :math:`d`, the points are
    :math:`(g, g + d)`: partial residuals, with the parameters that were fitted with the formula.
    """
    part = diagnosis.discrepancy_
    said = said_by_formula(diagnosis)
    unit = unit_at(part.model, part.target)
    grid = even_grid(said)
    return Evidence(
        title=f"What is missing in {place_name(diagnosis.model, part.target)}",
        x_label=label("by the formula", unit),
        y_label=label("as the records show it", unit),
        points=(said, said + part.left),
        lines=(Line(grid, grid, "extended", "the formula"),),
        note=(
            "Every point is a sample of the records: what is missing beside the parameters fitted "
            "with the formula, smoothed, over the value of the formula. Points on the line are "
            "described by it."
        ),
    )


def said_by_formula(diagnosis) -> np.ndarray:
    """Return the value of a diagnosis' formula at every sample of its records."""
    part = diagnosis.discrepancy_
    known = (*part.model.states, *part.model.inputs)
    terms = (parse_expression(term, known) for term in part.effect.terms)
    said = sympy.Add(*(c * term for c, term in zip(part.effect.coefficients, terms, strict=True)))
    return Samples.of(diagnosis.records_, part.model, part.model).value(said)
