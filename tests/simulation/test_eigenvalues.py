"""Eigenvalues of small matrices are LAPACK's."""

import numpy as np
import pytest
from numba import njit

from sklearn_pgnn.simulation.eigenvalues import diagonalise

pytestmark = pytest.mark.core


@njit
def run(matrix, vectors):
    """Call what only compiled code can call."""
    diagonalise(matrix, vectors)


@pytest.mark.parametrize("n", range(1, 12))
def test_a_diagonalised_matrix_has_the_eigenvalues_of_lapack(n):
    rng = np.random.default_rng(n)
    for spread in (0.0, 3.0, 8.0):
        axes = np.linalg.qr(rng.normal(size=(n, n)))[0]
        matrix = axes @ np.diag(10.0 ** rng.uniform(-spread, 0, n)) @ axes.T
        matrix = 0.5 * (matrix + matrix.T)
        found, vectors = matrix.copy(), np.empty((n, n))
        run(found, vectors)
        size = np.abs(matrix).max()
        assert np.sort(np.diag(found)) == pytest.approx(
            np.linalg.eigvalsh(matrix), abs=1e-14 * size
        )
        assert vectors.T @ vectors == pytest.approx(np.eye(n), abs=1e-13)
        again = vectors @ np.diag(np.diag(found)) @ vectors.T
        assert again == pytest.approx(matrix, abs=1e-13 * size)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_zeros_and_what_is_not_finite_are_left_as_they_are(value):
    matrix, vectors = np.full((3, 3), value), np.empty((3, 3))
    run(matrix, vectors)
    assert np.array_equal(matrix, np.full((3, 3), value), equal_nan=True)
    assert np.array_equal(vectors, np.eye(3))
