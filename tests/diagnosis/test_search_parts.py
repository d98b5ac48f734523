"""Laws of the parts of a search: who goes on in the ladder, comparisons, and moves."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from rubbing_sledge import CRITERION, KINDS, fitted, fresh_fitter
from sledge import SLEDGE, drive

from sklearn_pgnn import effects
from sklearn_pgnn.diagnosis.comparison import Comparison
from sklearn_pgnn.diagnosis.ladder import Ladder
from sklearn_pgnn.diagnosis.moves import Moves
from sklearn_pgnn.estimation.budgets import COARSER, TOLERANCE
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records

CANDIDATES = tuple(kind(kind.targets(SLEDGE)[0]) for kind in KINDS)


@pytest.fixture(scope="module")
def ladder():
    return Ladder(fresh_fitter(), CRITERION, CANDIDATES, dict.fromkeys(CANDIDATES, ()))


def test_every_candidate_is_tried_alone_and_half_of_them_beside_a_cause(ladder):
    none, rubbed = ladder.fitter.base(), fitted(ladder.fitter, effects.CoulombFriction)
    assert ladder.promising(ladder.fitter.subsample(none)) == CANDIDATES
    beside = ladder.promising(ladder.fitter.subsample(rubbed))
    assert len(beside) < len(CANDIDATES)


def test_what_was_fitted_beside_the_same_causes_before_is_known(ladder, monkeypatch):
    rubbed = ladder.fitter.subsample(fitted(ladder.fitter, effects.CoulombFriction))
    others = [c for c in CANDIDATES if rubbed.hypothesis.allows(c)]
    fits = {cause: ladder.fitter.first_fit(rubbed, cause) for cause in others}
    for cause, fit in fits.items():
        assert ladder.fitter.known_squares(rubbed, cause) <= fit.squares
    least = min(fits, key=lambda cause: fits[cause].squares)
    nothing = [(np.inf, (cause,)) for cause in others]
    monkeypatch.setattr(ladder.screen(), "rank", lambda ground: nothing)
    assert ladder.promising(rubbed)[0] == least


def test_fits_come_nearest_first_and_converging_brings_none_further_away(ladder):
    none = ladder.fitter.base()
    first = ladder.first_fits(none, CANDIDATES)
    nearer = ladder.converge(none, first)
    for fits in (first, nearer):
        objectives = [fit.fit.objective for fit in fits]
        assert objectives == sorted(objectives)
    assert nearer[0].fit.objective <= first[0].fit.objective
    assert nearer[0].hypothesis.causes[0].id == "coulomb_friction"


def test_the_hidden_cause_leaves_least_alone(ladder):
    ladder.first_fits(ladder.fitter.base(), CANDIDATES)
    least = min(ladder.alone, key=lambda cause: ladder.alone[cause].left)
    assert least.id == "coulomb_friction"


def test_a_pair_says_nothing_of_what_its_second_cause_leaves_alone(ladder):
    none = ladder.fitter.base()
    ladder.first_fits(none, CANDIDATES)
    before = dict(ladder.alone)
    rubbed = ladder.fitter.first_fit(ladder.fitter.subsample(none), CANDIDATES[0])
    pairs = [ladder.fitter.first_fit(rubbed, other) for other in CANDIDATES[1:]]
    ladder.converge(none, [pair for pair in pairs if pair.fit.usable])
    assert ladder.alone == before


def test_the_limit_lies_above_the_best_and_further_where_a_fit_leaves_what_is_slow(ladder):
    rubbed = ladder.fitter.subsample(fitted(ladder.fitter, effects.CoulombFriction))
    nothing = ladder.fitter.subsample(ladder.fitter.base())
    beside_itself = ladder._limit(rubbed, rubbed)
    assert rubbed.squares < beside_itself < ladder._limit(rubbed, nothing)


def test_what_may_stand_in_a_place_has_another_cause_there(ladder):
    rubbed = fitted(ladder.fitter, effects.CoulombFriction)
    (cause,) = rubbed.hypothesis.causes
    for other in ladder.in_place(rubbed, cause):
        assert len(other.hypothesis.causes) == 1
        assert cause not in other.hypothesis.causes


# -- few candidates --------------------------------------------------------------------------------


def test_every_allowed_set_of_few_candidates_is_fitted_and_none_of_many():
    few = (*CANDIDATES[:3], effects.LoadFriction("v"))  # excludes dry friction beside it
    ladder = Ladder(fresh_fitter(), CRITERION, few, dict.fromkeys(few, ()))
    found = {frozenset(fit.hypothesis.causes): fit for fit in ladder.few_sets(most=2)}
    assert list(map(len, found)) == sorted(map(len, found))
    pairs = {frozenset(pair) for pair in combinations(few, 2)}
    assert found.keys() == {frozenset([c]) for c in few} | pairs - {frozenset(few[1::2])}
    for pair in found.keys() & pairs:
        less = min(found[frozenset([cause])].fit.objective for cause in pair)
        assert found[pair].fit.objective <= (1 + COARSER * TOLERANCE) * less
    assert ladder.has_few_sets(most=2)
    for many in (CANDIDATES, [effects.SensorBias(f"y{i}") for i in range(1000)]):
        assert not Ladder(ladder.fitter, CRITERION, tuple(many), {}).has_few_sets(most=4)


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


def moves_of(fitter, kinds=KINDS):
    """Return the moves among a few candidates."""
    candidates = tuple(kind(kind.targets(SLEDGE)[0]) for kind in kinds)
    same = dict.fromkeys(candidates, ())
    return Moves(Comparison(fitter, CRITERION), Ladder(fitter, CRITERION, candidates, same))


def test_a_cause_is_added_that_the_criterion_names():
    fitter = fresh_fitter()
    found = next(moves_of(fitter).add(fitter.base()))
    assert [c.id for c in found.hypothesis.causes] == ["coulomb_friction"]


def test_a_cause_that_is_nothing_beside_another_is_dropped():
    fitter = fresh_fitter()
    both = fitted(fitter, effects.CoulombFriction, effects.ConstantLoad)
    assert [c.id for c in moves_of(fitter).drop(both).hypothesis.causes] == ["coulomb_friction"]


def test_a_cause_that_a_better_one_refutes_is_replaced():
    fitter = fresh_fitter()
    dragged = fitted(fitter, effects.QuadraticDrag)
    found = next(moves_of(fitter).replace(dragged))
    assert [c.id for c in found.hypothesis.causes] == ["coulomb_friction"]


def test_of_few_candidates_the_set_is_taken_that_hides_in_the_records():
    """Friction and a load, each named beside the other, wherever the search stands."""
    rig = SLEDGE + effects.CoulombFriction("v", level=0.4) + effects.ConstantLoad("v", 0.3)
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, *drive(rig, n_records=3))))
    moves = moves_of(fitter, KINDS[:3])
    true = {effects.CoulombFriction("v"), effects.ConstantLoad("v")}
    for start in (fitter.base(), fitted(fitter, effects.QuadraticDrag)):
        (found,) = moves.any_of_few_sets(start, most=3)
        assert set(found.hypothesis.causes) == true
    assert list(moves.any_of_few_sets(found, most=3)) == []
