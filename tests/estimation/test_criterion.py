"""Laws of the one comparison: invariance, false alarms under the null, power, probabilities."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import norm

from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times, white_power
from sklearn_pgnn.estimation.criterion import (
    SelectionCriterion,
    accuracy_gained,
    explained_share,
    log_likelihood_ratio,
    ratio_error,
)
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals

pytestmark = pytest.mark.core

ALPHA = 0.01
CRITERION = SelectionCriterion(alpha=ALPHA, smallest_share=0.05, n_candidates=1)
positive = st.floats(1e-6, 1e6)
pairs = st.lists(st.tuples(positive, positive, st.floats(1, 50), st.floats(1, 50)), min_size=1)


def residuals(squares, counts=100.0, times=1.0):
    squares = np.atleast_1d(np.asarray(squares, dtype=float))
    return Residuals(squares, np.full(squares.shape, counts), np.broadcast_to(times, squares.shape))


def held_out(squares, free=None, price=0.0, counts=100.0):
    windows = residuals(squares, counts)
    return HeldOut(windows, windows if free is None else residuals(free), price, np.ones((1, 1, 1)))


@given(pairs, positive)
def test_the_ratio_knows_no_units_no_order_and_no_favourite(values, unit):
    worse, better, slow, fast = map(np.array, zip(*values, strict=True))
    one, other = residuals(worse, times=slow), residuals(better, times=fast)
    ratio = log_likelihood_ratio(one, other)
    assert log_likelihood_ratio(other, one) == pytest.approx(-ratio)
    scaled = residuals(unit * worse, times=slow), residuals(unit * better, times=fast)
    assert log_likelihood_ratio(*scaled) == pytest.approx(ratio, abs=1e-6)
    turned = residuals(worse[::-1], times=slow[::-1]), residuals(better[::-1], times=fast[::-1])
    assert log_likelihood_ratio(*turned) == pytest.approx(ratio, abs=1e-6)


@pytest.mark.parametrize(
    ("worse", "better", "ratio"), [(np.inf, 1, np.inf), (1, np.inf, -np.inf), (np.inf, np.inf, 0)]
)
def test_what_cannot_be_simulated_is_worse_than_what_can(worse, better, ratio):
    assert log_likelihood_ratio(residuals(worse), residuals(better)) == ratio


def test_what_is_slow_counts_no_more_because_the_other_hypothesis_leaves_it_out():
    slow, fast = residuals(120.0, times=40.0), residuals(110.0, times=2.0)
    assert log_likelihood_ratio(slow, fast) == pytest.approx(100 / 80 * np.log(12 / 11))
    assert log_likelihood_ratio(fast, slow) == pytest.approx(-100 / 80 * np.log(12 / 11))


def test_evidence_grows_with_the_data():
    ratios = [log_likelihood_ratio(residuals(2, n), residuals(1, n)) for n in (10, 100, 1000)]
    np.testing.assert_allclose(ratios, np.log(2) / 2 * np.array([10, 100, 1000]))


@pytest.mark.parametrize("kept", [0.0, 0.5, 0.9, 0.97])
def test_the_autocorrelation_time_of_a_first_order_process_is_the_known_one(kept):
    draws = np.random.default_rng(0).standard_normal((200_000, 1))
    noise = lfilter([1], [1, -kept], draws, axis=0)
    time = autocorrelation_times(noise, np.zeros(len(noise)))
    assert time[0] == pytest.approx((1 + kept) / (1 - kept), rel=0.12)


def test_a_segment_knows_nothing_of_the_next_one():
    noise = np.repeat(np.random.default_rng(0).standard_normal((2000, 1)), 2, axis=0)
    alone = np.arange(len(noise))
    assert autocorrelation_times(noise, alone) == 1.0
    assert autocorrelation_times(noise, np.zeros(len(noise)))[0] == pytest.approx(2.0, rel=0.15)


def noise_of(kept, shape, rng):
    """Return stationary first-order noise, a column an experiment."""
    noise = lfilter(
        [np.sqrt(1 - kept**2)],
        [1, -kept],
        rng.standard_normal((shape[0] + 300, *shape[1:])),
        axis=0,
    )
    return noise[300:]


def evidence_for_a_regressor(signal, noise, folds=4):
    """Return the held-out evidence for a regressor in records of one output."""
    fold = np.arange(noise.size) * folds // noise.size
    rest = np.empty_like(noise)
    for each in range(folds):
        outside = fold != each
        slope = signal[outside] @ noise[outside] / (signal[outside] @ signal[outside])
        rest[~outside] = noise[~outside] - slope * signal[~outside]
    none, one = (
        Residuals(
            np.array([part @ part]),
            np.array([float(part.size)]),
            autocorrelation_times(part[:, None], fold),
        )
        for part in (noise, rest)
    )
    return log_likelihood_ratio(none, one)


@pytest.mark.slow
@pytest.mark.parametrize("kept", [0.0, 0.9, 0.97])
def test_false_alarms_are_no_more_frequent_than_alpha(kept):
    rng, draws = np.random.default_rng(1), 1000
    noise = noise_of(kept, (2000, draws), rng)
    signals = noise_of(0.95, (2000, draws), rng)
    found = [evidence_for_a_regressor(s, e) for s, e in zip(signals.T, noise.T, strict=True)]
    alarms = np.mean(np.array(found) > CRITERION.to_name)
    assert alarms <= ALPHA + 2 * np.sqrt(ALPHA / draws)


@pytest.mark.slow
def test_power_grows_with_the_data_and_coloured_noise_counts_for_less():
    def power(kept, samples):
        rng = np.random.default_rng(2)
        noise, signals = noise_of(kept, (samples, 200), rng), noise_of(0.95, (samples, 200), rng)
        found = [
            evidence_for_a_regressor(s, 0.3 * s + e) > CRITERION.to_name
            for s, e in zip(signals.T, noise.T, strict=True)
        ]
        return np.mean(found)

    few, many = power(0.0, 100), power(0.0, 1000)
    assert few < 0.7 < many
    assert power(0.9, 1000) < many
    assert power(0.9, 1000) < power(0.9, 10_000)


def test_a_cause_needs_evidence_a_share_and_a_free_run_that_agrees():
    many = {"counts": 1e4}
    assert CRITERION.names(held_out(100, **many), held_out(90, **many))
    assert not CRITERION.names(held_out(100), held_out(99.9))  # no evidence
    assert not CRITERION.names(held_out(100, **many), held_out(96, **many))  # not worth saying
    assert CRITERION.names(held_out(100, 100, **many), held_out(96, 90, **many))  # but in free run
    assert not CRITERION.names(held_out(100, 100, **many), held_out(50, 500, **many))  # harms it
    assert not CRITERION.names(held_out(100), held_out(50, price=1e4))  # a memory pays
    assert not CRITERION.names(held_out(100), held_out(np.inf))


def test_what_is_disturbed_along_a_cause_counts_for_less():
    before, after = held_out(100, counts=1e3), held_out(90, counts=1e3)
    needed = CRITERION.evidence(before, after) / CRITERION.to_name
    assert CRITERION.names(before, after, overdispersion=0.99 * needed)
    assert not CRITERION.names(before, after, overdispersion=1.01 * needed)


NOTHING = np.array([False])


def memory(squares, free, tells=None):
    """Return a hypothesis that adds a state."""
    return replace(held_out(squares, free, counts=1e4), n_added=1, tells_in_free_run=tells)


def test_a_memory_is_judged_in_free_run_where_that_says_anything():
    before = held_out(100, 100, counts=1e4)
    assert CRITERION.names(before, memory(50, 90))
    assert not CRITERION.names(before, memory(50, 100))  # free in every window, it says nothing
    assert not CRITERION.names(before, memory(50, 90), retuned=held_out(100, 80, counts=1e4))
    worse = held_out(100, 200, counts=1e4)
    assert not CRITERION.names(before, memory(50, 100), retuned=worse)  # others made it better
    lost = replace(before, tells_in_free_run=NOTHING)
    assert CRITERION.names(lost, memory(50, 100, tells=NOTHING))
    assert not CRITERION.names(lost, memory(100, 50, tells=NOTHING))


def two_outputs(free_runs):
    """Return a hypothesis whose free run tells of the first of two outputs only."""
    counts = np.full(2, 1000.0)
    over_windows = Residuals(np.full(2, 1000.0), counts, np.ones(2))
    free = Residuals(np.array(free_runs), counts, np.ones(2))
    blocks, tells = np.zeros((1, 1, 2)), np.array([True, False])
    return HeldOut(over_windows, free, 0.0, blocks, tells_in_free_run=tells)


def test_a_memory_that_brings_one_output_nearer_must_not_spoil_another():
    counts = np.full(2, 1335.0)
    left, none = Residuals(counts, counts, np.ones(2)), np.zeros((1, 1, 2))
    retuned, nearer, mixed = (
        HeldOut(left, Residuals(squares * counts, counts, np.ones(2)), 0.0, none)
        for squares in np.array([[1.0, 1.0], [1.0, 0.6], [2.2, 0.6]])
    )
    assert CRITERION.stands_in_free_run(retuned, replace(nearer, n_added=1))
    assert not CRITERION.stands_in_free_run(retuned, replace(mixed, n_added=1))


@pytest.mark.parametrize("runaway", [1e4, 1e12, np.inf])
def test_an_output_whose_free_run_runs_away_is_not_asked(runaway):
    retuned = two_outputs([1000.0, 1e8])
    assert CRITERION.stands_in_free_run(retuned, two_outputs([1000.0, runaway]))
    assert not CRITERION.stands_in_free_run(retuned, two_outputs([1100.0, runaway]))


def simulated(errors):
    """Return what a free run with these errors leaves."""
    squares, counts = np.array([np.sum(errors**2)]), np.array([float(errors.size)])
    segment = np.zeros(errors.size, dtype=int)
    return Residuals(squares, counts, np.ones(1), errors[:, None], segment)


def test_a_cause_that_surely_worsens_the_free_run_is_not_named():
    rng = np.random.default_rng(0)
    same, worse = rng.normal(size=4000), 1.2 * rng.normal(size=4000)
    before = replace(held_out(100, counts=1e4), free_run=simulated(same))
    poor, retuned = (replace(before, free_run=simulated(worse * f)) for f in (1.0, 1.1))
    after = replace(held_out(50, counts=1e4), free_run=poor.free_run)
    assert CRITERION.names(poor, after, retuned=retuned)
    assert not CRITERION.names(before, after, retuned=retuned)


def test_a_cause_whose_free_run_diverges_is_not_named():
    same = np.random.default_rng(0).normal(size=4000)
    before = replace(held_out(100, counts=1e4), free_run=simulated(same))
    lost = simulated(np.append(same[1:], np.inf))
    retuned = replace(before, free_run=lost)
    after = replace(held_out(50, counts=1e4), free_run=lost)
    assert CRITERION.names(retuned, after, retuned=retuned)
    assert not CRITERION.names(before, after, retuned=retuned)


def test_a_free_run_that_says_nothing_is_not_worse():
    rng = np.random.default_rng(0)
    same, worse = (simulated(f * rng.normal(size=4000)) for f in (1.0, 1.2))
    one, other = (replace(held_out(100), free_run=run) for run in (same, worse))
    assert CRITERION.runs_worse(one, other)
    assert not CRITERION.runs_worse(other, one)
    silent = np.zeros(1, dtype=bool)
    one, other = (replace(each, tells_in_free_run=silent) for each in (one, other))
    assert not CRITERION.runs_worse(one, other)


def test_a_free_run_that_is_a_little_worse_in_every_sample_is_not_worse_by_what_matters():
    noise = np.random.default_rng(0).normal(size=4000)
    one, near, far = (replace(held_out(100), free_run=simulated(f * noise)) for f in (1, 1.01, 1.1))
    assert accuracy_gained(one.free_run, near.free_run) < -10
    assert not CRITERION.runs_worse(one, near)
    assert CRITERION.runs_worse(one, far)


def test_more_candidates_ask_for_more_evidence():
    asked = [SelectionCriterion(ALPHA, 0.05, n).to_name for n in (1, 10, 100)]
    np.testing.assert_allclose(np.diff(asked), np.log(10))
    assert SelectionCriterion(0.001, 0.05, 1).to_name > asked[0]


def test_the_explained_share_is_that_of_the_output_that_gains_most():
    assert explained_share(residuals([1, 4]), residuals([1, 1])) == 0.75
    assert explained_share(residuals([1, 1]), residuals([2, 1])) == 0.0


@given(st.lists(st.floats(-50, 1e4), min_size=1, max_size=8))
def test_probabilities_sum_to_one_and_follow_the_evidence(evidence):
    found = CRITERION.probabilities(evidence)
    assert found.sum() == pytest.approx(1.0)
    rivals = np.array(evidence[:-1])
    order = np.argsort(rivals)
    assert (np.diff(found[1:-1][order]) <= 1e-12).all()


def test_equal_evidence_is_equal_probability_and_the_threshold_is_even_odds():
    np.testing.assert_allclose(CRITERION.probabilities([0.0, 1e3]), [0.5, 0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(CRITERION.probabilities([CRITERION.to_name]), [0.5, 0.5])


def test_what_cannot_be_simulated_has_no_probability():
    np.testing.assert_allclose(CRITERION.probabilities([-np.inf, 3.0]), [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(CRITERION.probabilities([np.inf, np.inf]), [1, 0, 0], atol=1e-12)


def by_windows(squares):
    """Return what a hypothesis leaves of one output, window by window of a hundred samples."""
    squares = np.asarray(squares, dtype=float)
    windows = residuals(squares.sum(), 100.0 * squares.size)
    return HeldOut(windows, windows, 0.0, squares[:, None, None])


left = st.lists(st.tuples(st.floats(50, 500), st.floats(50, 500)), min_size=2, max_size=30)


@given(left, st.floats(1.0, 10.0))
def test_rivals_are_told_apart_the_same_in_either_order(squares, overdispersion):
    one, other = map(by_windows, zip(*squares, strict=True))
    there, back = (
        CRITERION.separation(*pair, overdispersion) for pair in ((one, other), (other, one))
    )
    assert there == pytest.approx(-back)
    assert there * CRITERION.evidence(one, other) >= 0.0
    assert abs(there) <= abs(CRITERION.evidence(one, other)) / overdispersion * (1 + 1e-12)


def test_what_one_window_decides_separates_nothing():
    alike = by_windows([200, 100, 100, 100, 100, 100])
    assert CRITERION.separation(by_windows([100, 130, 100, 100, 100, 100]), alike, 1.0) == 0.0
    everywhere = by_windows([160, 130, 140, 150, 135, 145])
    assert CRITERION.separation(everywhere, by_windows([100] * 6), 1.0) > CRITERION.to_refute


def test_the_error_of_a_ratio_is_that_of_its_repetitions():
    """Two hypotheses whose errors are as large: only chance prefers one."""
    rng, ratios, errors = np.random.default_rng(0), [], []
    for _ in range(400):
        pair = [by_windows(rng.chisquare(20, 50)) for _ in range(2)]
        ratios.append(CRITERION.evidence(*pair))
        errors.append(ratio_error(*pair))
    assert np.std(ratios) == pytest.approx(np.mean(errors), rel=0.1)


def test_the_improbable_is_no_rival():
    rivals = [("near", 1.0), ("far", 4.7), ("same", 0.0)]
    assert CRITERION.probable(rivals, 50.0) == [("same", 0.0), ("near", 1.0)]


def test_simulations_of_equal_accuracy_are_taken_for_different_as_often_as_alpha():
    rng, beyond = np.random.default_rng(0), 0
    for _ in range(400):
        slow = lfilter([1.0], [1.0, -0.95], rng.normal(size=(2, 2000)), axis=1)
        beyond += accuracy_gained(simulated(slow[0]), simulated(slow[1])) < -norm.ppf(1 - 0.05)
    assert 0.02 < beyond / 400 < 0.1


@given(st.floats(1e-6, 1e6))
def test_the_gain_of_accuracy_knows_no_units_and_no_favourite(unit):
    near, far = np.random.default_rng(0).normal(size=(2, 500)) * [[1.0], [1.5]]
    gained = accuracy_gained(simulated(far), simulated(near))
    assert gained > 3.0
    assert accuracy_gained(simulated(near), simulated(far)) == pytest.approx(-gained)
    scaled = accuracy_gained(simulated(unit * far), simulated(unit * near))
    assert scaled == pytest.approx(gained, rel=1e-6)


def test_a_simulation_that_diverges_is_the_worse_one():
    errors = np.random.default_rng(0).normal(size=500)
    finite, lost = simulated(errors), simulated(np.append(errors[1:], np.inf))
    assert accuracy_gained(finite, lost) == -np.inf
    assert accuracy_gained(lost, finite) == np.inf
    assert accuracy_gained(lost, lost) == 0.0


def test_rows_without_a_measured_value_change_nothing():
    rng = np.random.default_rng(0)
    rest = np.cumsum(rng.normal(size=(400, 1)), axis=0) % 3.0
    sparse = np.full((800, 1), np.nan)
    sparse[::2] = rest
    segment, starts = np.repeat([0, 1], 200), np.array([0, 200])
    assert np.allclose(white_power(sparse, 2 * starts), white_power(rest, starts))
    assert np.allclose(
        autocorrelation_times(sparse, np.repeat(segment, 2)), autocorrelation_times(rest, segment)
    )


def test_what_stays_all_through_a_window_counts_once_for_it():
    """The mean over windows is then as uncertain as of one sample in each."""
    constant = np.repeat(np.random.default_rng(0).normal(size=50), 40)[:, None]
    (time,) = autocorrelation_times(constant, np.repeat(np.arange(50), 40))
    assert time == pytest.approx(40.0)
