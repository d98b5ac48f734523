"""Laws of the ladder: who goes on, and how far behind one may be."""

from itertools import combinations

import numpy as np
import pytest
from rubbing_sledge import CRITERION, KINDS, fitted, fresh_fitter
from sledge import SLEDGE

from sklearn_pgnn import effects
from sklearn_pgnn.diagnosis.ladder import Ladder
from sklearn_pgnn.estimation.budgets import COARSER, TOLERANCE

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
