r"""A model's function in machine code: a step of the states, the rates, or the outputs.

The time loops of every model are the same and are compiled once. What they call is one function a
model, which does what ``task`` says:

`RATES`, `OUTPUTS`
    evaluates the rates and their derivatives by the signs of dry frictions, or the outputs and
    their derivatives, into ``out``, whose layout is that of
    `sklearn_pgnn.simulation.source`;
`OBSERVE`
    evaluates the outputs and, in place of their derivatives, row by row their sensitivities
    :math:`\frac{\partial g}{\partial x} S + \frac{\partial g}{\partial p}`;
`STEP`
    makes an explicit Runge-Kutta step from ``t`` to ``t + h`` of the states and of their
    sensitivities, in place: with the nodes :math:`c` and weights :math:`b` of the scheme

    .. math:: k_i = f(t + c_i h,\; x + c_i h\, k_{i-1}), \qquad x \leftarrow x + h \sum_i b_i k_i,

    and in the same way with :math:`\frac{\partial f}{\partial x} S + \frac{\partial f}{\partial p}`
    for the sensitivities. The inputs run straight from ``u`` to ``u_end``; a flow that is stuck
    stays, and what holds it acts on the others (`sklearn_pgnn.simulation.reactions`). For stiff
    models the step is a linearly implicit one, see
    `sklearn_pgnn.simulation.linearly_implicit`.

In a step the rows of the sensitivities are vectors no wider than a register, since LLVM works on
wider ones slowly, and a derivative that is zero costs nothing.
"""

from contextlib import contextmanager
from functools import reduce

import numpy as np
from llvmlite import ir
from numba.core import cgutils

from sklearn_pgnn.simulation.lanes import LANES
from sklearn_pgnn.simulation.linearly_implicit import (
    COUPLING,
    DIAGONAL,
    NODES,
    STAGES,
    WEIGHTS,
    Elimination,
)
from sklearn_pgnn.simulation.reactions import Reactions
from sklearn_pgnn.simulation.source import Source
from sklearn_pgnn.simulation.straight_line import FLOAT, INT, Assignments, emit_entries

#: what a model's function can do
STEP, RATES, OUTPUTS, OBSERVE = 0, 1, 2, 3
#: the stages of a step: where in it they stand, and their weights
METHODS = {
    "euler": (np.array([0.0]), np.array([1.0])),
    "rk4": (np.array([0.0, 0.5, 0.5, 1.0]), np.array([1.0, 2.0, 2.0, 1.0]) / 6.0),
}
#: a step that is stable however fast a stable model is
IMPLICIT = "rosenbrock"
#: every scheme of a step
SCHEMES = (*METHODS, IMPLICIT)
#: its arrays, behind ``task``, ``t`` and ``h``
ARRAYS = ("x", "S", "u", "u_end", "p", "s", "stuck", "out")


def emit_model_function(builder, source: Source, method: str, arguments) -> None:
    """Emit a model's function.

    The scheme is ``"rk4"``, ``"euler"`` or ``"rosenbrock"``; `arguments` are the values of ``task,
    t, h``, and pointers to the data of `ARRAYS`.
    """
    (task, t, h), pointers = arguments[:3], arguments[3:]
    arrays = dict(zip(ARRAYS, pointers, strict=True))
    _Emission(builder, source, t, h, arrays).emit(task, method)


