"""States of a record: smoothed where they are measured, differentiated or simulated where not."""

import itertools
import warnings
from dataclasses import dataclass

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.simulate import Simulation, settled_start, simulate
from sklearn_pgnn.simulation.windows import ENDLESS, Windows
from sklearn_pgnn.trajectories.smoothing import FEWEST, Smoothed, choose_penalty, smooth

#: how many of its standard errors a smoothed state may be off
SAFETY = 3.0
#: how far a state seen by a sensor may be off, as a share of its range: the sensor may lie
MEASURED_SPREAD = 0.3


@dataclass(frozen=True)
class StateEstimate:
    """States at every sample of the records.

    Parameters
    ----------
    x : ndarray of shape (n_samples, n_states)
        Estimated states.
    spread : ndarray of shape (n_states,)
        How far each may be off.
    """

    x: np.ndarray
    spread: np.ndarray


class StateEstimator:
    """Estimate the states of a model, or of one of its extensions, from records.

    A state that an output shows is smoothed; the velocity of such a position is its smoothed
    slope; every other state, and the sign of one that is shown by its magnitude, is taken from a
    free-run simulation.

    Parameters
    ----------
    model : PhysicsModel
        The model without extensions: its outputs tell what the record shows.
    windows : Windows
        The records.
    starts : list of ndarray of shape (n_states,)
        Initial state of every record, NaN where unknown.
    """

    def __init__(self, model: PhysicsModel, windows: Windows, starts: list[np.ndarray]):
        self.windows = windows
        self.starts = [dict(zip(model.states, x0, strict=True)) for x0 in starts]
        self.known = self._smooth_outputs(model)

    def _smooth_outputs(self, model):
        """Smooth what is measured: values and spread by state name."""
        known = {}
        positions = {position: velocity for velocity, position in model.kinematic_pairs.items()}
        for column, output in enumerate(model.outputs.values()):
            states = [name for name in model.states if output == symbol(name)]
            for state in states:
                value, slope = self._smooth_column(column)
                known[state] = _free_within_range(*value)
                velocity = positions.get(state)
                if velocity is not None and velocity not in known:
                    known[velocity] = _free_within_range(*slope)
        return known

    def _smooth_column(self, column):
        """Smooth one output of every record, with the spread of value and slope."""
        windows, penalty = self.windows, self._penalty(column)
        values, slopes, errors = [], [], []
        for a, b in zip(windows.bounds[:-1], windows.bounds[1:], strict=True):
            t, y = windows.t[a:b], windows.y[a:b, column]
            whole = smooth(t, y, penalty)
            values.append(whole.value(t))
            slopes.append(whole.slope(t))
            errors.append(_halves_differ(t, y, penalty))
        value_error, slope_error = SAFETY * np.sqrt(np.mean(errors, axis=0))
        return (np.concatenate(values), value_error), (np.concatenate(slopes), slope_error)

    def _penalty(self, column) -> float | None:
        """Choose the penalty on the record with the most samples; none where these are too few."""
        bounds, y = self.windows.bounds, self.windows.y[:, column]
        seen = [a + np.flatnonzero(np.isfinite(y[a:b])) for a, b in itertools.pairwise(bounds)]
        most = max(seen, key=len)
        if most.size < FEWEST:
            return None
        t = self.windows.t[most]
        return choose_penalty((t - t[0]) / np.mean(np.diff(t)), y[most])

    def hidden(self, model: PhysicsModel) -> tuple[str, ...]:
        """Name the states of a model that no output shows, alone or as a slope."""
        return tuple(state for state in model.states if state not in self.known)

    def estimate(self, model: PhysicsModel) -> StateEstimate:
        """Estimate the states of an extension of the model.

        Parameters
        ----------
        model : PhysicsModel
            The model or an extension of it, at its present parameters.

        Returns
        -------
        StateEstimate
            Its states at every sample.
        """
        x = np.full((self.windows.t.size, len(model.states)), np.nan)
        spread = np.full(len(model.states), np.nan)
        for i, state in enumerate(model.states):
            if state in self.known:
                x[:, i], spread[i] = self.known[state]
        unknown = np.flatnonzero(np.isnan(spread))
        turned = [state for state in unsigned_states(model) if state in self.known]
        unsigned = [list(model.states).index(state) for state in turned]
        if unknown.size or unsigned:
            run = self._simulate(model)
            x[:, unknown] = run[:, unknown]
            x[:, unsigned] *= np.where(run[:, unsigned[:1]] < 0, -1.0, 1.0)
            spread[unknown] = np.std(x[:, unknown], axis=0)
        return StateEstimate(x, np.maximum(spread, _smallest_spread(x)))

    def _simulate(self, model) -> np.ndarray:
        """Simulate every record in free run; where that fails the state stays at its start."""
        windows, runs = self.windows, []
        for r, (a, b) in enumerate(zip(windows.bounds[:-1], windows.bounds[1:], strict=True)):
            start = {**settled_start(model, windows.u[a]), **_finite(self.starts[r])}
            known = {s: v[0][a] for s, v in self.known.items()}
            x0 = np.array([{**start, **known}[state] for state in model.states])
            run = free_run(model, windows, a, b, x0).x
            runs.append(np.where(np.abs(run) < ENDLESS, run, x0))
        return np.concatenate(runs)


def unsigned_states(model: PhysicsModel) -> tuple[str, ...]:
    """Name the states of which the outputs show the magnitude only, then their velocities.

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import SensorRectification
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> unsigned_states(cart_on_spring() + SensorRectification("position"))
    ('x', 'v')
    """
    shown = [g.args[0] for g in model.outputs.values() if isinstance(g, sympy.Abs)]
    hidden = [str(state) for state in shown if str(state) in model.states]
    return (*hidden, *(v for v, at in model.kinematic_pairs.items() if at in hidden))


def free_run(model: PhysicsModel, windows: Windows, a: int, b: int, x0) -> Simulation:
    """Simulate samples `a` to `b` of the records; a failure is left to the reader of the result."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulate(
            model,
            windows.t[a:b],
            windows.u[a:b],
            x0,
            substeps=windows.substeps,
            hold=windows.hold,
        )


def _free_within_range(values, spread):
    """Let a state go as far as a sensor may lie: the window's own samples say where it is."""
    return values, max(spread, MEASURED_SPREAD * float(np.std(values)))


def _finite(start: dict) -> dict:
    return {name: float(value) for name, value in start.items() if np.isfinite(value)}


def _halves_differ(t, y, penalty):
    """Estimate the variance of value and slope from two halves of the samples."""
    if t.size < 20:
        return np.inf, np.inf
    # a half has twice the sample interval: the same smoothing in time is 1/8 of the penalty
    first: Smoothed = smooth(t[::2], y[::2], penalty / 8)
    second: Smoothed = smooth(t[1::2], y[1::2], penalty / 8)
    inner = t[2:-2]
    value = np.mean((first.value(inner) - second.value(inner)) ** 2) / 4
    slope = np.mean((first.slope(inner) - second.slope(inner)) ** 2) / 4
    return value, slope


def _smallest_spread(x):
    """Keep a spread from vanishing where a record is free of noise."""
    return 1e-6 * np.maximum(np.std(x, axis=0), 1e-9)
