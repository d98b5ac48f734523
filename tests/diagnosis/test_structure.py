"""Laws of what is left: noise of any colour has no structure, a part of the physics has."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from servo import SERVO, follow_sines
from sledge import SLEDGE, drive

from sklearn_pgnn import effects
from sklearn_pgnn.diagnosis.structure import IN_RECORD, find_structure, is_positive
from sklearn_pgnn.diagnosis.trees import groups_of
from sklearn_pgnn.estimation.budgets import STRETCHES
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.held_out import segments
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.simulation.windows import evaluate
from sklearn_pgnn.trajectories import read_records

ALPHA, SHARE = 0.01, 0.05


@pytest.fixture(scope="module")
def fitted():
    """Return a problem with eight records of a sledge, and its re-tuned prior."""
    X, y = drive(n_records=8, samples=250)
    problem = build_problem(SLEDGE, read_records(SLEDGE, X, y))
    return problem, HypothesisFitter(problem).base()


def left(fitted, residual):
    """Return the re-tuned prior as if it left something else of the records."""
    problem, base = fitted
    scaled = residual.reshape(-1, 1) * problem.windows.scale
    evaluation = replace(base.fit.evaluation, residual=scaled)
    return FittedHypothesis(base.hypothesis, replace(base.fit, evaluation=evaluation))


def noise_of(kind, problem, rng):
    """Return noise of a sensor, every record's drawn by itself."""
    bounds = problem.windows.bounds
    draws = rng.standard_normal((bounds.size - 1, bounds[1]))
    if kind == "first order":
        draws = lfilter([1], [1, -0.95], draws, axis=1)
    elif kind == "wandering":
        draws = np.cumsum(draws, axis=1)
    return draws.ravel()


# -- no structure ----------------------------------------------------------------------------------


@pytest.mark.parametrize("alpha", [0.01, 0.1])
@pytest.mark.parametrize("groups", [3, 8])
def test_shares_without_any_meaning_are_taken_for_some_as_rarely_as_alpha_says(alpha, groups):
    draws = np.random.default_rng(0).normal(size=(4000, groups))
    rate = np.mean([is_positive(shares, np.ones(groups), alpha) for shares in draws])
    assert rate == pytest.approx(alpha, abs=3 * np.sqrt(alpha / len(draws)))


@pytest.mark.parametrize("alpha", [0.01, 0.1])
@pytest.mark.parametrize("spread", [0.5, 2.0])
def test_so_they_are_where_some_groups_are_louder(alpha, spread):
    rng = np.random.default_rng(0)
    powers = np.exp(spread * rng.normal(size=(4000, 8)))
    found = [is_positive(rng.normal(size=8), power, alpha) for power in powers]
    assert np.mean(found) <= alpha + 3 * np.sqrt(alpha / len(powers))


def test_one_group_proves_nothing():
    assert not is_positive(np.array([0.9]), np.ones(1), ALPHA)
    assert not is_positive(np.array([]), np.array([]), ALPHA)
    assert not is_positive(np.zeros(8), np.ones(8), ALPHA)
    assert not is_positive(np.array([0.9, 0.0, 0.0]), np.array([1e3, 1e-3, 1e-3]), ALPHA)


def test_a_quiet_group_that_is_badly_predicted_does_not_hide_what_the_loud_ones_share():
    shares, powers = np.array([0.8, 0.9, 0.7, 0.8, 0.75, -20.0]), np.array([10.0] * 5 + [0.01])
    assert is_positive(shares, powers, ALPHA)
    assert is_positive(shares, 1e6 * powers, ALPHA)
    assert not is_positive(shares, np.ones(6), ALPHA)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["white", "first order", "wandering"])
def test_noise_of_any_colour_has_no_structure(fitted, kind):
    rng, draws, alpha = np.random.default_rng(0), 10, 0.05
    found = [
        find_structure(fitted[0], left(fitted, noise_of(kind, fitted[0], rng)), alpha, SHARE)
        for _ in range(draws)
    ]
    alarms = sum(structure.is_significant for structure in found)
    assert alarms <= alpha * draws + 2 * np.sqrt(alpha * draws)
    assert all(not s.depends_on for s in found if not s.is_significant)


def test_what_one_record_has_and_no_other_is_no_structure(fitted):
    problem = fitted[0]
    offsets = np.random.default_rng(1).normal(size=problem.windows.bounds.size - 1)
    each = np.repeat(offsets, np.diff(problem.windows.bounds))
    noise = np.random.default_rng(2).normal(size=each.size)
    assert not find_structure(problem, left(fitted, each + noise), ALPHA, SHARE).is_significant


def test_a_run_that_leaves_all_numbers_is_no_feature_but_no_obstacle():
    """An unstable cart in free run: what it leaves over windows is noise all the same."""
    cart = SLEDGE.replace(equations={"v": "(F + 40*m*v)/m"})
    t, rng = np.arange(0, 60, 0.02), np.random.default_rng(0)
    X, y = np.c_[t, np.sin(t)], rng.normal(size=(t.size, 1))
    problem = build_problem(cart, read_records(cart, X, y), window_length=0.5)
    trial = HypothesisFitter(problem).base()
    assert not find_structure(problem, trial, ALPHA, SHARE).is_significant


