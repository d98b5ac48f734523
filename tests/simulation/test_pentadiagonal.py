"""Equations whose matrix has two diagonals on either side of its own."""

import numpy as np
import pytest

from sklearn_pgnn.simulation.pentadiagonal import solve_pentadiagonal


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
