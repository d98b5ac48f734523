"""Solve symmetric equations whose matrix has two diagonals on either side of its own, compiled.

LAPACK calls BLAS for every column of such a matrix, which takes longer than the arithmetic.
"""

import numpy as np
from numba import njit, types

from sklearn_pgnn.simulation.stepping import OPTIONS

_F1, _F2 = types.float64[::1], types.float64[:, ::1]


@njit(_F2(_F2, _F2, _F1, _F1), **OPTIONS)
def solve_pentadiagonal(A, B, factors, b):
    r"""Solve :math:`(A + cB)\,x = b` for several factors :math:`c`, by :math:`LDL^T`.

    A and B are given by their diagonals and the two below, filled up by zeros; their sum is
    positive definite. Column j of the result is the solution for ``factors[j]``, between two rows
    of zeros at its beginning and two at its end.
    """
    n, width = b.size, factors.size
    D, x = np.zeros((n + 2, width)), np.zeros((n + 4, width))
    near, far = np.zeros((n + 2, width)), np.zeros((n + 2, width))  # the diagonals of L
    for i in range(n):
        k = i + 2
        for j in range(width):
            c, before = factors[j], near[k - 1, j] * D[k - 1, j]
            pivot = A[0, i] + c * B[0, i] - near[k - 1, j] * before
            pivot -= far[k - 2, j] * far[k - 2, j] * D[k - 2, j]
            D[k, j] = pivot
            near[k, j] = (A[1, i] + c * B[1, i] - far[k - 1, j] * before) / pivot
            far[k, j] = (A[2, i] + c * B[2, i]) / pivot
            x[k, j] = b[i] - near[k - 1, j] * x[k - 1, j] - far[k - 2, j] * x[k - 2, j]
    for k in range(n + 1, 1, -1):
        for j in range(width):
            x[k, j] = x[k, j] / D[k, j] - near[k, j] * x[k + 1, j] - far[k, j] * x[k + 2, j]
    return x
