"""States of a record: smoothed where measured, else differentiated or simulated."""

import warnings
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
import sympy

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.shown_states import shown_by, shown_states
from sklearn_pgnn.simulation.led_states import start_values
from sklearn_pgnn.simulation.output_inverse import has_scale, magnitude_in, state_behind
from sklearn_pgnn.simulation.simulate import Simulation, settled_start, simulate_acting
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.trajectories.smoothing import FEWEST, Smoothed, choose_penalty, smooth

#: spread of a smoothed state, in its standard errors
SAFETY = 3.0
#: least spread of a measured state, as a share of its range: the sensor may have an error
MEASURED_SPREAD = 0.3
#: measured samples without which a half of a record shows no error of the smoothing
HALF = 10
#: states so large that their squares and products may not be finite
ENDLESS = 1e100


@dataclass(frozen=True)
class StateEstimate:
    """States at every sample of the records.

    Parameters
    ----------
    x : ndarray of shape (n_samples, n_states)
        Estimated states.
    spread : ndarray of shape (n_states,)
        Uncertainty of each state.
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
    windows : ShootingWindows
        The records.
    starts : list of ndarray of shape (n_states,)
        Initial state of every record, NaN where unknown.
    """

    def __init__(self, model: PhysicsModel, windows: ShootingWindows, starts: list[np.ndarray]):
        self.windows = windows
        self.starts = [dict(zip(model.states, x0, strict=True)) for x0 in starts]
        #: the initial states given by every record
        self.told = [_finite(start) for start in self.starts]
        #: measured quantities: values by state name
        self.known: dict[str, np.ndarray] = {}
        self._from: dict[str, tuple[_SmoothedOutput, int]] = {}
        #: by state, all outputs that show it
        self._sources: dict[str, list[tuple[_SmoothedOutput, int]]] = {}
        #: by state, the output it is taken from, and the state that this shows
        self._shown: dict[str, tuple[str, str]] = {}
        #: by states, estimates that depend on no parameter
        self._estimates: dict[tuple[str, ...], StateEstimate] = {}
        self._smooth_outputs(model)

    def __getstate__(self):
        """Keep no estimates: they can be made again."""
        return {**self.__dict__, "_estimates": {}}

    def _smooth_outputs(self, model) -> None:
        """Smooth what is measured."""
        for column, name in enumerate(model.outputs):
            shown = shown_by(model, name)
            if shown:
                self._smooth_output(name, column, *shown)
        for state, sources in self._sources.items():
            if not self._from[state][0].is_measured.all():
                self.known[state] = self._where_measured(state, sources)

    def _where_measured(self, state, sources) -> np.ndarray:
        """Return a state, in records in which its output was not measured by another one."""
        usual, values = self._from[state], self.known[state].copy()
        for r, (a, b) in enumerate(pairwise(self.windows.bounds)):
            if not usual[0].is_measured[r]:
                other = next((each for each in sources if each[0].is_measured[r]), usual)
                values[a:b] = other[0].of(other[1])[a:b]
        return values

    @property
    def is_shown(self) -> np.ndarray:
        """Whether every state that an output shows was measured, of shape (n_records,)."""
        measured = [
            np.any([smoothed.is_measured for smoothed, _ in sources], axis=0)
            for sources in self._sources.values()
        ]
        return np.all(measured, axis=0) if measured else np.ones(len(self.starts), dtype=bool)

    def _smooth_output(self, name: str, column: int, state: str, *velocities: str) -> None:
        """Smooth an output that shows a state, whose slope is the velocity if it has one."""
        smoothed = _SmoothedOutput(self.windows, column)
        self.known[state], self._from[state] = smoothed.value, (smoothed, 0)
        self._shown[state] = name, state
        for place, each in enumerate((state, *velocities)):
            self._sources.setdefault(each, []).append((smoothed, min(place, 1)))
        for velocity in velocities:
            if velocity not in self.known:
                self.known[velocity], self._from[velocity] = smoothed.slope, (smoothed, 1)
                self._shown[velocity] = name, state

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
        states = tuple(model.states)
        if self._is_simulated(model) or self._is_scaled(model):
            return self._estimate(model)
        if states not in self._estimates:
            self._estimates[states] = self._estimate(model)
        return self._estimates[states]

    def _estimate(self, model) -> StateEstimate:
        x = self.values(model)
        spread = [self._spread(state, x[:, i]) for i, state in enumerate(model.states)]
        x.flags.writeable = False
        return StateEstimate(x, np.maximum(spread, _smallest_spread(x)))

    def _is_simulated(self, model) -> bool:
        """Return whether some state, or its sign, is not shown."""
        return bool(self.hidden(model)) or any(s in self.known for s in unsigned_states(model))

    def _is_scaled(self, model) -> bool:
        """Return whether an output shows a state on a scale that parameters change."""
        return any(has_scale(model, *shown) for shown in self._shown.values())

    def expected_starts(
        self, model: PhysicsModel, windows: ShootingWindows
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the expected initial states of windows, and the uncertainty of each state.

        Parameters
        ----------
        model : PhysicsModel
            The model or an extension of it, at its present parameters.
        windows : ShootingWindows
            Windows of the records.

        Returns
        -------
        x0 : ndarray of shape (n_windows, n_states)
            As `sklearn_pgnn.simulation.window_fit.fit_windows` expects them.
        spread : ndarray of shape (n_states,)
            Their uncertainty.
        """
        estimate = self.estimate(model)
        return start_values(model, windows, estimate.x), estimate.spread

    def _spread(self, state, values) -> float:
        if state not in self.known:
            return float(np.std(values))
        smoothed, derivative = self._from[state]
        return float(smoothed.spreads[derivative])

    def values(self, model: PhysicsModel) -> np.ndarray:
        """Return the estimated states without their spread, which is faster.

        Parameters
        ----------
        model : PhysicsModel
            The model or an extension of it, at its present parameters.

        Returns
        -------
        ndarray of shape (n_samples, n_states)
            Its states at every sample.
        """
        names = list(model.states)
        x = np.empty((self.windows.t.size, len(names)))
        known = self._known(model)
        for i, state in enumerate(names):
            x[:, i] = known.get(state, np.nan)
        unknown = [names.index(state) for state in self.hidden(model)]
        unsigned = [names.index(state) for state in unsigned_states(model) if state in self.known]
        if unknown or unsigned:
            run = self._simulate(model, known)
            x[:, unknown] = run[:, unknown]
            x[:, unsigned] *= np.where(run[:, unsigned[:1]] < 0, -1.0, 1.0)
        return x

    def _known(self, model) -> dict[str, np.ndarray]:
        """Return what is measured, behind the model's sensors."""
        known = dict(self.known)
        for output, position in dict.fromkeys(self._shown.values()):
            behind = state_behind(model, output, position, self.known[position])
            if behind is None:
                continue
            known[position], slope = behind
            for state, shown in self._shown.items():
                if state != position and shown == (output, position):
                    known[state] = self.known[state] * slope
        return known

    def _simulate(self, model, known) -> np.ndarray:
        """Simulate every record in free run; if that fails, the state stays at its start."""
        windows, runs = self.windows, []
        for r, (a, b) in enumerate(pairwise(windows.bounds)):
            start = {**settled_start(model, windows.u[a]), **_finite(self.starts[r])}
            start |= {state: values[a] for state, values in known.items()}
            x0 = np.array([start[state] for state in model.states])
            run = free_run(model, windows, a, b, x0).x
            runs.append(np.where(np.abs(run) < ENDLESS, run, x0))
        return np.concatenate(runs)


class _SmoothedOutput:
    """One output of every record, smoothed with the same penalty in time.

    Parameters
    ----------
    windows : ShootingWindows
        The records.
    column : int
        The output.
    """

    def __init__(self, windows: ShootingWindows, column: int):
        self._records = [
            (windows.t[a:b], windows.y[a:b, column]) for a, b in pairwise(windows.bounds)
        ]
        self._penalties = self._choose_penalties()
        curves = [smooth(t, y, p) for (t, y), p in self._with_penalties()]
        times = [t for t, _ in self._records]
        self.value = np.concatenate([s.value(t) for s, t in zip(curves, times, strict=True)])
        self.slope = np.concatenate([s.slope(t) for s, t in zip(curves, times, strict=True)])

    def of(self, derivative: int) -> np.ndarray:
        """Return the smoothed output, or its slope."""
        return self.slope if derivative else self.value

    @cached_property
    def is_measured(self) -> np.ndarray:
        """Whether a record has enough samples of the output for a spline, of shape (n_records,)."""
        return np.array([np.isfinite(y).sum() >= FEWEST for _, y in self._records])

    def _with_penalties(self):
        return zip(self._records, self._penalties, strict=True)

    def _choose_penalties(self) -> list[float | None]:
        """Choose the penalty on the record with the most samples; none where these are too few.

        It is the same for all records in seconds, and so another in each one's sample interval.
        """
        seen = [(t[np.isfinite(y)], y[np.isfinite(y)]) for t, y in self._records]
        t, y = max(seen, key=lambda samples: samples[0].size)
        if t.size < FEWEST:
            return [None] * len(seen)
        step = _mean_step(t)
        penalty = choose_penalty((t - t[0]) / step, y) * step**3
        return [penalty / _mean_step(t) ** 3 for t, _ in seen]

    @cached_property
    def spreads(self) -> np.ndarray:
        """The spread of value and slope; this costs more than the smoothing.

        They may be as large as a sensor's error: a window's own samples determine its start. Of
        records that are too short to show it, nothing is known; infinite where all are.
        """
        found = [_halves_differ(t, y, p) for (t, y), p in self._with_penalties()]
        counts, variances = np.array([n for n, _ in found]), np.array([each for _, each in found])
        if not counts.any():
            return np.full(2, np.inf)
        errors = SAFETY * np.sqrt(np.average(variances, axis=0, weights=counts))
        return np.maximum(errors, MEASURED_SPREAD * np.std([self.value, self.slope], axis=1))


def hidden_states(model: PhysicsModel) -> tuple[str, ...]:
    """Name the states of a model that its outputs do not show, alone or as a slope.

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> hidden_states(cart_on_spring())
    ()
    """
    shown = shown_states(model)
    return tuple(state for state in model.states if state not in shown)


def unsigned_states(model: PhysicsModel) -> tuple[str, ...]:
    """Name the states of which the outputs show the magnitude only, then their velocities.

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import SensorRectification
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> unsigned_states(cart_on_spring() + SensorRectification("position"))
    ('x', 'v')
    """
    hidden = [s for s in model.states if any(_hides_sign(g, s) for g in model.outputs.values())]
    return (*hidden, *(v for v, at in model.slope_pairs.items() if at in hidden))


@lru_cache(maxsize=1024)
def _hides_sign(output: sympy.Expr, state: str) -> bool:
    """Return whether an output shows the magnitude of a state, and nothing else of it."""
    return isinstance(magnitude_in(output, state), sympy.Abs)


def free_run(
    model: PhysicsModel, windows: ShootingWindows, a: int, b: int, x0, wrt=None
) -> Simulation:
    """Simulate samples `a` to `b` of a record; a failure is left to the reader of the result.

    What a delayed input did before them is known from the record.
    """
    record = int(windows.record_at(a))
    begin = windows.bounds[record]
    acting = windows.acting_in_record(model, record)[a - begin : b - begin]
    options = {"substeps": windows.substeps, "hold": windows.hold, "wrt": wrt}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulate_acting(
            model, windows.t[a:b], acting, np.asarray(x0, dtype=float), **options
        )


def _finite(start: dict) -> dict:
    return {name: float(value) for name, value in start.items() if np.isfinite(value)}


def _mean_step(t: np.ndarray) -> float:
    """Return the mean sample interval [s]."""
    return (t[-1] - t[0]) / (t.size - 1) if t.size > 1 else 1.0


def _halves_differ(t, y, penalty) -> tuple[int, tuple[float, float]]:
    """Estimate the variance of value and slope from two halves of the measured samples.

    Returned are the number of samples that count, 0 where they are too few, and the variances.
    """
    t, y = t[np.isfinite(y)], y[np.isfinite(y)]
    if penalty is None or t.size < 2 * HALF:
        return 0, (0.0, 0.0)
    # a half has twice the sample interval: the same smoothing in time is 1/8 of the penalty
    first: Smoothed = smooth(t[::2], y[::2], penalty / 8)
    second: Smoothed = smooth(t[1::2], y[1::2], penalty / 8)
    inner = t[2:-2]
    value = np.mean((first.value(inner) - second.value(inner)) ** 2) / 4
    slope = np.mean((first.slope(inner) - second.slope(inner)) ** 2) / 4
    return t.size, (value, slope)


def _smallest_spread(x):
    """Keep a spread from vanishing where a record is free of noise."""
    return 1e-6 * np.maximum(np.std(x, axis=0), 1e-9)
