r"""A separate integrator for plants: many records at once in NumPy, without `simulation`.

A test that hides an effect must not simulate the truth with the code under test. Here the records
advance together as columns, by the classical Runge-Kutta method in equal substeps,

.. math:: x_{n+1} = x_n + \tfrac{h}{6}(k_1 + 2 k_2 + 2 k_3 + k_4),

under zero-order hold: ``u[k]`` acts from ``t[k]`` to ``t[k+1]`` and ``y[k]`` is measured at
``t[k]``; or, if the model's `simulation` says so, with linear interpolation of the inputs.
An input delay :math:`\tau` is an exact shift in time: the steps also break where ``u(t - tau)``
jumps or has a kink. Before the record begins, an input has its first value.

Dry friction sticks exactly. The sign of ``v`` in ``sign(v)`` is held within a step; a column
whose velocity changes sign is stepped again to the root of ``v`` (regula falsi), where ``v`` is
set to zero. From rest it moves forward or backward only if the rate with that sign points there;
otherwise it stays exactly at rest. The state is thus of fourth order in the step from event to
event, unless a kink of the rates (a dead zone, a limit) falls within a step.
"""

from dataclasses import dataclass

import numpy as np
import sympy
from sympy.printing.numpy import NumPyPrinter

from sklearn_pgnn.physics.expressions import TIME, symbol

#: crossings of zero within one substep; a column that crosses more often comes to rest
MAX_CROSSINGS = 8
#: regula falsi steps to locate a crossing
ROOT_STEPS = 3


def integrate(model, t, u=None, x0=None, *, substeps: int = 4):
    """Simulate many records of equal length together.

    Parameters
    ----------
    model : PhysicsModel
        The machine.
    t : ndarray of shape (n_samples,)
        Time [s], increasing, common to the records.
    u : ndarray of shape (n_records, n_samples, n_inputs), optional
        Inputs, held from sample to sample unless the model's `simulation` asks for linear
        interpolation; by default zero.
    x0 : ndarray of shape (n_records, n_states), optional
        Initial states; by default the model's `initial_state` in every record, with `settled`
        states at the first inputs.
    substeps : int, default=4
        Runge-Kutta steps per sample interval.

    Returns
    -------
    x : ndarray of shape (n_records, n_samples, n_states)
        States; not finite where a record became non-finite.
    y : ndarray of shape (n_records, n_samples, n_outputs)
        Outputs.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> lag = PhysicsModel({"x": "V"}, {"x": "(u - x)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 4, 5)
    >>> x, y = integrate(lag, t, np.ones((1, 5, 1)))
    >>> np.abs(y[0, :, 0] - (1 - np.exp(-t / 2))).max() < 1e-6
    np.True_
    """
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
        seen = [values[sampled] for values, _ in acting]
        y = plant.outputs(t[:, None], np.moveaxis(x, 1, 0), seen)
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

    Parameters
    ----------
    start : float
        The first instant [s].
    lines : list of (ndarray, ndarray)
        Initial value and slope of every input, by column.
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
    side = np.sign(x[plant.dry])
    moving = np.ones_like(side)
    if not side.all():
        side, moving = _leave_rest(plant, t, x, u)
    new = _runge_kutta(plant, t, h, x, u, side, moving)
    cut = np.flatnonzero((side * new[plant.dry] < 0).any(axis=0))
    if cut.size and crossings:
        t, h = np.broadcast_to(t, x.shape[1])[cut], np.broadcast_to(h, x.shape[1])[cut]
        columns = x[:, cut], u.of(cut), side[:, cut], moving[:, cut]
        new[:, cut] = _cross(plant, t, h, *columns, new[:, cut], crossings)
    return new


def _cross(plant, t, h, x, u, side, moving, new, crossings):
    """Step to the first zero of a velocity, set it to zero there, and step the rest."""
    row, share = _first_zero(plant, t, h, x, u, side, moving, new)
    x = _runge_kutta(plant, t, share * h, x, u, side, moving)
    x[row, np.arange(row.size)] = 0.0
    return _advance(plant, t + share * h, (1 - share) * h, x, u, crossings - 1)


