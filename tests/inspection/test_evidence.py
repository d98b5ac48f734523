"""The evidence for a formula is drawn with the parameters that were fitted with it."""

from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from situations import situation

from sklearn_pgnn.diagnosis.unexplained import hidden_input
from sklearn_pgnn.inspection.evidence import missing_evidence
from sklearn_pgnn.inspection.report.evidence_section import residual_maps
from sklearn_pgnn.inspection.report.formula import FoundFormula

pytestmark = pytest.mark.core


def slope(x, y, n_blocks):
    """Return the slope of y over x, and its standard error from blocks of neighbours."""
    cuts = np.array_split(np.arange(x.size), n_blocks)
    parts = np.array([[x[rows] @ y[rows], x[rows] @ x[rows]] for rows in cuts])
    whole = parts[:, 0].sum() / parts[:, 1].sum()
    rest = (parts[:, 0] - whole * parts[:, 1]) / parts[:, 1].sum()
    return whole, float(np.sqrt((rest**2).sum()))


def test_points_lie_on_the_line_of_their_formula():
    diagnosis = situation("unexplained")
    x, y = missing_evidence(diagnosis).points
    found, error = slope(x, y, len(diagnosis.records_.windows))
    assert abs(found - 1.0) < max(3 * error, 2e-3)
    assert error < 0.02
    assert np.corrcoef(x, y)[0, 1] > 0.99


def wrong(share: float):
    """Return the diagnosis with a formula that says a share of what it should."""
    diagnosis = copy(situation("unexplained"))
    part, records = diagnosis.discrepancy_, diagnosis.records_
    names = part.effect.names().values()
    values = {name: share * part.model.parameters[name].value for name in names}
    model = part.model.with_parameters(**values)
    effect = replace(part.effect, coefficients=tuple(values.values()))
    trial = SimpleNamespace(fit=SimpleNamespace(model=model))
    left = hidden_input(records.problem, trial, part.target).values
    diagnosis.discrepancy_ = replace(part, effect=effect, model=model, left=left)
    return diagnosis


def test_points_leave_the_line_of_a_formula_that_says_too_little():
    diagnosis = wrong(0.6)
    x, y = missing_evidence(diagnosis).points
    found, _ = slope(x, y, len(diagnosis.records_.windows))
    assert found == pytest.approx(1 / 0.6, rel=0.1)


def coloured(diagnosis) -> list[int]:
    """Return the number of coloured cells in each map."""
    (maps,) = residual_maps(diagnosis, FoundFormula(diagnosis))
    plots = [panel["plot"] for panel in maps["panels"]]
    return [plot.count("above") + plot.count("below-zero") for plot in plots]


def test_the_map_of_what_is_left_is_blank_where_the_formula_leaves_noise():
    shown, said, left = coloured(situation("unexplained"))
    assert shown > 0
    assert said > 0
    assert left == 0


def test_the_map_of_what_is_left_is_not_blank_where_it_leaves_more():
    assert coloured(wrong(0.6))[2] > 0
