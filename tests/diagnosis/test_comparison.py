"""Laws of comparisons: the same question has one answer, whatever was asked before."""

from dataclasses import replace

import numpy as np
import pytest
from rubbing_sledge import CRITERION, KINDS, fitted, fresh_fitter

from sklearn_pgnn import effects
from sklearn_pgnn.diagnosis.comparison import Comparison
from sklearn_pgnn.estimation.fitting import HypothesisFitter


@pytest.fixture
def fitter():
    return fresh_fitter()


def evidence(fitter, without, with_):
    return CRITERION.evidence(fitter.held_out(without), fitter.held_out(with_))


@pytest.mark.slow
def test_a_comparison_has_the_same_answer_whatever_was_asked_before(fitter):
    first = evidence(fitter, fitter.base(), fitted(fitter, effects.CoulombFriction))
    for kinds in (KINDS[:1], KINDS[2:3], KINDS[2:4], KINDS[1:3]):
        evidence(fitter, fitter.base(), fitted(fitter, *kinds))
    again = evidence(fitter, fitter.base(), fitted(fitter, effects.CoulombFriction))
    assert again == first
    fresh = HypothesisFitter(fitter.problem)
    for kinds in (KINDS[2:4], KINDS[:1]):
        fitted(fresh, *kinds)
    late = evidence(fresh, fresh.base(), fitted(fresh, effects.CoulombFriction))
    assert late == pytest.approx(first, rel=1e-3)


def test_evidence_over_a_third_adds_up(fitter):
    """Differences of one statistic: what holds over none, and between two, is consistent."""
    none, one, other = fitter.base(), *(fitted(fitter, kind) for kind in KINDS[1:3])
    there, back = evidence(fitter, one, other), evidence(fitter, other, one)
    assert there == pytest.approx(-back)
    assert np.sign(there) == np.sign(evidence(fitter, none, other) - evidence(fitter, none, one))


def test_nothing_that_was_asked_changes_the_problem(fitter):
    windows = fitter.problem.windows
    before = {name: getattr(windows, name).copy() for name in ("t", "u", "y", "starts", "scale")}
    fitted(fitter, effects.CoulombFriction, effects.ConstantLoad)
    assert fitter.problem.windows is windows
    for name, values in before.items():
        np.testing.assert_array_equal(getattr(windows, name), values)


def test_no_cause_is_named_whose_size_is_none_whatever_the_evidence(fitter, monkeypatch):
    none, rubbed = fitter.base(), fitted(fitter, effects.CoulombFriction)
    assert Comparison(fitter, CRITERION).names(none, rubbed)
    without_size = rubbed.fit.model.with_parameters(Fc_v=0.0)
    idle = replace(rubbed, fit=replace(rubbed.fit, model=without_size))
    before, after = fitter.held_out(none), fitter.held_out(rubbed)
    monkeypatch.setattr(fitter, "held_out", lambda trial: after if trial is idle else before)
    assert not Comparison(fitter, CRITERION).names(none, idle)
