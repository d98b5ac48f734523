"""States of a record: smoothed where measured, else differentiated or simulated."""

import warnings
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.shown_states import shown_states
from sklearn_pgnn.simulation.led_states import start_values
from sklearn_pgnn.simulation.output_inverse import has_scale, magnitude_in, state_behind
from sklearn_pgnn.simulation.simulate import Simulation, settled_start, simulate_acting
from sklearn_pgnn.simulation.smoothed_output import SmoothedOutput
from sklearn_pgnn.simulation.state_sources import Source, take_states
from sklearn_pgnn.simulation.windows import ShootingWindows

#: states so large that their squares and products may not be finite
ENDLESS = 1e100


@dataclass(frozen=True)
class StateEstimate:
    """States (n_samples, n_states) of the records, and their uncertainty (n_states,)."""

    x: np.ndarray
    spread: np.ndarray


class StateEstimator:
    """Estimate the states of a model, or of one of its extensions, from records.

    A state that an output shows is smoothed; the velocity of such a position is its smoothed
    slope. Of several outputs that show a state, the one counts that determines it best in a record
    (`sklearn_pgnn.simulation.state_sources`). Every other state, and the sign of one that is shown
    by its magnitude, is taken from a free-run simulation.

    The outputs of the model without extensions tell what the record shows. `starts` are the initial
    states of the records, NaN where unknown.
    """

    def __init__(self, model: PhysicsModel, windows: ShootingWindows, starts: list[np.ndarray]):
        self.windows = windows
        self.starts = [dict(zip(model.states, x0, strict=True)) for x0 in starts]
        #: the initial states given by every record
        self.told = [_finite(start) for start in self.starts]
        #: by state that outputs show, from which of them it is taken
        self._taken = take_states(model, windows)
        #: measured quantities: values by state name
        self.known = {state: taken.values for state, taken in self._taken.items()}
        #: by states, estimates that depend on no parameter
        self._estimates: dict[tuple[str, ...], StateEstimate] = {}
        self._shown, self._pairs = _shown(model), dict(model.slope_pairs)
        #: estimators of models whose outputs are exchanged, or whose clock runs otherwise
        self._rewired: dict[tuple, StateEstimator] = {}

    def __getstate__(self):
        """Keep no estimates: they can be made again."""
        return {**self.__dict__, "_estimates": {}, "_rewired": {}}

    def _of(self, model: PhysicsModel) -> "StateEstimator":
        """Return the estimator of an extension: its own where other outputs show its states."""
        shown = _shown(model)
        exchanged = shown != self._shown and set(shown) <= {*self._shown, *model.states}
        paces = [model.equations[x] / symbol(v) for v, x in self._pairs.items()]
        if not exchanged and not any(pace.is_number and pace != 1 for pace in paces):
            return self
        key = shown, tuple(model.slope_pairs.items()), id(self.windows)
        if key not in self._rewired:
            starts = [np.array([s.get(n, np.nan) for n in model.states]) for s in self.starts]
            self._rewired[key] = StateEstimator(model, self.windows, starts)
        return self._rewired[key]

    @property
    def is_shown(self) -> np.ndarray:
        """Whether every state that an output shows was measured, of shape (n_records,)."""
        measured = [taken.is_measured for taken in self._taken.values()]
        return np.all(measured, axis=0) if measured else np.ones(len(self.starts), dtype=bool)

    def hidden(self, model: PhysicsModel) -> tuple[str, ...]:
        """Name the states of a model that no output shows, alone or as a slope."""
        known = self._of(model).known
        return tuple(state for state in model.states if state not in known)

    def estimate(self, model: PhysicsModel) -> StateEstimate:
        """Estimate the states of an extension of the model."""
        if (own := self._of(model)) is not self:
            return own.estimate(model)
        states = tuple(model.states)
        simulated = self.hidden(model) or any(s in self.known for s in unsigned_states(model))
        if simulated or self._is_scaled(model):
            return self._estimate(model)
        if states not in self._estimates:
            self._estimates[states] = self._estimate(model)
        return self._estimates[states]

    def _estimate(self, model) -> StateEstimate:
        x = self.values(model)
        spread = np.array([self._spread(state, x[:, i]) for i, state in enumerate(model.states)])
        for state, other in self._followers(
            model
        ):  # how full a store behind another is, is unknown
            spread[state] = max(spread[state], np.std(x[:, other]))
        x.flags.writeable = False
        return StateEstimate(x, np.maximum(spread, 1e-6 * np.maximum(np.std(x, axis=0), 1e-9)))

    def _followers(self, model: PhysicsModel) -> list[tuple[int, int]]:
        """Return the states that others settle and no output shows, with these, by their places."""
        names, pairs = list(model.states), model.settled.items()
        hidden = (pair for pair in pairs if pair[1] in names and pair[0] not in self.known)
        return [(names.index(state), names.index(other)) for state, other in hidden]

    def _is_scaled(self, model) -> bool:
        """Return whether an output shows a state on a scale that parameters change."""
        return any(
            has_scale(model, source.smoothed.name, source.smoothed.state)
            for taken in self._taken.values()
            for source in taken.used
        )

    def expected_starts(
        self, model: PhysicsModel, windows: ShootingWindows
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the expected initial states of windows, and the uncertainty of each state."""
        estimate = self.estimate(model)
        return start_values(model, windows, estimate.x), estimate.spread

    def _spread(self, state, values) -> float:
        return self._taken[state].spread if state in self.known else float(np.std(values))

    def values(self, model: PhysicsModel) -> np.ndarray:
        """Return the estimated states without their spread, which is faster."""
        if (own := self._of(model)) is not self:
            return own.values(model)
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
        if not self._is_scaled(model):
            return self.known
        behind = lru_cache(partial(_behind, model))
        return {
            state: taken.joined(lambda source: _on_scale(source, behind(source.smoothed)))
            for state, taken in self._taken.items()
        }

    def measured_samples(self, state: str) -> np.ndarray:
        """Find the samples at which the output that a state is taken from was measured."""
        if state not in self._taken:
            return np.ones(self.windows.t.size, dtype=bool)
        return self._taken[state].measured_samples

    def _simulate(self, model, known) -> np.ndarray:
        """Simulate every record in free run; if that fails, the state stays at its start."""
        windows, runs = self.windows, []
        for r, (a, b) in enumerate(pairwise(windows.bounds)):
            told = _finite(self.starts[r]) | {s: float(v[a]) for s, v in known.items()}
            start = settled_start(model, windows.u[a], told)
            x0 = np.array([start[state] for state in model.states])
            run = free_run(model, windows, a, b, x0).x
            runs.append(np.where(np.abs(run) < ENDLESS, run, x0))
        return np.concatenate(runs)


def _shown(model: PhysicsModel) -> tuple[str, ...]:
    """Return the expressions of the outputs, as text."""
    return tuple(str(g) for g in model.outputs.values())


def _behind(model: PhysicsModel, smoothed: SmoothedOutput):
    """Return the state behind an output, and its slope; None where that shows it as it is."""
    return state_behind(model, smoothed.name, smoothed.state, smoothed.value)


def _on_scale(source: Source, behind) -> np.ndarray:
    """Return a state as its output shows it, or as it is behind it."""
    if behind is None:
        return source.values
    value, slope = behind
    return source.values * slope if source.derivative else value


def hidden_states(model: PhysicsModel) -> tuple[str, ...]:
    """Name the states of a model that its outputs do not show, alone or as a slope."""
    shown = shown_states(model)
    return tuple(state for state in model.states if state not in shown)


def unsigned_states(model: PhysicsModel) -> tuple[str, ...]:
    """Name the states of which the outputs show the magnitude only, then their velocities."""
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
    options = {**windows.options_in(record), "wrt": wrt}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulate_acting(
            model, windows.t[a:b], acting, np.asarray(x0, dtype=float), **options
        )


def _finite(start: dict) -> dict:
    return {name: float(value) for name, value in start.items() if np.isfinite(value)}
