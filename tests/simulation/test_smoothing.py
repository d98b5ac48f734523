"""Smoothing splines: SciPy's, set up once; what no penalty changes; the choice of the penalty."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_smoothing_spline

from sklearn_pgnn import systems
from sklearn_pgnn.simulation.smoothed_output import FEWEST, choose_penalty, smooth
from sklearn_pgnn.simulation.smoothing import PENALTIES, NaturalSpline, solve_pentadiagonal
from sklearn_pgnn.simulation.state_estimate import StateEstimator, hidden_states
from sklearn_pgnn.simulation.windows import ShootingWindows


def below(matrix):
    """Return the diagonal of a matrix and the two below it, filled up by zeros."""
    found = np.zeros((3, len(matrix)))
    for i in range(min(3, len(matrix))):
        found[i, : len(matrix) - i] = np.diagonal(matrix, -i)
    return found


def positive(random, n):
    """Make a symmetric positive definite matrix with five diagonals."""
    lower = np.tril(np.triu(random.normal(size=(n, n)), -2)) + 2 * np.eye(n)
    return lower @ lower.T


@pytest.mark.parametrize("n", [1, 2, 3, 4, 30])
def test_solves_for_every_factor_between_rows_of_zeros(n):
    random = np.random.default_rng(n)
    A, B, b = positive(random, n), positive(random, n), random.normal(size=n)
    factors = np.array([0.0, 1e-3, 1.0, 1e6])
    x = solve_pentadiagonal(below(A), below(B), factors, b)
    expected = np.array([np.linalg.solve(A + factor * B, b) for factor in factors]).T
    np.testing.assert_allclose(x[2:-2], expected, rtol=1e-7, atol=1e-9)
    assert not x[:2].any()
    assert not x[-2:].any()


def record(n, clock="even", seed=0):
    """Return samples of a noisy sine."""
    rng = np.random.default_rng(seed)
    t = np.arange(n, dtype=float) if clock == "even" else np.cumsum(rng.uniform(0.2, 2.0, n))
    return t, np.sin(t / 7) + 0.1 * rng.standard_normal(n)


@pytest.mark.parametrize("clock", ["even", "uneven"])
@pytest.mark.parametrize("n", [FEWEST, 7, 300])
def test_the_spline_is_that_of_scipy(n, clock):
    t, y = record(n, clock)
    spline = NaturalSpline(t, y)
    at = np.linspace(t[0] - 1, t[-1] + 1, 500)
    for penalty in [0.0, *PENALTIES[PENALTIES < 1e7]]:  # beyond, SciPy's rounding shows
        ours, theirs = spline.smoothed(penalty), make_smoothing_spline(t, y, lam=penalty)
        np.testing.assert_allclose(ours(at), theirs(at), atol=1e-8)
        np.testing.assert_allclose(ours.derivative()(at), theirs.derivative()(at), atol=1e-8)


def test_many_penalties_are_each_of_them():
    t, y = record(40, "uneven")
    spline = NaturalSpline(t, y)
    together = spline.smoothed(PENALTIES)(t + 0.1)
    for penalty, values in zip(PENALTIES, together.T, strict=True):
        np.testing.assert_allclose(values, spline.smoothed(penalty)(t + 0.1), rtol=1e-12)


@pytest.mark.parametrize("penalty", PENALTIES)
def test_no_penalty_changes_sum_and_first_moment(penalty):
    t, y = record(200, "uneven")
    left = y - NaturalSpline(t, y).smoothed(penalty)(t)
    assert abs(left.sum()) < 1e-6
    assert abs(left @ t) < 1e-6 * t[-1]


def test_from_interpolation_to_the_straight_line():
    t, y = record(10, "uneven")
    natural = CubicSpline(t, y, bc_type="natural")
    np.testing.assert_allclose(NaturalSpline(t, y).smoothed(0.0)(t + 0.05), natural(t + 0.05))
    line = np.polyval(np.polyfit(t, y, 1), t)
    for penalty in PENALTIES[PENALTIES >= 1e4]:  # what is left falls as the penalty grows
        bend = np.abs(NaturalSpline(t, y).smoothed(penalty)(t) - line).max()
        assert bend < 100 / penalty


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.3])
def test_the_choice_is_that_of_five_folds_with_scipys_spline(noise):
    rng = np.random.default_rng(1)
    t = np.arange(400.0)
    y = np.sin(t / 9) + noise * rng.standard_normal(t.size)
    errors = np.zeros(PENALTIES.size)
    for k in range(5):
        left_out = np.zeros(t.size, dtype=bool)
        left_out[2 + k : -2 : 5] = True
        for i, penalty in enumerate(PENALTIES):
            spline = make_smoothing_spline(t[~left_out], y[~left_out], lam=penalty)
            errors[i] += np.sum((spline(t[left_out]) - y[left_out]) ** 2)
    assert choose_penalty(t, y) == PENALTIES[np.argmin(errors)]


def test_the_unit_of_time_does_not_matter():
    t, y = record(100)
    slow, fast = smooth(t, y), smooth(1e-4 * t + 5, y)
    np.testing.assert_allclose(slow.value(t), fast.value(1e-4 * t + 5), atol=1e-8)
    np.testing.assert_allclose(slow.slope(t), 1e-4 * fast.slope(1e-4 * t + 5), atol=1e-8)


def test_few_samples_are_a_straight_line():
    curve = smooth(np.array([1.0, 2.0, 3.0]), np.array([1.0, np.nan, 5.0]))
    assert curve.value(2.0) == pytest.approx(3.0)
    assert curve.slope(7.0) == pytest.approx(2.0)


def test_states_alone_are_those_of_the_estimate():
    cart = systems.cart_on_spring()
    t, y = record(200)
    bounds = np.array([0, t.size])
    windows = ShootingWindows(
        t, np.zeros((t.size, 1)), y[:, None], bounds, bounds[:1], bounds[1:], [0.1]
    )
    states = StateEstimator(cart, windows, [np.full(2, np.nan)])
    np.testing.assert_array_equal(states.values(cart), states.estimate(cart).x)
    assert hidden_states(cart) == states.hidden(cart) == ()
