"""The compiled step behind `sklearn_pgnn.simulation.dissipation`, with its derivatives."""

import numpy as np
from numba import njit

from sklearn_pgnn.simulation.stepping import INNER, OPTIONS


@njit(**OPTIONS)
def loss_workspace(m):
    """Allocate what `lose` needs: L, the inverse, K, 1 - dt K H, f, w and the change."""
    return np.zeros((5, m, m)), np.zeros((4, m))


@njit(**INNER)
def _invert(matrix, inverse):
    """Invert a symmetric positive definite matrix, which is spoilt; no pivot is needed."""
    m = matrix.shape[0]
    for i in range(m):
        for j in range(m):
            inverse[i, j] = 1.0 if i == j else 0.0
    for p in range(m):
        pivot = matrix[p, p]
        for j in range(m):
            matrix[p, j] /= pivot
            inverse[p, j] /= pivot
        for i in range(m):
            if i != p:
                factor = matrix[i, p]
                for j in range(m):
                    matrix[i, j] -= factor * matrix[p, j]
                    inverse[i, j] -= factor * inverse[p, j]


@njit(**INNER)
def lose(out, parts, root, dt, matrices, vectors):
    """Take energy out of some states: the change is the last of ``vectors``.

    ``parts`` holds the energy's slopes and its Hessian. Of ``matrices`` the first is L and the
    second the inverse of 1 + dt L' H L.
    """
    m = root.size
    L, inverse, B = matrices[0], matrices[1], matrices[2]
    w, change = vectors[1], vectors[3]
    place = 0
    for i in range(m):
        for j in range(m):
            L[i, j] = 0.0
        for j in range(i + 1):
            L[i, j] = root[i] * (out[place] + (1.0 if i == j else 0.0))
            place += 1
    for i in range(m):
        for j in range(m):
            B[i, j] = 1.0 if i == j else 0.0
            for a in range(m):
                for b in range(m):
                    B[i, j] += dt * L[a, i] * parts[m + a * m + b] * L[b, j]
    _invert(B, inverse)
    for i in range(m):
        vectors[0, i] = 0.0
        for a in range(m):
            vectors[0, i] += L[a, i] * parts[a]
    for i in range(m):
        w[i] = 0.0
        for j in range(m):
            w[i] += inverse[i, j] * vectors[0, j]
    for i in range(m):
        change[i] = 0.0
        for j in range(m):
            change[i] -= dt * L[i, j] * w[j]


@njit(**INNER)
def lose_slopes(parts, slopes, root, dt, matrices, vectors, by_out, by_x):
    """Differentiate the change that `lose` has found, by the outputs and by the states.

    ``slopes`` are the derivatives of ``parts`` by all states, row by row.
    """
    m, nx = root.size, by_x.shape[1]
    L, inverse, K, left, across = (
        matrices[0], matrices[1], matrices[2], matrices[3], matrices[4],
    )  # fmt: skip
    f, w, turned, change = vectors[0], vectors[1], vectors[2], vectors[3]
    for i in range(m):
        f[i] = parts[i]
        for j in range(m):
            f[i] += parts[m + i * m + j] * change[j]
            across[i, j] = 0.0
            for b in range(m):
                across[i, j] += L[i, b] * inverse[b, j]
    for i in range(m):
        for j in range(m):
            K[i, j] = 0.0
            for b in range(m):
                K[i, j] += across[i, b] * L[j, b]
    for i in range(m):
        for j in range(m):
            left[i, j] = 1.0 if i == j else 0.0
            for b in range(m):
                left[i, j] -= dt * K[i, b] * parts[m + b * m + j]
    place = 0
    for i in range(m):
        for j in range(i + 1):
            for n in range(m):
                by_out[n, place] = -dt * root[i] * (left[n, i] * w[j] + across[n, j] * f[i])
            place += 1
    for q in range(nx):
        for i in range(m):
            turned[i] = slopes[i * nx + q]
            for j in range(m):
                turned[i] += slopes[(m + i * m + j) * nx + q] * change[j]
        for n in range(m):
            by_x[n, q] = 0.0
            for i in range(m):
                by_x[n, q] -= dt * K[n, i] * turned[i]
