"""Eigenvalues of small matrices, compiled: a call of LAPACK takes longer than they do."""

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
    """Diagonalise a symmetric matrix in place by Jacobi's rotations.

    With the eigenvectors in the columns of :math:`V`, the matrix becomes :math:`V^T A V`.

    The matrix is :math:`A`; its diagonal becomes the eigenvalues, in no order, and `vectors` is
    filled with :math:`V`. The largest eigenvalue is returned, zero if all are negative.
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
            break
        for i in range(n):
            for j in range(i):
                _rotate(matrix, vectors, j, i)
    largest = 0.0
    for i in range(n):
        largest = max(largest, matrix[i, i])
    return largest
