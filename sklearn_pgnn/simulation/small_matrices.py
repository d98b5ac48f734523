"""Linear algebra of small matrices, compiled: calling LAPACK takes longer than they do."""

import math

from numba import njit

from sklearn_pgnn.simulation.stepping import APART

#: sweeps of Jacobi's rotations; they converge quadratically, a matrix of rank ten takes seven
MAX_SWEEPS = 40
#: share of a matrix's square that may be left beside its diagonal: none, to a double's rounding
LEFT = 1e-32


@njit(**APART)
def _rotate(matrix, vectors, p, q):
    """Rotate two axes so that the matrix couples them no more."""
    beside = matrix[p, q]
    if beside == 0.0:
        return
    half = 0.5 * (matrix[q, q] - matrix[p, p]) / beside
    tangent = 1.0 / (abs(half) + math.sqrt(half * half + 1.0))
    if half < 0.0:
        tangent = -tangent
    cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    for k in range(matrix.shape[0]):
        at_p, at_q = matrix[k, p], matrix[k, q]
        matrix[k, p] = cosine * at_p - sine * at_q
        matrix[k, q] = sine * at_p + cosine * at_q
        at_p, at_q = vectors[k, p], vectors[k, q]
        vectors[k, p] = cosine * at_p - sine * at_q
        vectors[k, q] = sine * at_p + cosine * at_q
    for k in range(matrix.shape[0]):
        at_p, at_q = matrix[p, k], matrix[q, k]
        matrix[p, k] = cosine * at_p - sine * at_q
        matrix[q, k] = sine * at_p + cosine * at_q
    matrix[p, q] = matrix[q, p] = 0.0


@njit(**APART)
def diagonalise(matrix, vectors):
    r"""Diagonalise a symmetric matrix in place by Jacobi's rotations.

    With the eigenvectors in the columns of :math:`V`, the matrix becomes :math:`V^T A V`.

    Parameters
    ----------
    matrix : ndarray of shape (n, n)
        The matrix :math:`A`; its diagonal becomes the eigenvalues, in no order.
    vectors : ndarray of shape (n, n)
        Filled with :math:`V`.
    """
    n = matrix.shape[0]
    for i in range(n):
        for j in range(n):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(MAX_SWEEPS):
        beside = diagonal = 0.0
        for i in range(n):
            diagonal += matrix[i, i] ** 2
            for j in range(i):
                beside += matrix[i, j] ** 2
        if not beside > LEFT * diagonal:
            return
        for i in range(n):
            for j in range(i):
                _rotate(matrix, vectors, j, i)


@njit(**APART)
def _reflect(table, target, j, n):
    """Reflect column j onto axis j, all that follows with it, and return its length there."""
    square = 0.0
    for i in range(j, target.size):
        square += table[i, j] ** 2
    length = -math.copysign(math.sqrt(square), table[j, j])
    table[j, j] -= length
    half = -length * table[j, j]
    for k in range(j + 1, n + 1):
        share = 0.0
        for i in range(j, target.size):
            share += table[i, j] * (table[i, k] if k < n else target[i])
        for i in range(j, target.size):
            if k < n:
                table[i, k] -= share / half * table[i, j]
            else:
                target[i] -= share / half * table[i, j]
    return length


@njit(**APART)
def solve_least_squares(table, target, x, n):
    r"""Solve a least-squares problem of full rank by Householder's reflections.

    Parameters
    ----------
    table : ndarray of shape (n_rows, n_columns)
        The first columns are the table :math:`A`, overwritten.
    target : ndarray of shape (n_rows,)
        The target :math:`b`, overwritten.
    x : ndarray of shape (n_columns,)
        Its first values become the :math:`x` of the least :math:`|A x - b|`.
    n : int
        Number of columns of :math:`A`.
    """
    for j in range(n):
        x[j] = _reflect(table, target, j, n)
    for j in range(n - 1, -1, -1):
        left = target[j]
        for k in range(j + 1, n):
            left -= table[j, k] * x[k]
        x[j] = left / x[j]
