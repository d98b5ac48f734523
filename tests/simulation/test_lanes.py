"""Sums and hyperbolic tangents of eight neurons at once."""

import numpy as np
import pytest
from numba import njit

from sklearn_pgnn.simulation.lanes import LANES, tanh_lanes, weigh


@njit
def all_tangents(given, found):
    for row in range(given.shape[0]):
        for place in range(0, given.shape[1], LANES):
            tanh_lanes(given, found, row, place)


@njit
def weighed(weights, bias, first, stride, n_in, given, row, sums, place):
    weigh(weights, bias, first, stride, n_in, given, row, sums, place)


def tangents(values):
    given = np.zeros((2, -(-len(values) // (2 * LANES)) * LANES))
    given.flat[: len(values)] = values
    found = np.full(given.shape, -7.0)
    all_tangents(given, found)
    return found.ravel()[: len(values)]


@pytest.mark.parametrize("reach", [1e-9, 0.4, 3.0, 25.0, 1e3, 1e300])
def test_the_tangent_is_right_to_the_last_digits_of_one(reach):
    values = np.concatenate([np.linspace(-reach, reach, 4001), reach * np.geomspace(1e-9, 1, 800)])
    np.testing.assert_allclose(tangents(values), np.tanh(values), rtol=0, atol=4e-16)


def test_the_tangent_of_what_is_no_number():
    values = np.array([np.inf, -np.inf, np.nan, 0.0, -0.0])
    np.testing.assert_array_equal(tangents(values), [1.0, -1.0, np.nan, 0.0, 0.0])


@pytest.mark.parametrize("n_in", [0, 1, 7, 20])
def test_weighs_one_row_into_the_lanes_of_the_next(n_in):
    random = np.random.default_rng(0)
    wide, lane, row = 3 * LANES, LANES, 1
    weights, given = random.normal(size=(n_in + 1) * wide + 5), random.normal(size=(3, 24))
    sums = np.zeros((3, wide))
    weighed(weights, 5 + n_in * wide + lane, 5 + lane, wide, n_in, given, row, sums, lane)
    matrix = weights[5:].reshape(n_in + 1, wide)
    expected = np.zeros((3, wide))
    expected[row + 1, lane : 2 * lane] = (given[row, :n_in] @ matrix[:-1] + matrix[-1])[
        lane : 2 * lane
    ]
    np.testing.assert_allclose(sums, expected, atol=1e-14)