def _first_zero(plant, t, h, x, u, side, moving, new):
    """Return which state crosses zero first in every column, and at what fraction of the step."""
    old, new = x[plant.dry], new[plant.dry]
    chord = np.where(side * new < 0, old / (old - new), np.inf)
    first = chord.argmin(axis=0)
    column = np.arange(first.size)
    row = plant.dry[first]
    low, v_low, high, v_high = 0.0, old[first, column], 1.0, new[first, column]
    for _ in range(ROOT_STEPS):
        share = _chord_zero(low, v_low, high, v_high)
        v = _runge_kutta(plant, t, share * h, x, u, side, moving)[row, column]
        before = v * side[first, column] > 0
        low, v_low = np.where(before, share, low), np.where(before, v, v_low)
        high, v_high = np.where(before, high, share), np.where(before, v_high, v)
    return row, _chord_zero(low, v_low, high, v_high)


def _chord_zero(low, v_low, high, v_high):
    """Return the zero of a chord; its lower end where the chord vanishes, as from rest."""
    fall = v_low - v_high
    return low + (high - low) * np.divide(v_low, fall, out=np.zeros_like(fall), where=fall != 0)


def _leave_rest(plant, t, x, u):
    """Return the sign of every dry friction, and 1 if its velocity may move, else 0."""
    side, u = np.sign(x[plant.dry]), u.at(t)
    moving = np.ones_like(side)
    for i, row in enumerate(plant.dry):
        forward = _rate_on_side(plant, t, x, u, side, i, 1.0)[row]
        backward = _rate_on_side(plant, t, x, u, side, i, -1.0)[row]
        leaving = np.where(forward > 0, 1.0, np.where(backward < 0, -1.0, 0.0))
        holding = (backward + forward) / np.where(backward > forward, backward - forward, np.inf)
        rest = side[i] == 0
        side[i, rest] = np.where(leaving != 0, leaving, holding)[rest]
        moving[i, rest] = np.abs(leaving[rest])
    return side, moving


def _rate_on_side(plant, t, x, u, side, i, value):
    """Return the rates with friction i of a given sign."""
    side = side.copy()
    side[i] = value
    return plant.rates(t, x, u, side)


def _runge_kutta(plant, t, h, x, u, side, moving):
    """Advance all columns by one classical step with fixed friction signs; stuck ones stay."""
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
    """A model's equations as NumPy functions of columns, with the parameters' values inserted.

    Parameters
    ----------
    model : PhysicsModel
        The machine.
    """

    def __init__(self, model):
        states, inputs = map(symbol, model.states), map(symbol, model.inputs)
        states, inputs = list(states), list(inputs)
        values = {symbol(name): sympy.Float(p.value) for name, p in model.parameters.items()}
        rates = list(model.equations.values())
        dry = [i for i, x in enumerate(states) if any(rate.has(sympy.sign(x)) for rate in rates)]
        sides = [sympy.Symbol(f"_side_{states[i]}", real=True) for i in dry]
        held = {sympy.sign(states[i]): side for i, side in zip(dry, sides, strict=True)}
        self.dry = np.array(dry, dtype=int)
        rates = [rate.xreplace(held).subs(values) for rate in rates]
        self._rates = _compile([TIME, states, inputs, sides], rates)
        outputs = [output.subs(values) for output in model.outputs.values()]
        self._outputs = _compile([TIME, states, inputs], outputs)

    def rates(self, t, x, u, side, moving=None):
        """Return the derivatives of the states; zero for a velocity that sticks."""
        out = np.empty_like(x)
        for i, rate in enumerate(self._rates(t, x, u, side)):
            out[i] = rate
        if moving is not None:
            for i, row in enumerate(self.dry):
                out[row] *= moving[i]
        return out

    def outputs(self, t, x, u):
        """Return the outputs."""
        seen = self._outputs(t, x, u)
        return np.stack([np.broadcast_to(y, x.shape[1:]) for y in seen])


class _Printer(NumPyPrinter):
    """NumPy code whose maximum and minimum broadcast."""

    def _print_Max(self, expr):
        return self._chain("maximum", expr.args)

    def _print_Min(self, expr):
        return self._chain("minimum", expr.args)

    def _chain(self, name, arguments):
        first, *rest = map(self._print, arguments)
        for argument in rest:
            first = f"{self._module_format('numpy.' + name)}({first}, {argument})"
        return first


def _compile(arguments, expressions):
    """Compile expressions to one NumPy function, with common parts computed once."""
    return sympy.lambdify(arguments, expressions, modules="numpy", printer=_Printer, cse=True)
