"""Laws of the share that a fit leaves of another's squares."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sklearn_pgnn.estimation.squares_left import share_left

squares = st.lists(st.floats(0.1, 100.0), min_size=6, max_size=6).map(np.array)


@given(squares, squares, st.floats(1e-3, 1e3))
def test_a_share_knows_no_units_and_lies_in_its_interval(before, after, unit):
    found = share_left(before, after)
    assert found.low <= found.left <= found.high
    assert share_left(unit * before, unit * after) == pytest.approx(found)


@given(squares)
def test_what_is_left_alike_everywhere_is_sure(before):
    assert share_left(before, 0.3 * before) == pytest.approx((0.3, 0.3, 0.3))


def test_the_interval_holds_the_share_of_many_windows():
    rng, held = np.random.default_rng(0), 0
    for _ in range(500):
        before = rng.chisquare(50, 20)
        _, low, high = share_left(before, 0.2 * before * rng.gamma(9, 1 / 9, 20))
        held += low < 0.2 < high
    assert 0.92 < held / 500 < 0.98


def test_one_window_tells_no_interval():
    assert share_left(np.array([2.0]), np.array([1.0])) == (0.5, 0.0, np.inf)
