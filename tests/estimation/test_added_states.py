"""What added states cost: the integral over their values, whatever they are called."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn.estimation.added_states import PARTS, price_of_states


def price(told, moved, n=1, power=1.0, first=None, driven=None):
    """Return the price of states whose outputs tell so much of them, and that moved so far."""
    first = np.zeros(len(moved)) if first is None else first
    driven = np.zeros(moved.shape[1], bool) if driven is None else driven
    return price_of_states(told, moved, power, first, driven, n)


def drawn(seed, count):
    """Return information matrices of some windows, and deviations."""
    rng = np.random.default_rng(seed)
    slopes = rng.normal(size=(count, 20, 2)) * 10.0 ** rng.uniform(-2, 2, (count, 1, 2))
    return np.einsum("wni,wnj->wij", slopes, slopes), rng.normal(size=(count, 2))


windows_drawn = st.builds(drawn, st.integers(0, 1000), st.integers(1, 6))


@given(windows_drawn)
def test_a_memory_has_a_price_that_grows_with_the_windows_and_with_what_they_show(windows):
    told, moved = windows
    whole = price(told, moved)
    each = [price(told[[w]], moved[[w]]) for w in range(len(moved))]
    assert min(each) >= 0.0
    assert whole >= sum(each) - 1e-9  # within one part of the spread in all windows
    assert price(10.0 * told, moved) >= whole - 1e-9
    assert price(told, 2.0 * moved) >= whole - 1e-9
    assert price(told, moved, n=2) >= whole
    assert price(told, moved, n=0) == 0.0


@given(windows_drawn)
def test_the_price_does_not_depend_on_which_state_is_called_the_added_one(windows):
    told, moved = windows
    exchanged = price(told[:, ::-1, ::-1], moved[:, ::-1])
    assert exchanged == pytest.approx(price(told, moved), rel=1e-6, abs=1e-9)


def test_states_that_begin_where_they_are_expected_cost_little_and_others_much():
    told = np.tile(np.diag([1e6, 1e4]), (50, 1, 1))
    assert price(told, np.zeros((50, 2))) < 1.0
    assert price(told, np.ones((50, 2))) > 50.0


@given(windows_drawn, st.integers(1, 2))
def test_at_the_start_of_a_record_every_state_costs_the_same(windows, n):
    told, moved = windows
    values = np.full(len(moved), 50)
    expected = 0.5 * n * len(moved) * np.log(50)
    for driven in ([False, False], [False, True]):
        assert price(told, moved, n, first=values, driven=np.array(driven)) == pytest.approx(
            expected
        )


@given(st.floats(1e-2, 1e4), st.floats(-3, 3), st.floats(1.0, 1e4), st.booleans())
def test_the_price_is_that_of_the_integral_over_the_initial_value(told, seen, power, is_driven):
    r"""Here Laplace's method is exact: :math:`-\log\int N(z; 0, c^2) e^{-g(z - a)^2/2} dz`.

    Residuals with more power than the noise's tell less of the initial value, though the fit has
    believed them. The part of the spread, c, is the one that makes it likeliest.
    """
    fitted = told * seen / (told + 1.0)
    told /= power
    left = told * (fitted - seen) ** 2 / 2
    weights = 1.0 / PARTS**2
    integral = np.log1p(told / weights) / 2 + told * weights / (told + weights) * seen**2 / 2
    driven = np.array([False, is_driven])
    found = price(np.diag([1e9, told])[None], np.array([[0.0, fitted]]), power=power, driven=driven)
    assert found + left == pytest.approx(integral.min(), rel=1e-6, abs=1e-9)
