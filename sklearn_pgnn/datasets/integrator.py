r"""A separate integrator for plants: many records at once in NumPy, without `simulation`.

A test that hides an effect must not simulate the truth with the code under test. Here the records
advance together as columns, by the classical Runge-Kutta method in equal substeps,

.. math:: x_{n+1} = x_n + \tfrac{h}{6}(k_1 + 2 k_2 + 2 k_3 + k_4),

under zero-order hold: ``u[k]`` acts from ``t[k]`` to ``t[k+1]`` and ``y[k]`` is measured at
``t[k]``; or, if the model's `simulation` says so, with linear interpolation of the inputs.
An input delay :math:`\tau` is an exact shift in time: the steps also break where ``u(t - tau)``
jumps or has a kink. Before the record begins, an input has its first value.

Dry friction sticks exactly. The sign of a velocity, or of a difference of velocities, is held
within a step; a column in which one changes its sign is stepped again to the root (regula falsi),
where it is set to zero. What is at rest moves only if the balance of all that are, by sweeps of
Gauss and Seidel, says so; otherwise it stays, and what holds it acts on the others. The state is
thus of fourth order in the step from event to event, unless a kink of the rates (a dead zone, a
limit) falls within a step; what others drag along breaks away at the beginning of a substep.
"""

from dataclasses import dataclass
from functools import reduce
from itertools import chain

import numpy as np
import sympy
from sympy.printing.numpy import NumPyPrinter

from sklearn_pgnn.physics.dry_friction import dry_friction, with_signs
from sklearn_pgnn.physics.expressions import TIME, symbol

#: crossings of zero within one substep; a column that crosses more often comes to rest
MAX_CROSSINGS = 8
#: regula falsi steps to locate a crossing
ROOT_STEPS = 3
#: sweeps of a balance of friction, and a share of its parts that makes a difference zero
SWEEPS, ROUNDING = 300, 1e-10


def integrate(model, t, u=None, x0=None, *, substeps: int = 4):
    """Integrate records together; states and outputs have shape (n_records, n_samples, n)."""
    t = np.asarray(t, dtype=float)
    if u is None:
        u = np.zeros((1 if x0 is None else len(x0), t.size, len(model.inputs)))
    u = np.asarray(u, dtype=float)
    x0 = _starts(model, u) if x0 is None else x0
    plant = Plant(model)
    edges, acting = _act(model, t, np.moveaxis(u, 0, -1))
    sampled = np.searchsorted(edges, t)
    with np.errstate(all="ignore"):
        x = _run(plant, t, edges, sampled, acting, np.array(x0, dtype=float).T, substeps)
        seen, x_first = [values[sampled] for values, _ in acting], np.moveaxis(x, 1, 0)
        side = _balanced(plant, t[:, None], x_first, seen)[0] if plant.shows_sides else None
        y = plant.outputs(t[:, None], x_first, seen, side)
    return np.moveaxis(x, -1, 0), np.moveaxis(y, (0, 1, 2), (2, 1, 0))


def _starts(model, u):
    """Return the model's initial state for every record; settled states start at others."""
    x0, states = np.tile(list(model.initial_state.values()), (len(u), 1)), list(model.states)
    first = dict(zip(model.inputs, u[:, 0].T, strict=True)) | dict(zip(states, x0.T, strict=True))
    for state, name in model.settled.items():
        x0[:, states.index(state)] = first[name]
    return x0


def _run(plant, t, edges, sampled, acting, x, substeps):
    """Step from edge to edge and return the states at the samples."""
    kept = np.empty((t.size, *x.shape))
    kept[0] = x
    for k in range(t.size - 1):
        shortest = (t[k + 1] - t[k]) / substeps
        for edge in range(sampled[k], sampled[k + 1]):
            width = edges[edge + 1] - edges[edge]
            count = max(1, int(np.ceil(width / shortest - 1e-6)))
            inputs = Inputs(edges[edge], [(v[edge], s[edge]) for v, s in acting])
            for step in range(count):
                x = _advance(plant, edges[edge] + step * width / count, width / count, x, inputs)
        kept[k + 1] = x
    return kept


@dataclass(frozen=True)
class Inputs:
    """The inputs between two successive instants at which any of them may jump or have a kink.

    `start` is the first instant [s]; `lines` has initial value and slope of every input, by column.
    """

    start: float
    lines: list

    def at(self, t):
        """Return the inputs at an instant, common or per column."""
        return [value + slope * (t - self.start) for value, slope in self.lines]

    def of(self, columns):
        """Return the inputs of a subset of columns."""
        return Inputs(self.start, [(value[columns], slope[columns]) for value, slope in self.lines])


def _act(model, t, u):
    """Return the instants of possible jumps or kinks, and each input's value and slope after."""
    edges, samples, delays = _edges(model, t)
    if model.simulation.get("hold") != "foh":
        return edges, [(v, np.zeros_like(v)) for v in (u[k, i] for i, k in enumerate(samples))]
    acting = []
    for i, delay in enumerate(delays):
        columns = [np.interp(edges - delay, t, column) for column in u[:, i].T]
        values, widths = np.column_stack(columns), np.diff(edges)[:, None]
        acting.append((values, np.vstack([np.diff(values, axis=0) / widths, 0.0 * values[:1]])))
    return edges, acting