# -- structure -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "effect", [effects.CoulombFriction("v", 0.4), effects.QuadraticDrag("v", 0.3)]
)
def test_an_effect_without_a_name_leaves_structure_in_what_it_depends_on(effect):
    X, y = drive(SLEDGE + effect, n_records=8, samples=250)
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, X, y)))
    structure = find_structure(fitter.problem, fitter.base(), ALPHA, SHARE)
    assert structure.is_significant
    assert structure.skill["v"] > SHARE
    assert {"v", "F"} & set(structure.depends_on)


@pytest.mark.parametrize("name", ["F", IN_RECORD])
def test_structure_depends_on_what_makes_it(fitted, name):
    problem = fitted[0]
    windows = problem.windows
    begun = np.repeat(windows.t[windows.bounds[:-1]], np.diff(windows.bounds))
    signal = windows.u[:, 0] ** 3 if name == "F" else (windows.t - begun > 3.0)
    signal = (signal - np.mean(signal)) / np.std(signal)
    noise = np.random.default_rng(0).normal(size=signal.size)
    structure = find_structure(problem, left(fitted, signal + noise), ALPHA, SHARE)
    assert structure.is_significant
    assert structure.depends_on[0] == name
    assert structure.skill["v"] == pytest.approx(0.5, abs=0.15)  # the rest is noise


def test_dynamics_without_a_name_leave_structure_though_windows_are_a_third_of_a_record():
    """Few samples have a past that is a window long."""
    problem = build_problem(SERVO, read_records(SERVO, *follow_sines()), window_length=1.67)
    structure = find_structure(problem, HypothesisFitter(problem).base(), ALPHA, SHARE)
    assert structure.is_significant


@pytest.mark.parametrize("seed", [0, 1])
def test_a_few_loud_windows_do_not_hide_what_all_of_them_share(fitted, seed):
    problem, rng = fitted[0], np.random.default_rng(seed)
    window = np.maximum(segments(problem.windows), 0)
    loudness = np.exp(2 * rng.normal(size=len(problem.windows)))[window]
    u = problem.windows.u[:, 0] / problem.windows.u.std()
    trial = left(fitted, loudness * (u + rng.normal(size=u.size)))
    structure = find_structure(problem, trial, ALPHA, SHARE)
    assert structure.is_significant
    assert structure.skill["v"] == pytest.approx(0.4, abs=0.15)  # the rest is noise


def test_what_a_few_loud_windows_leave_is_structure_though_the_others_leave_noise(fitted):
    problem = fitted[0]
    above = problem.windows.u[:, 0] > 1.5 * problem.windows.u.std()
    noise = np.random.default_rng(0).normal(size=above.size)
    structure = find_structure(problem, left(fitted, 100.0 * above + noise), ALPHA, SHARE)
    assert structure.is_significant
    assert structure.depends_on[0] == "F"


def test_less_than_the_smallest_share_is_not_worth_saying(fitted):
    problem = fitted[0]
    u = problem.windows.u[:, 0] / problem.windows.u.std()
    trial = left(fitted, u + np.random.default_rng(0).normal(size=u.size))
    assert not find_structure(problem, trial, ALPHA, 0.9).is_significant


@pytest.mark.slow
def test_units_of_the_residuals_do_not_matter(fitted):
    problem = fitted[0]
    u = problem.windows.u[:, 0] + np.random.default_rng(0).normal(size=len(problem.windows.u))
    one, other = (
        find_structure(problem, left(fitted, scale * u), ALPHA, SHARE) for scale in (1.0, 1e3)
    )
    assert one.depends_on == other.depends_on
    assert one.skill["v"] == pytest.approx(other.skill["v"], rel=1e-3)


@pytest.mark.slow
def test_the_states_it_asks_are_those_of_a_free_run(fitted):
    """Noise of the sensor does not explain itself: no feature has seen the measured outputs."""
    problem, base = fitted
    other = replace(problem.windows, y=problem.windows.y[::-1].copy())
    x0 = base.fit.x0
    moved = evaluate(base.fit.model, other, x0, ()).residual
    changed = replace(problem, windows=other)
    fit = replace(base.fit, evaluation=replace(base.fit.evaluation, residual=moved))
    noise = noise_of("white", problem, np.random.default_rng(0))
    one = find_structure(problem, left(fitted, noise), ALPHA, SHARE)
    again = left((changed, FittedHypothesis(Hypothesis(), fit)), noise)
    assert find_structure(changed, again, ALPHA, SHARE).skill == one.skill


@pytest.mark.parametrize("records", [1, 2, 3, 8, 20])
def test_groups_are_records_or_stretches_of_them_and_never_mixed_samples(records):
    record = np.repeat(np.arange(records), 48)
    group = groups_of(record)
    assert np.unique(group).size == STRETCHES
    inside = np.diff(record) == 0
    assert np.count_nonzero(np.diff(group)[inside]) == records * (-(-STRETCHES // records) - 1)
    np.testing.assert_array_equal(groups_of(2 * record + 1), group)  # some have no sample
