r"""What holds the flows that stick, written out as instructions.

The signs of the stuck flows answer whatever else acts: with the flows' rows :math:`C` and
:math:`B = \partial f/\partial s` of those that stick,

.. math:: \delta s = -(C B)^{-1} C f, \qquad f + B\, \delta s
          = \big(I - B (C B)^{-1} C\big) f,

for the rates :math:`f` and for their derivatives alike.
"""

from collections.abc import Callable, Sequence

from llvmlite import ir

from sklearn_pgnn.simulation.linearly_implicit import Elimination

_FLOAT = ir.DoubleType()
#: a pivot that is so small a share of its row's own number is none: more sticks than can move
ROUNDING = 1e-10


class Reactions(Elimination):
    """The reactions of flows, of which some are stuck.

    ``rows`` are the flows over the states, ``columns`` the rates' derivatives by their signs.
    """

    def __init__(
        self,
        builder: ir.IRBuilder,
        plus: Callable,
        rows: Sequence[Sequence[float]],
        columns: Sequence[Sequence[ir.Value]],
        stuck: Sequence[ir.Value],
    ):
        self.rows, self.columns, self.stuck = rows, columns, stuck
        self.builder, self.plus, n = builder, plus, len(rows)
        pairs = [(i, j) for i in range(n) for j in range(n)]
        matrix = {(i, j): self._between(i, j) for i, j in pairs}
        self.own = [matrix[i, i] for i in range(n)]
        super().__init__(builder, plus, matrix, n)

    def answers(self, rates: Sequence[ir.Value]) -> list[ir.Value]:
        """Return by how much the signs change; those that are not stuck do not."""
        along = (self._along(row, rates) for row in self.rows)
        return self.solve([self._held(i, rate) for i, rate in enumerate(along)])

    def _between(self, i: int, j: int) -> ir.Value:
        """Return an element of -CB among what is stuck, and of one elsewhere."""
        value = self.builder.fneg(self._along(self.rows[i], self.columns[j]))
        both = self.builder.and_(self.stuck[i], self.stuck[j])
        return self.builder.select(both, value, ir.Constant(_FLOAT, float(i == j)))

    def _along(self, row: Sequence[float], rates: Sequence[ir.Value]) -> ir.Value:
        total = ir.Constant(rates[0].type, None)
        for factor, rate in zip(row, rates, strict=True):
            if factor:
                total = self.plus(total, ir.Constant(_FLOAT, factor), rate)
        return total

    def _held(self, i: int, value: ir.Value) -> ir.Value:
        return self.builder.select(self.stuck[i], value, ir.Constant(value.type, None))

    def inverse_of(self, k: int) -> ir.Value:
        """Return one over a pivot, or zero where there is none."""
        builder, pivot = self.builder, self.known[k, k]
        magnitude = ir.FunctionType(_FLOAT, [_FLOAT])
        fabs = builder.module.declare_intrinsic("llvm.fabs", [_FLOAT], magnitude)
        size = builder.call(fabs, [self.own[k]])
        least = builder.fmul(ir.Constant(_FLOAT, ROUNDING), size)
        is_one = builder.fcmp_ordered(">", pivot, least)
        one_over = builder.fdiv(ir.Constant(_FLOAT, 1.0), pivot)
        return builder.select(is_one, one_over, ir.Constant(_FLOAT, 0.0))
