"""Laws of comparisons: the same question has one answer, whatever was asked before."""

from dataclasses import replace

import numpy as np
import pytest
from rubbing_sledge import CRITERION, KINDS, fitted, fresh_fitter

from sklearn_pgnn import effects
from sklearn_pgnn.diagnosis.comparison import Comparison
from sklearn_pgnn.estimation.criterion import SelectionCriterion
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


@pytest.mark.parametrize("more_is_better", [True, False])
def test_what_takes_more_to_say_refutes_by_what_a_name_needs(fitter, monkeypatch, more_is_better):
    compare = Comparison(fitter, CRITERION)
    less, more = fitted(fitter, *KINDS[:1]), fitted(fitter, *KINDS[:2])
    between = (CRITERION.to_refute + CRITERION.to_name) / 2
    monkeypatch.setattr(SelectionCriterion, "evidence", lambda *_: between)
    monkeypatch.setattr(SelectionCriterion, "explains_enough", lambda *_: True)
    monkeypatch.setattr(SelectionCriterion, "runs_worse", lambda *_: False)
    monkeypatch.setattr(compare, "_overdispersion", lambda *_: 1.0)
    better, worse = (more, less) if more_is_better else (less, more)
    assert compare.refutes(better, worse) is not more_is_better


def test_no_cause_is_named_whose_size_is_none_whatever_the_evidence(fitter, monkeypatch):
    none, rubbed = fitter.base(), fitted(fitter, effects.CoulombFriction)
    assert Comparison(fitter, CRITERION).names(none, rubbed)
    without_size = rubbed.fit.model.with_parameters(Fc_v=0.0)
    idle = replace(rubbed, fit=replace(rubbed.fit, model=without_size))
    before, after = fitter.held_out(none), fitter.held_out(rubbed)
    monkeypatch.setattr(fitter, "held_out", lambda trial: after if trial is idle else before)
    assert not Comparison(fitter, CRITERION).names(none, idle)


@pytest.fixture
def likelier(fitter, monkeypatch):
    """Return a comparison in which windows speak for any hypothesis over any other."""
    monkeypatch.setattr(SelectionCriterion, "evidence", lambda *_: 1e3)
    monkeypatch.setattr(SelectionCriterion, "runs_worse", lambda *_: False)
    compare = Comparison(fitter, CRITERION)
    monkeypatch.setattr(compare, "_overdispersion", lambda *_: 1.0)
    return compare


@pytest.mark.parametrize("enough", [True, False])
def test_what_takes_more_to_say_must_explain_the_smallest_share_more(
    fitter, likelier, monkeypatch, enough
):
    less, more = fitted(fitter, *KINDS[:1]), fitted(fitter, *KINDS[:2])
    monkeypatch.setattr(SelectionCriterion, "explains_enough", lambda *_: enough)
    assert likelier.refutes(more, less) is enough
    assert likelier.refutes(less, more)


@pytest.mark.parametrize("evidence", [-1.0, 1.0])
@pytest.mark.parametrize("runs_worse", [True, False])
def test_of_two_that_take_equally_much_to_say_the_likelier_is_preferred(
    fitter, monkeypatch, evidence, runs_worse
):
    one, other = (fitted(fitter, kind) for kind in KINDS[1:3])
    assert one.hypothesis.complexity == other.hypothesis.complexity
    monkeypatch.setattr(SelectionCriterion, "evidence", lambda *_: evidence)
    monkeypatch.setattr(SelectionCriterion, "runs_worse", lambda *_: runs_worse)
    preferred = Comparison(fitter, CRITERION).is_preferred(other, one)
    assert preferred is (evidence > 0.0 and not runs_worse)


def test_windows_do_not_refute_what_runs_better(fitter, likelier, monkeypatch):
    one, other = (fitted(fitter, kind) for kind in KINDS[1:3])
    better = fitter.held_out(one)
    monkeypatch.setattr(SelectionCriterion, "runs_worse", lambda _, than, __: than is better)
    assert likelier.refutes(one, other)
    assert not likelier.refutes(other, one)


def test_a_memory_that_makes_the_free_run_worse_is_refuted_by_that(fitter, likelier, monkeypatch):
    one, other = (fitted(fitter, kind) for kind in KINDS[1:3])
    plain, memory = fitter.held_out(one), replace(fitter.held_out(other), n_added=1)
    monkeypatch.setattr(fitter, "held_out", lambda trial: plain if trial is one else memory)
    monkeypatch.setattr(SelectionCriterion, "runs_worse", lambda _, than, __: than is plain)
    assert likelier.refutes(one, other)
    assert not likelier.refutes(other, one)


@pytest.mark.parametrize("stands", [True, False])
def test_what_records_show_by_themselves_answers_to_the_free_run_too(fitter, monkeypatch, stands):
    rubbed = fitted(fitter, effects.CoulombFriction)
    compare = Comparison(fitter, CRITERION, given=frozenset(rubbed.hypothesis.causes))
    monkeypatch.setattr(SelectionCriterion, "stands_in_free_run", lambda *_: stands)
    assert compare.names(fitter.base(), rubbed) is stands
