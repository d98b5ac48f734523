r"""A linearly implicit step: stable however fast a stable model is, and of order three.

With :math:`A = \partial f/\partial x` at the step's start, the stages of a Rosenbrock method are

.. math:: (I - \gamma h A)(k_i + g_i) = f\Big(t + c_i h, x + h \sum_{j<i} a_{ij} k_j\Big)
          + g_i, \qquad g_i = \sum_{j<i} \frac{\gamma_{ij}}{\gamma} k_j, \qquad
          x \leftarrow x + h \sum_i b_i k_i.

The coefficients are those of ROS34PW2 [1]_: a fast decay ends within a step, and the order is three
whatever :math:`A` is. So the sensitivities take the same steps with the same :math:`A`.

References
----------
.. [1] J. Rang, L. Angermann, "New Rosenbrock W-methods of order 3 for partial differential
   algebraic equations of index 1", BIT 45, 2005, :doi:`10.1007/s10543-005-0035-y`.
"""

from collections.abc import Callable, Mapping

import numpy as np
from llvmlite import ir

#: :math:`\gamma`
DIAGONAL = 4.3586652150845900e-01
#: :math:`a_{ij}`
STAGES = np.array(
    [
        [0.0, 0.0, 0.0, 0.0],
        [8.7173304301691801e-01, 0.0, 0.0, 0.0],
        [8.4457060015369423e-01, -1.1299064236484185e-01, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]
)
#: :math:`\gamma_{ij} / \gamma`
COUPLING = (
    np.array(
        [
            [0.0, 0.0, 0.0, 0.0],
            [-8.7173304301691801e-01, 0.0, 0.0, 0.0],
            [-9.0338057013044082e-01, 5.4180672388095326e-02, 0.0, 0.0],
            [2.4212380706095346e-01, -1.2232505839045147e00, 5.4526025533510214e-01, 0.0],
        ]
    )
    / DIAGONAL
)
#: :math:`c_i` and :math:`b_i`
NODES = STAGES.sum(axis=1)
WEIGHTS = np.array(
    [2.4212380706095346e-01, -1.2232505839045147e00, 1.5452602553351020e00, DIAGONAL]
)


class Elimination:
    """Gauss's elimination of a matrix, written out as instructions; what is zero costs nothing."""

    def __init__(
        self,
        builder: ir.IRBuilder,
        plus: Callable,
        matrix: Mapping[tuple[int, int], ir.Value],
        n: int,
    ):
        self.builder, self.plus, self.n = builder, plus, n
        self.known, self.inverse = dict(matrix), {}
        for k in range(n):
            self.inverse[k] = self.inverse_of(k)
            for i in self._column_below(k):
                self._eliminate(i, k)

    def inverse_of(self, k: int) -> ir.Value:
        """Return one over a pivot."""
        return self.builder.fdiv(ir.Constant(ir.DoubleType(), 1.0), self.known[k, k])

    def _column_below(self, k: int) -> list[int]:
        return [i for i in range(k + 1, self.n) if (i, k) in self.known]

    def _eliminate(self, i: int, k: int) -> None:
        """Take a multiple of row k from row i; the multiple's negative is kept in its place."""
        builder = self.builder
        share = builder.fneg(builder.fmul(self.known[i, k], self.inverse[k]))
        self.known[i, k] = share
        for j in range(k + 1, self.n):
            if (k, j) in self.known:
                product = builder.fmul(share, self.known[k, j])
                before = self.known.get((i, j))
                self.known[i, j] = product if before is None else builder.fadd(before, product)

    def solve(self, right: list[ir.Value]) -> list[ir.Value]:
        """Return the solution for numbers, or for vectors of them."""
        found = list(right)
        for k in range(self.n):
            for i in self._column_below(k):
                found[i] = self.plus(found[i], self.known[i, k], found[k])
        for k in reversed(range(self.n)):
            for j in range(k + 1, self.n):
                if (k, j) in self.known:
                    minus = self.builder.fneg(self.known[k, j])
                    found[k] = self.plus(found[k], minus, found[j])
            found[k] = self.plus(ir.Constant(found[k].type, None), self.inverse[k], found[k])
        return found
