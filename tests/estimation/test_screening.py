"""Laws of the screening: expected squares are those of least squares, and foretell what is near."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sledge import SLEDGE, drive

from sklearn_pgnn import effects, systems
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.screening import Screening, _Products
from sklearn_pgnn.trajectories import read_records

# -- expected squares ------------------------------------------------------------------------------


def table_of(seed, columns):
    """Return a target and some columns of very different lengths."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(40, 1 + columns)) * 10.0 ** rng.uniform(-6, 6, 1 + columns)


def left(table):
    """Return the squares of the first column that the others do not explain."""
    return _Products(table).left(np.arange(table.shape[1]))


tables = st.builds(table_of, st.integers(0, 1000), st.integers(1, 6))


@given(tables)
def test_expected_squares_are_those_of_least_squares(table):
    target, columns = table[:, 0], table[:, 1:] / np.linalg.norm(table[:, 1:], axis=0)
    rest = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
    assert left(table) == pytest.approx(rest @ rest, rel=1e-6)


@given(tables, st.integers(0, 1000))
def test_neither_units_nor_the_order_of_columns_matter(table, seed):
    rng, count = np.random.default_rng(seed), table.shape[1] - 1
    units = np.append(1.0, 10.0 ** rng.uniform(-3, 3, count))
    order = np.append(0, 1 + rng.permutation(count))
    assert left((table * units)[:, order]) == pytest.approx(left(table), rel=1e-6)
    assert left(2.0 * table) == pytest.approx(4.0 * left(table))


@given(tables)
def test_one_more_column_never_leaves_more(table):
    assert left(table) <= left(table[:, :-1]) * (1 + 1e-9)


@given(tables)
def test_what_changes_nothing_and_what_says_the_same_twice_do_no_harm(table):
    nothing = np.zeros((len(table), 1))
    assert left(np.hstack([table, nothing, table[:, 1:]])) == pytest.approx(left(table), rel=1e-6)


def test_what_is_the_target_itself_leaves_nothing():
    column = np.random.default_rng(0).normal(size=(40, 1))
    assert left(np.hstack([column, 3.0 * column])) == pytest.approx(0.0, abs=1e-9)
    assert left(column) == pytest.approx(float(column[:, 0] @ column[:, 0]))


# -- candidates ------------------------------------------------------------------------------------

KINDS = (effects.CoulombFriction, effects.ConstantLoad, effects.QuadraticDrag)


@pytest.fixture(scope="module")
def screened():
    """Return a fitter on a sledge with friction and a load, and what three candidates change."""
    rig = SLEDGE + effects.CoulombFriction("v", level=0.4) + effects.ConstantLoad("v", load=0.5)
    problem = build_problem(SLEDGE, read_records(SLEDGE, *drive(rig)))
    fitter = HypothesisFitter(problem)
    ground = fitter.subsample(fitter.base())
    screening = Screening(fitter.windows_of)
    alone = {}
    for kind in KINDS:
        alone[kind] = fitter.converge(fitter.first_fit(ground, kind("v")))
        screening.learn(ground, alone[kind])
    return fitter, ground, screening, alone


def test_the_candidate_that_alone_leaves_least_is_expected_to(screened):
    _, ground, screening, alone = screened
    ranked = screening.rank(ground)
    assert max(expected for expected, _ in ranked) <= ground.squares * (1 + 1e-9)
    nearest = min(alone, key=lambda kind: alone[kind].squares)
    assert isinstance(ranked[0][1][0], nearest)


def test_two_together_are_expected_to_leave_no_more_than_either(screened):
    _, ground, screening, _ = screened
    single = {cause: expected for expected, (cause,) in screening.rank(ground)}
    pairs = screening.rank(ground, 2)
    assert len(pairs) == 3
    for expected, (one, other) in pairs:
        assert expected <= min(single[one], single[other]) * (1 + 1e-9)
    assert [expected for expected, _ in pairs] == sorted(expected for expected, _ in pairs)


def test_the_two_that_are_hidden_are_the_most_promising_pair(screened):
    _, ground, screening, alone = screened
    expected, pair = screening.rank(ground, 2)[0]
    assert {type(cause) for cause in pair} == {effects.CoulombFriction, effects.ConstantLoad}
    assert expected < 0.5 * min(fit.squares for fit in alone.values())


def test_beside_a_cause_only_what_may_stand_there_is_ranked(screened):
    fitter, _, screening, alone = screened
    friction = alone[effects.CoulombFriction]
    ranked = screening.rank(friction)
    assert {type(cause) for _, (cause,) in ranked} == set(KINDS) - {effects.CoulombFriction}
    assert isinstance(ranked[0][1][0], effects.ConstantLoad)
    both = fitter.converge(fitter.first_fit(friction, effects.ConstantLoad("v")))
    assert both.squares < ranked[0][0] < 0.1 * friction.squares


def test_what_was_learned_near_the_records_is_kept(screened):
    fitter, ground, _, alone = screened
    friction, load = alone[effects.CoulombFriction], alone[effects.ConstantLoad]
    both = fitter.converge(fitter.first_fit(friction, effects.ConstantLoad("v")))
    (cause,) = load.hypothesis.causes
    screening = Screening(fitter.windows_of)
    screening.learn(ground, load)
    far = screening._change_by(cause)
    screening.learn(friction, both)
    near = screening._change_by(cause)
    assert not np.allclose(near, far)
    screening.learn(ground, load)
    np.testing.assert_array_equal(screening._change_by(cause), near)


def test_the_two_causes_that_explain_most_together_are_foretold():
    cart = systems.cart_on_spring()
    truth = (effects.QuadraticDrag("v", 0.6), effects.ConstantLoad("v", 0.8))
    hidden = make_hidden_effect(cart, truth, random_state=7, n_records=4, sample_rate=100.0)
    problem = build_problem(hidden.prior, read_records(hidden.prior, hidden.X, hidden.y))
    fitter = HypothesisFitter(problem)
    ground = fitter.subsample(fitter.base())
    kinds = (
        effects.QuadraticDrag,
        effects.ConstantLoad,
        effects.CubicStiffness,
        effects.CoulombFriction,
    )
    alone = [fitter.converge(fitter.first_fit(ground, kind("v"))) for kind in kinds]
    screening = Screening(fitter.windows_of)
    for fit in alone:
        screening.learn(ground, fit)
    left, pair = screening.rank(ground, 2)[0]
    assert {type(cause) for cause in pair} == {effects.QuadraticDrag, effects.ConstantLoad}
    assert left < 0.5 * min(fit.squares for fit in alone)


def test_a_parameter_at_its_limit_is_not_re_tuned_but_wrong():
    heavier = SLEDGE.with_parameters(m=3.0)
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, *drive(heavier))))
    base = fitter.subsample(fitter.base())
    assert base.fit.model.parameters["m"].value == pytest.approx(2.2)  # a spread of 10 %
    candidates = (effects.WrongParameter("m"), effects.WrongParameter("d"))
    screening = Screening(fitter.windows_of)
    for cause in (*candidates, effects.ConstantLoad("v")):
        screening.learn(base, fitter.first_fit(base, cause))
    (left, first), *_, (most, _) = screening.rank(base)
    assert first == candidates[:1]
    assert left < 0.1 * most