def _edges(model, t):
    """Return the instants of possible jumps or kinks, the sample that acts after, and delays."""
    delays = [model.parameters[model.delays[name]].value if name in model.delays else 0.0
              for name in model.inputs]  # fmt: skip
    near = 1e-9 * np.diff(t).min() if t.size > 1 else 0.0
    late = np.concatenate([t + delay for delay in delays if delay] or [[]])
    late = late[(late > t[0]) & (late < t[-1])]
    after = t[np.searchsorted(t, late - near)]
    edges = np.sort(np.concatenate([t, late[np.abs(after - late) > near]]))
    samples = [np.searchsorted(t, edges - delay + near, side="right") - 1 for delay in delays]
    return edges, np.clip(samples, 0, t.size - 1).astype(int), delays


def _advance(plant, t, h, x, u, crossings=MAX_CROSSINGS):
    """Return the states after a step, which is split where a dry friction changes sign."""
    side = plant.sides(x)
    moving = np.ones_like(side)
    if not side.all():
        side, moving = _balanced(plant, t, x, u.at(t))
    new = _runge_kutta(plant, t, h, x, u, side, moving)
    cut = np.flatnonzero((moving * side * plant.flows(new) < 0).any(axis=0))
    if cut.size and crossings:
        t, h = np.broadcast_to(t, x.shape[1])[cut], np.broadcast_to(h, x.shape[1])[cut]
        columns = x[:, cut], u.of(cut), side[:, cut], moving[:, cut]
        new[:, cut] = _cross(plant, t, h, *columns, new[:, cut], crossings)
    return new


def _cross(plant, t, h, x, u, side, moving, new, crossings):
    """Step to the first zero of a flow, set it to zero there, and step the rest."""
    first, share = _first_zero(plant, t, h, x, u, side, moving, new)
    x = _runge_kutta(plant, t, share * h, x, u, side, moving)
    for i, row in enumerate(plant.rows):
        at_zero = first == i
        left = plant.flows(x)[i, at_zero] / (row @ row)
        x[:, at_zero] -= np.outer(row, left)
    return _advance(plant, t + share * h, (1 - share) * h, x, u, crossings - 1)


def _first_zero(plant, t, h, x, u, side, moving, new):
    """Return which flow crosses zero first in every column, and at what fraction of the step."""
    old, new = plant.flows(x), plant.flows(new)
    chord = np.where(moving * side * new < 0, old / (old - new), np.inf)
    first = chord.argmin(axis=0)
    column = np.arange(first.size)
    low, v_low, high, v_high = 0.0, old[first, column], 1.0, new[first, column]
    for _ in range(ROOT_STEPS):
        share = _chord_zero(low, v_low, high, v_high)
        v = plant.flows(_runge_kutta(plant, t, share * h, x, u, side, moving))[first, column]
        before = v * side[first, column] > 0
        low, v_low = np.where(before, share, low), np.where(before, v, v_low)
        high, v_high = np.where(before, high, share), np.where(before, v_high, v)
    return first, _chord_zero(low, v_low, high, v_high)


def _chord_zero(low, v_low, high, v_high):
    """Return the zero of a chord; its lower end where the chord vanishes, as from rest."""
    fall = v_low - v_high
    return low + (high - low) * np.divide(v_low, fall, out=np.zeros_like(fall), where=fall != 0)


def _balanced(plant, t, x, u):
    """Return the sign of every dry friction, and 1 if its flow may move, else 0."""
    side = plant.sides(x)
    rest, moving = side == 0, np.ones_like(side)
    A, b = plant.balance(t, x, u, side)
    for _ in range(SWEEPS):
        before = side.copy()
        for i, own in enumerate(A[range(len(A)), range(len(A))]):
            rate = b[i] - sum(A[i, j] * side[j] * rest[j] for j in range(len(b)) if j != i)
            holds = (np.abs(rate) <= own) & rest[i]
            holding = rate / np.where(own > 0, own, np.inf)
            side[i] = np.where(holds, holding, np.where(rest[i], np.sign(rate), side[i]))
            moving[i] = ~holds
        if np.abs(side - before).max(initial=0.0) < 1e-14:
            break
    return side, moving


def _runge_kutta(plant, t, h, x, u, side, moving):
    """Advance all columns by one classical step; what moves keeps its sign, what is stuck stays."""
    half = 0.5 * h
    between = u.at(t + half)
    k1 = plant.rates(t, x, u.at(t), side, moving)
    k2 = plant.rates(t + half, x + half * k1, between, side, moving)
    k3 = plant.rates(t + half, x + half * k2, between, side, moving)
    k4 = plant.rates(t + h, x + h * k3, u.at(t + h), side, moving)
    k2 += k3
    k2 *= 2.0
    k2 += k1
    k2 += k4
    k2 *= h / 6.0
    return x + k2


