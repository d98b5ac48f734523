"""Which frictions stick: the solution of the complementarity problem, found by other ways too."""

from itertools import product

import numpy as np
import pytest
from numba import njit

from sklearn_pgnn.simulation.complementarity import balance_workspace, solve_signs


@njit
def _solve(A, b, rest, s, stuck):
    (_, _, table, right), order, _ = balance_workspace(s.size)
    solve_signs(A, b, rest, s, stuck, table, right, order)


def solve(A, b, rest=None):
    """Return the signs, which flows stick, and the rates."""
    k = len(b)
    rest = np.ones(k, dtype=bool) if rest is None else np.array(rest)
    s, stuck = np.zeros(k), np.zeros(k, dtype=bool)
    _solve(np.ascontiguousarray(A, dtype=float), np.array(b, dtype=float), rest, s, stuck)
    return s, stuck, b - A @ s


def enumerated(A, b):
    """Return the rates of the one choice of sticking and sliding that is allowed, by trying all."""
    k, found = len(b), []
    for sides in product((-1.0, 0.0, 1.0), repeat=k):
        s = np.array(sides)
        free = s == 0
        s[free] = np.linalg.solve(A[np.ix_(free, free)], (b - A @ s)[free])
        rates = np.where(free, 0.0, b - A @ s)
        if np.all(np.abs(s) <= 1 + 1e-12) and np.all(rates * np.where(free, 0, s) >= -1e-12):
            found.append((s, rates))
    return found


def machine(rng, k, n=None):
    """Return the matrix of k frictions in a machine of n velocities, and rates without them."""
    n = k if n is None else n
    C = rng.normal(size=(k, n))
    M = rng.normal(size=(n, n))
    inverse = np.linalg.inv(M @ M.T + 0.1 * np.eye(n))
    levels = 10 ** rng.uniform(-2, 1, k)
    return C @ inverse @ C.T * levels, C @ inverse @ rng.normal(size=n)


@pytest.mark.parametrize("seed", range(60))
def test_the_solution_is_the_only_one_that_enumeration_finds(seed):
    rng = np.random.default_rng(seed)
    A, b = machine(rng, int(rng.integers(1, 6)))
    (s, rates), *others = enumerated(A, b)
    assert not others
    found, stuck, found_rates = solve(A, b)
    np.testing.assert_allclose(found, s, atol=1e-9)
    np.testing.assert_allclose(found_rates, rates, atol=1e-9 * np.abs(A).sum())
    assert np.array_equal(stuck, rates == 0)


@pytest.mark.parametrize("seed", range(40))
def test_up_to_a_dozen_frictions_obey_the_law(seed):
    rng = np.random.default_rng(seed)
    A, b = machine(rng, int(rng.integers(6, 13)))
    assert_lawful(A, b, *solve(A, b))


def assert_lawful(A, b, s, stuck, rates, size=1e-9):
    least = size * (np.abs(b) + np.abs(A) @ np.abs(s))
    assert np.all(np.abs(s) <= 1)
    assert np.all(np.abs(rates[stuck]) <= least[stuck])
    assert np.all(np.abs(s[~stuck]) == 1)
    assert np.all((rates * s)[~stuck] >= -least[~stuck])


@pytest.mark.parametrize("seed", range(40))
def test_more_frictions_than_ways_to_move_share_the_load(seed):
    rng = np.random.default_rng(seed)
    A, b = machine(rng, 5, n=3)
    assert_lawful(A, b, *solve(A, b), size=1e-4)


def test_a_friction_that_is_none_holds_nothing():
    A, b = np.diag([0.0, 2.0]), np.array([0.3, 1.0])
    s, stuck, rates = solve(A, b)
    assert s.tolist() == [1.0, 0.5]
    assert stuck.tolist() == [False, True]
    assert rates[0] == 0.3


@pytest.mark.parametrize("seed", range(20))
def test_frictions_that_drive_end_all_the_same(seed):
    rng = np.random.default_rng(seed)
    s, _, _ = solve(rng.normal(size=(4, 4)), rng.normal(size=4))
    assert np.all(np.abs(s) <= 1)


def test_what_moves_already_is_left_alone():
    A, b = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([1.0, 5.0])
    s, stuck, _ = solve(A, b, rest=[True, False])
    assert s.tolist() == [0.5, 0.0]
    assert stuck.tolist() == [True, False]
