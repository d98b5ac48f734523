r"""Which of several dry frictions stick and which slide: a complementarity problem.

At rest the signs :math:`s_i \in [-1, 1]` and the rates :math:`r = b - A s` of the flows satisfy

.. math:: |s_i| < 1 \Rightarrow r_i = 0, \qquad s_i = 1 \Rightarrow r_i \ge 0, \qquad
          s_i = -1 \Rightarrow r_i \le 0.

With :math:`A = C M^{-1} C^T \mathrm{diag}(F)`, from an inverse mass matrix and friction forces
:math:`F`, there is one solution of the rates. It is found by Murty's principal pivots for
bounded variables [1]_, which end where :math:`A` is a P-matrix. For any other matrix (a friction
that drives, more frictions at rest than ways to move) Gauss-Seidel sweeps follow.

References
----------
.. [1] J. J. Júdice, F. M. Pires, "Basic-set algorithm for a generalized linear complementarity
   problem", Journal of Optimization Theory and Applications 74, 1992, :doi:`10.1007/BF00940319`.
"""

import numpy as np
from numba import njit

from sklearn_pgnn.simulation.disk_cache import numba_caches

OPTIONS = {"cache": numba_caches(), "error_model": "numpy", "nogil": True}
#: for functions that allocate nothing, called by compiled ones only: counting references takes
#: longer than a step, and wrappers for other callers take long to compile
APART = {**OPTIONS, "_nrt": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
#: a pivot or a rate that is so small a share of its parts is none
ROUNDING = 1e-10
#: most pivots for a flow, and Gauss-Seidel sweeps where they do not end
MAX_PIVOTS, SWEEPS = 40, 200


@njit(**OPTIONS)
def balance_workspace(k):
    """Return room for the balance of k flows: A and b, what is solved for, and where it stands."""
    numbers = np.zeros((k, k)), np.zeros(k), np.zeros((k, k + 1)), np.zeros(k)
    return numbers, np.zeros(k, dtype=np.int64), np.zeros(k, dtype=np.bool_)


@njit(**APART)
def solve_some(A, right, wanted, table, order, found):
    """Solve for the wanted unknowns in place of ``found``; one without a pivot becomes zero.

    Principal minors of friction are positive, so pivots are not searched for.
    """
    n = 0
    for i in range(wanted.size):
        if wanted[i]:
            order[n] = i
            n += 1
    for a in range(n):
        for c in range(n):
            table[a, c] = A[order[a], order[c]]
        table[a, n] = right[order[a]]
    _eliminate(A, n, table, order)
    for a in range(n - 1, -1, -1):
        value = table[a, n]
        for c in range(a + 1, n):
            value -= table[a, c] * found[order[c]]
        found[order[a]] = value / table[a, a] if _is_pivot(A, a, table, order) else 0.0


@njit(**APART)
def _is_pivot(A, a, table, order):
    """Return whether a pivot is more than rounding."""
    return table[a, a] > ROUNDING * abs(A[order[a], order[a]])


@njit(**APART)
def _eliminate(A, n, table, order):
    """Make a table of n rows triangular."""
    for a in range(n):
        if not _is_pivot(A, a, table, order):
            continue
        for c in range(a + 1, n):
            share = table[c, a] / table[a, a]
            for d in range(a + 1, n + 1):
                table[c, d] -= share * table[a, d]


@njit(**APART)
def _rate(A, b, s, rest, i):
    """Return a flow's rate, and how large it is to be more than rounding."""
    rate, size = b[i], abs(b[i])
    for j in range(s.size):
        part = A[i, j] * s[j] if rest[j] else 0.0
        rate -= part
        size += abs(part)
    return rate, ROUNDING * size


@njit(**APART)
def _misplaced(A, b, s, rest, stuck):
    """Return the last flow whose sign or rate is not allowed, or -1."""
    for i in range(s.size - 1, -1, -1):
        if not rest[i]:
            continue
        if stuck[i] and abs(s[i]) > 1.0:
            return i
        rate, least = _rate(A, b, s, rest, i)
        if abs(rate) > least and (stuck[i] or rate * s[i] < 0.0):
            return i
    return -1


@njit(**APART)
def _sweep(A, b, s, rest, stuck):
    """Set the signs by Gauss and Seidel, one after the other."""
    for _ in range(SWEEPS):
        for i in range(s.size):
            if rest[i]:
                own = A[i, i]
                rate = _rate(A, b, s, rest, i)[0] + own * s[i]
                side = 1.0 if rate > 0.0 else -1.0
                stuck[i] = own > 0.0 and abs(rate) <= own
                s[i] = rate / own if stuck[i] else side


@njit(**APART)
def _hold(A, b, rest, s, stuck, table, right, order):
    """Set the signs of what is stuck so that its rates vanish."""
    for i in range(s.size):
        right[i] = b[i]
        for j in range(s.size):
            right[i] -= A[i, j] * s[j] if rest[j] and not stuck[j] else 0.0
    solve_some(A, right, stuck, table, order, s)


@njit(**APART)
def solve_signs(A, b, rest, s, stuck, table, right, order):
    """Find the signs of the flows at rest, and which of them stick; the others' signs stay.

    ``b`` holds the rates where the signs of all at rest are zero.
    """
    pivots = 0
    for i in range(s.size):
        stuck[i] = rest[i]
        pivots += MAX_PIVOTS if rest[i] else 0
    for _ in range(pivots):
        _hold(A, b, rest, s, stuck, table, right, order)
        i = _misplaced(A, b, s, rest, stuck)
        if i < 0:
            return
        if stuck[i]:
            leaving = s[i] if abs(s[i]) > 1.0 else _rate(A, b, s, rest, i)[0]
            s[i] = 1.0 if leaving > 0.0 else -1.0
        stuck[i] = not stuck[i]
    _sweep(A, b, s, rest, stuck)