class Plant:
    """A model's equations as NumPy functions of columns, with the parameters' values inserted."""

    def __init__(self, model):
        states, inputs = map(symbol, model.states), map(symbol, model.inputs)
        states, inputs = list(states), list(inputs)
        values = {symbol(name): sympy.Float(p.value) for name, p in model.parameters.items()}
        dry, equations = dry_friction(model), list(model.equations.values())
        kinks = [x for x in states if any(rate.has(sympy.sign(x)) for rate in equations)]
        further = [x for x in kinks if sympy.sign(x) not in dry.signs]
        unit = np.eye(len(states))
        self.rows = np.array([*dry.rows, *(unit[states.index(x)] for x in further)])
        self.rows = self.rows.reshape(-1, len(states))
        sides = [*dry.symbols, *(sympy.Symbol(f"_side_{x}", real=True) for x in further)]
        held = dict(zip(map(sympy.sign, further), sides[len(dry.rows) :], strict=True))
        rates, outputs = (
            [with_signs(each, dry).xreplace(held).subs(values) for each in part]
            for part in (equations, model.outputs.values())
        )
        by_sides = [[sympy.diff(rate, side) for rate in rates] for side in sides]
        self.alone = self._alone(by_sides)
        self.shows_sides = any(output.has(*sides) for output in outputs) if sides else False
        arguments = [TIME, states, inputs, sides]
        self._rates = _compile(arguments, rates)
        self._by_sides = _compile(arguments, [*chain(*by_sides)])
        self._outputs = _compile(arguments, outputs)

    def _alone(self, by_sides):
        """Return the states that are flows; none where a friction acts on more than its own."""
        states = [np.flatnonzero(row) for row in self.rows]
        own = all(len(each) == 1 for each in states) and all(
            rate == 0 or i == state[0]
            for state, rates in zip(states, by_sides, strict=True)
            for i, rate in enumerate(rates)
        )
        return [int(state[0]) for state in states] if own else None

    def flows(self, x):
        """Return the flows under dry friction."""
        return np.tensordot(self.rows, x, axes=1)

    def sides(self, x):
        """Return the signs of the flows, zero at rest."""
        flow, size = self.flows(x), np.tensordot(np.abs(self.rows), np.abs(x), axes=1)
        return np.where(np.abs(flow) <= ROUNDING * size, 0.0, np.sign(flow))

    def rates(self, t, x, u, side, moving=None):
        """Return the derivatives of the states; zero for a flow that sticks."""
        out = self._filled(self._rates(t, x, u, side), x)
        if moving is None or moving.all():
            return out
        if self.alone is None:
            return self._held(t, x, u, side, moving, out)
        for i, row in enumerate(self.alone):
            out[row] *= moving[i]
        return out

    def _filled(self, values, x):
        """Return values for every state and column."""
        out = np.empty((len(values), *x.shape[1:]))
        for i, value in enumerate(values):
            out[i] = value
        return out

    def balance(self, t, x, u, side):
        """Return how the flows' rates fall with every sign, and those with the signs given."""
        k = len(self.rows)
        columns = self._filled(self._by_sides(t, x, u, side), x).reshape(k, *x.shape)
        A = -np.moveaxis(np.array([self.flows(column) for column in columns]), 0, 1)
        return A, self.flows(self._filled(self._rates(t, x, u, side), x))

    def _held(self, t, x, u, side, moving, out):
        """Return the rates with what holds the stuck flows: a zero rate for all of them at once."""
        A, b = self.balance(t, x, u, side)
        stuck = moving == 0
        A = np.moveaxis(A * stuck * stuck[:, None], (0, 1), (-2, -1))
        change = np.linalg.pinv(A, rcond=ROUNDING) @ np.moveaxis(b * stuck, 0, -1)[..., None]
        columns = self._filled(self._by_sides(t, x, u, side), x).reshape(len(b), *x.shape)
        out += np.einsum("...k,kn...->n...", change[..., 0], columns)
        for i, row in enumerate(self.rows):
            if np.count_nonzero(row) == 1:
                out[np.flatnonzero(row)[0]] *= moving[i]
        return out

    def outputs(self, t, x, u, side):
        """Return the outputs."""
        seen = self._outputs(t, x, u, self.sides(x) if side is None else side)
        return np.stack([np.broadcast_to(y, x.shape[1:]) for y in seen])


class _Printer(NumPyPrinter):
    """NumPy code whose maximum and minimum broadcast."""

    def _print_Max(self, expr):
        name = self._module_format(f"numpy.{type(expr).__name__.lower()}imum")
        return reduce(lambda one, other: f"{name}({one}, {other})", map(self._print, expr.args))

    _print_Min = _print_Max


def _compile(arguments, expressions):
    """Compile expressions to one NumPy function, with common parts computed once."""
    return sympy.lambdify(arguments, expressions, modules="numpy", printer=_Printer, cse=True)