class _Emission:
    """The instructions of one model's function."""

    def __init__(self, builder, source, t, h, arrays):
        self.builder, self.source = builder, source
        self.lines = Assignments(source.text)
        self.pieces = pieces_of_row(source.n_sensitivities)
        self.t, self.h, self.arrays = t, h, arrays
        self.alone = self._alone()
        self._vectors: dict[tuple, ir.Value] = {}  # of one number, in every block where it is used

    def emit(self, task, method) -> None:
        """Emit the things that the function does, and the choice between them."""
        builder = self.builder
        with builder.if_else(builder.icmp_signed("==", task, INT(STEP))) as (step, other):
            with step:
                self._implicit_step() if method == IMPLICIT else self._step(*METHODS[method])
            with other:
                self._evaluation(task)

    def _evaluation(self, task) -> None:
        """Evaluate the rates, or the outputs with their derivatives or their sensitivities."""
        builder, source = self.builder, self.source
        with builder.if_else(builder.icmp_signed("==", task, INT(RATES))) as (rates, other):
            with rates:
                self._evaluate(source.rates, source.rates_by_signs)
            with other, builder.if_else(builder.icmp_signed("==", task, INT(OUTPUTS))) as tasks:
                with tasks[0]:
                    self._evaluate(source.outputs, source.output_slopes)
                with tasks[1]:
                    self._observe()

    def _evaluate(self, *parts: range) -> None:
        """Store parts of the entries in ``out``; most are always zero where there are many."""
        for part in parts:
            cgutils.memset(self.builder, self._place("out", INT(part.start)), INT(8 * len(part)), 0)
        entries = [entry for part in parts for entry in part if not self.lines.is_zero(entry)]
        values = self._entries(entries, self.t, self._load)
        for entry, value in zip(entries, values, strict=True):
            self.builder.store(value, self._place("out", INT(entry)))

    def _observe(self) -> None:
        """Store the outputs in ``out``, and the rows of their sensitivities behind."""
        source, rows = self.source, self._rows()
        wanted = self._not_zero(source.outputs, source.slopes_of_outputs)
        values = dict(zip(wanted, self._entries(wanted, self.t, self._load), strict=True))
        sensitivities = self._tangents(source.slopes_of_outputs, values, rows)
        if rows and not all(map(self.lines.is_zero, source.outputs_by_signs)):
            sensitivities = self._held_outputs(sensitivities, rows)
        for entry in source.outputs:
            self.builder.store(values[entry], self._place("out", INT(entry)))
        n_rows = len(source.slopes_of_outputs)
        places = self._row_places("out", source.output_slopes.start, n_rows)
        for row, place in zip(sensitivities, places, strict=True):
            self.builder.store(row, place, align=8)

    def _not_zero(self, entries, slopes):
        """Return the places of entries, and of those of their slopes that are not always zero."""
        return [*entries, *(e for row in slopes for e in row if not self.lines.is_zero(e))]

    def _step(self, nodes, weights) -> None:
        """Step the states, and the rows of the sensitivities, through the stages."""
        places, read = self._targets(), self._preloaded()
        slopes, steps = ([self._zero(part.type.pointee) for part in places] for _ in range(2))
        for node, weight in self._stages(nodes, weights):
            along, start = self.builder.fmul(self.h, node), self._loaded(places)
            now = start if _is_start(node) else self._moved(start, along, slopes)
            for value, slope, step in zip(
                self._slopes(now, along, node, read), slopes, steps, strict=True
            ):
                self.builder.store(value, slope)
                self.builder.store(self._plus(self.builder.load(step), weight, value), step)
        for place, step in zip(places, steps, strict=True):
            (end,) = self._moved(self._loaded([place]), self.h, [step])
            self.builder.store(end, place, align=8)

    def _stages(self, nodes, weights):
        """Yield the node and the weight of every stage, to emit what is done there.

        One stage after the other is faster than a loop of them, which compiles faster where there
        are sensitivities, and many.
        """
        if not self.source.n_sensitivities:
            yield from zip(map(FLOAT, nodes), map(FLOAT, weights), strict=True)
            return
        builder, tables = self.builder, [self._constant(nodes), self._constant(weights)]
        with cgutils.for_range(builder, INT(len(nodes))) as loop:
            yield [builder.load(builder.gep(table, [INT(0), loop.index])) for table in tables]

    def _implicit_step(self) -> None:
        """Step the states and the rows by stages of which each solves the linearised equations."""
        builder, start, read = self.builder, [*self._states(), *self._rows()], self._preloaded()
        kept = [self._zero(ir.ArrayType(part.type, len(NODES))) for part in start]
        solve = self._elimination(start, read).solve
        with cgutils.for_range(builder, INT(len(NODES))) as loop:
            at = loop.index
            node = builder.load(builder.gep(self._constant(NODES), [INT(0), at]))
            along = builder.fmul(self.h, node)
            now = self._moved_by_stages(start, self.h, STAGES, at, kept)
            zero = [ir.Constant(part.type, None) for part in start]
            before = self._moved_by_stages(zero, FLOAT(1.0), COUPLING, at, kept)
            rates = self._slopes(now, along, node, read)
            pairs = zip(rates, before, strict=True)
            solved = self._solved(solve, [self._plus(g, FLOAT(1.0), f) for f, g in pairs])
            for place, value, g in zip(kept, solved, before, strict=True):
                found = self._plus(value, FLOAT(-1.0), g)
                builder.store(found, builder.gep(place, [INT(0), at]))
        end = self._moved_by_stages(start, self.h, WEIGHTS[None], INT(0), kept)
        for value, place in zip(end, self._targets(), strict=True):
            builder.store(value, place, align=8)

    def _elimination(self, start, read) -> Elimination:
        r"""Factorise :math:`I - \gamma h\, \partial f/\partial x` at the step's start.

        A derivative that is not finite, as a root's at zero, is left out: any matrix will do.
        """
        n, factor = self.source.n_states, self.builder.fmul(self.h, FLOAT(-DIAGONAL))
        at = start[:n], FLOAT(0.0), FLOAT(0.0)
        read = self._answered(*at, read)
        values = self._rate_values(*at, read)
        slopes = [[values.get(entry) for entry in row[:n]] for row in self.source.rate_slopes]
        if self._together():
            slopes = [[FLOAT(0.0) if v is None else v for v in row] for row in slopes]
            columns = self._held(list(map(list, zip(*slopes, strict=True))), *at, read)
            slopes = list(map(list, zip(*columns, strict=True)))
        matrix = {
            (i, j): self.builder.fmul(factor, self._finite(self._unless_stuck(i, value)))
            for i, row in enumerate(slopes)
            for j, value in enumerate(row)
            if value is not None
        }
        for i in range(n):
            matrix[i, i] = self.builder.fadd(FLOAT(1.0), matrix.get((i, i), FLOAT(0.0)))
        return Elimination(self.builder, self._plus, matrix, n)

    def _finite(self, value):
        """Return a number, or zero where it is not finite."""
        builder = self.builder
        below, above = (
            builder.fcmp_ordered(sign, value, FLOAT(bound))
            for sign, bound in (("<", np.inf), (">", -np.inf))
        )
        return builder.select(builder.and_(below, above), value, FLOAT(0.0))

    def _solved(self, solve, right):
        """Return the solutions for the states and for every column of the rows' pieces."""
        n, n_pieces = self.source.n_states, len(self.pieces)
        columns = [right[:n], *(right[n + i :: n_pieces] for i in range(n_pieces))]
        states, *pieces = map(solve, columns)
        return [*states, *(piece for row in zip(*pieces, strict=True) for piece in row)]

    def _moved_by_stages(self, start, by, table, at, kept):
        """Return the parts behind a step along a row of a table's weights of the stages."""
        builder, weights = self.builder, self._constant(table.ravel())
        first = builder.mul(at, INT(len(NODES)))
        moved = list(start)
        for stage in range(len(NODES)):
            place = builder.gep(weights, [INT(0), builder.add(first, INT(stage))])
            factor = builder.fmul(by, builder.load(place))
            slopes = (builder.load(builder.gep(part, [INT(0), INT(stage)])) for part in kept)
            moved = [self._plus(p, factor, k) for p, k in zip(moved, slopes, strict=True)]
        return moved

    def _rate_values(self, states, along, node, read):
        """Return the rates, and what of their derivatives is not always zero, by entry."""
        wanted = self._not_zero(self.source.rates, self.source.rate_slopes)
        return self._at_stage(wanted, states, along, node, read)

    def _at_stage(self, wanted, states, along, node, read):
        """Return some entries at a stage."""

        def at_stage(array, i):
            if array == "x":
                return states[i]
            return self._input(i, node) if array == "u" else read(array, i)

        t = self.builder.fadd(self.t, along)
        return dict(zip(wanted, self._entries(wanted, t, at_stage), strict=True))

    def _slopes(self, now, along, node, read):
        """Return the rates of the states and of the sensitivities' rows at a stage."""
        source = self.source
        states, rows = now[: source.n_states], now[source.n_states :]
        read = self._answered(states, along, node, read)
        values = self._rate_values(states, along, node, read)
        rates = [values[entry] for entry in source.rates]
        tangents = self._tangents(source.rate_slopes, values, rows)
        n_pieces = len(self.pieces)
        if tangents and self._together():
            pieces = [tangents[i::n_pieces] for i in range(n_pieces)]
            pieces = self._held(pieces, states, along, node, read)
            tangents = [piece for row in zip(*pieces, strict=True) for piece in row]
        return [
            *(self._unless_stuck(i, value) for i, value in enumerate(rates)),
            *(self._unless_stuck(i // n_pieces, value) for i, value in enumerate(tangents)),
        ]

    def _tangents(self, slopes, values, rows):
        r"""Return the rows of :math:`\partial f/\partial x\, S + \partial f/\partial p`."""
        n_pieces = len(self.pieces)
        return [
            self._tangent(row, values, piece, rows[i::n_pieces])
            for row in slopes
            for i, piece in enumerate(self.pieces)
        ]

    def _tangent(self, slopes, values, piece, column):
        """Return a piece of a row, from that piece of the rows of all states."""
        builder, n = self.builder, self.source.n_states
        total = ir.Constant(ir.VectorType(FLOAT, len(piece)), None)
        for place, entry in enumerate(slopes[n:][piece.start : piece.stop]):
            if entry in values:
                total = builder.insert_element(total, values[entry], INT(place))
        for entry, row in zip(slopes[:n], column, strict=True):
            if entry in values:
                total = self._plus(total, values[entry], row)
        return total

    # -- dry friction ------------------------------------------------------------------------------

    def _alone(self) -> dict[int, int]:
        """Return the states whose dry friction acts on nothing else, and their flows."""
        found = {}
        for i, row in enumerate(self.source.rows):
            (state, *others), column = np.flatnonzero(row), self._column(i)
            acts_on = {m for m, entry in enumerate(column) if not self.lines.is_zero(entry)}
            flows = {j for j, other in enumerate(self.source.rows) if other[state]}
            if not others and acts_on <= {state} and flows == {i}:
                found[int(state)] = i
        return found

    def _column(self, i) -> range:
        """Return where the rates' derivatives by a flow's sign stand."""
        return self.source.rates_by_signs[i :: len(self.source.rows)]

    def _together(self) -> list[int]:
        """Return the flows whose dry frictions act on more than their own state."""
        alone = set(self.alone.values())
        return [i for i in range(len(self.source.rows)) if i not in alone]

    def _is_stuck(self, i):
        """Return whether a flow is stuck."""
        stuck = self.builder.load(self._place("stuck", INT(i)))
        return self.builder.icmp_unsigned("!=", stuck, stuck.type(0))

    def _any_stuck(self, flows):
        """Return whether any of some flows is stuck."""
        return reduce(self.builder.or_, map(self._is_stuck, flows))

    def _unless_stuck(self, state, value):
        """Return a rate, or zero where the state is a flow that is stuck."""
        rows = self.source.rows
        flows = [i for i, row in enumerate(rows) if row[state] and sum(map(bool, row)) == 1]
        if not flows:
            return value
        zero = ir.Constant(value.type, None)
        return self.builder.select(self._is_stuck(flows[0]), zero, value)

    def _reactions(self, flows, states, along, node, read) -> Reactions:
        """Return what holds those of some flows that are stuck, at a stage."""
        wanted = [entry for i in flows for entry in self._column(i)]
        values = self._at_stage(wanted, states, along, node, read)
        columns = [[values[entry] for entry in self._column(i)] for i in flows]
        rows, stuck = [self.source.rows[i] for i in flows], [*map(self._is_stuck, flows)]
        return Reactions(self.builder, self._plus, rows, columns, stuck)

    def _answered(self, states, along, node, read):
        """Return how to read what a stage needs, with the signs of stuck flows that hold them."""
        flows = self._together()
        if not flows:
            return read
        signs = {i: self._zero(FLOAT) for i in flows}
        for i, place in signs.items():
            self.builder.store(read("s", i), place)
        with self.builder.if_then(self._any_stuck(flows)):
            reactions = self._reactions(flows, states, along, node, read)
            rates = self._at_stage(self.source.rates, states, along, node, read)
            answers = reactions.answers([*rates.values()])
            for (i, place), answer in zip(signs.items(), answers, strict=True):
                self.builder.store(self.builder.fadd(read("s", i), answer), place)
        known = {i: self.builder.load(place) for i, place in signs.items()}
        return lambda array, i: known[i] if array == "s" and i in known else read(array, i)

    def _held(self, columns, *at):
        """Return columns of derivatives of the rates, with what holds the stuck flows."""
        flows = self._together()
        with self._where_stuck(flows, columns) as places:
            reactions = self._reactions(flows, *at)
            for column, kept in zip(columns, places, strict=True):
                answers = reactions.answers(column)
                held = self._with_answers(column, reactions.columns, answers)
                for value, place in zip(held, kept, strict=True):
                    self.builder.store(value, place)
        return [[self.builder.load(place) for place in kept] for kept in places]

    def _held_outputs(self, sensitivities, rows):
        """Return the sensitivities of the outputs with how the signs of stuck flows follow."""
        source, n_pieces = self.source, len(self.pieces)
        flows = range(len(source.rows))
        pieces = [sensitivities[i::n_pieces] for i in range(n_pieces)]
        at = self._states(), FLOAT(0.0), FLOAT(0.0), self._load
        with self._where_stuck(flows, pieces) as places:
            reactions = self._reactions(flows, *at)
            tangents = self._tangents(source.rate_slopes, self._rate_values(*at), rows)
            by_signs = self._at_stage(source.outputs_by_signs, *at)
            columns = [source.outputs_by_signs[i :: len(flows)] for i in flows]
            slopes = [[by_signs[entry] for entry in column] for column in columns]
            for i, (piece, kept) in enumerate(zip(pieces, places, strict=True)):
                answers = reactions.answers(tangents[i::n_pieces])
                for value, place in zip(
                    self._with_answers(piece, slopes, answers), kept, strict=True
                ):
                    self.builder.store(value, place)
        pieces = [[self.builder.load(place) for place in kept] for kept in places]
        return [piece for row in zip(*pieces, strict=True) for piece in row]

    @contextmanager
    def _where_stuck(self, flows, columns):
        """Keep columns of values in places, to be replaced there where a flow is stuck."""
        places = [[self._zero(value.type) for value in column] for column in columns]
        for column, kept in zip(columns, places, strict=True):
            for value, place in zip(column, kept, strict=True):
                self.builder.store(value, place)
        with self.builder.if_then(self._any_stuck(flows)):
            yield places

    def _with_answers(self, values, slopes, answers):
        """Return values that change by their slopes times how the signs answer."""
        for column, answer in zip(slopes, answers, strict=True):
            pairs = zip(values, column, strict=True)
            values = [self._plus(value, slope, answer) for value, slope in pairs]
        return values

    # -- values ------------------------------------------------------------------------------------

    def _entries(self, entries, t, read):
        return emit_entries(self.builder, self.lines, entries, t, read)

    def _states(self):
        return [self._load("x", i) for i in range(self.source.n_states)]

    def _rows(self):
        return self._loaded(self._row_places())

    def _input(self, i, node):
        """Return an input on its way from the step's start to its end."""
        builder, start = self.builder, self._load("u", i)
        if _is_start(node):
            return start
        change = builder.fsub(self._load("u_end", i), start)
        return builder.fadd(start, builder.fmul(node, change))

    def _preloaded(self):
        """Return how to read parameters and signs, which are loaded once a step."""
        known = {
            place: self._load(*place)
            for place in dict.fromkeys(self.lines.places)
            if place[0] in ("p", "s")
        }
        return lambda array, i: known[array, i]

    def _moved(self, start, by, slopes):
        """Return where the parts are behind a step along slopes."""
        pairs = zip(start, slopes, strict=True)
        return [self._plus(part, by, self.builder.load(slope)) for part, slope in pairs]

    def _plus(self, value, factor, change):
        """Return ``value + factor*change`` for numbers and vectors."""
        if isinstance(value.type, ir.VectorType):
            factor = self._spread(factor, value.type)
        return self.builder.fadd(value, self.builder.fmul(factor, change))

    def _spread(self, value, kind):
        """Return a vector of one number."""
        key = self.builder.block, value, kind
        if key not in self._vectors:
            first = self.builder.insert_element(ir.Constant(kind, ir.Undefined), value, INT(0))
            everywhere = ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
            self._vectors[key] = self.builder.shuffle_vector(first, first, everywhere)
        return self._vectors[key]

    def _constant(self, values):
        """Return numbers as a constant array of the module."""
        kind = ir.ArrayType(FLOAT, len(values))
        return cgutils.global_constant(self.builder, "stages", kind(values.tolist()))

    # -- memory ------------------------------------------------------------------------------------

    def _zero(self, kind):
        """Return a place on the stack that holds zero."""
        place = cgutils.alloca_once(self.builder, kind)
        self.builder.store(ir.Constant(kind, None), place)
        return place

    def _load(self, array, i):
        return self.builder.load(self._place(array, INT(i)))

    def _place(self, array, index):
        return self.builder.gep(self.arrays[array], [index])

    def _loaded(self, places):
        return [self.builder.load(place, align=8) for place in places]

    def _row_places(self, array="S", first=0, n_rows=None):
        """Return where the pieces of rows of sensitivities are; by default those of the states."""
        width = self.source.n_sensitivities
        return [
            self.builder.bitcast(
                self._place(array, INT(first + i * width + piece.start)),
                ir.VectorType(FLOAT, len(piece)).as_pointer(),
            )
            for i in range(self.source.n_states if n_rows is None else n_rows)
            for piece in self.pieces
        ]

    def _targets(self):
        states = [self._place("x", INT(i)) for i in range(self.source.n_states)]
        return [*states, *self._row_places()]


def pieces_of_row(count: int) -> list[range]:
    """Return the pieces of a row, none wider than a vector register.

    >>> pieces_of_row(11)
    [range(0, 8), range(8, 11)]
    """
    return [range(start, min(start + LANES, count)) for start in range(0, count, LANES)]


def _is_start(node) -> bool:
    """Return whether a stage is known to stand at the step's start."""
    return isinstance(node, ir.Constant) and node.constant == 0.0
