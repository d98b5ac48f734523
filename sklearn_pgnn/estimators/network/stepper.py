"""A trained network advanced one sample at a time, for a real-time loop."""

import warnings
from collections import deque
from dataclasses import replace
from math import isfinite

import numpy as np
from torch import nn

from sklearn_pgnn.estimators.network.step_network import output_function, ready_to_run
from sklearn_pgnn.exceptions import SimulationError, SimulationWarning
from sklearn_pgnn.simulation.inputs import delayed_inputs
from sklearn_pgnn.simulation.network_run import NetworkRecord, NetworkStep
from sklearn_pgnn.simulation.simulate import settled_start, simulate


class Stepper:
    """A trained network with its state `x` at the time `t` [s] since the start, and its weights.

    Made by `PGNNLRegressor.stepper`. `guide_line` are slope and offset by which the simulated
    columns of the training data follow the simulation, `parts` the steps from sample to sample.
    """

    def __init__(
        self, core: nn.Module, step: NetworkStep, x0, interval: float, guide_line, parts: int = 1
    ):
        self._late, self._line = step.model, guide_line
        # delays are applied here, from the past inputs
        self._step = replace(step, model=step.model.replace(delays={}))
        self._run, self._outputs_of = ready_to_run(core, self._step), output_function(step.model)
        self._interval, self.t = float(interval), 0.0
        self._times = self._interval * np.arange(parts + 1) / parts
        self._features, self._none = None, np.zeros((parts + 1, 0))
        self._told = x0 is not None
        start = list(step.model.initial_state.values()) if x0 is None else x0
        self.x = np.array(start, dtype=float)
        if self.x.shape != (len(step.model.states),):
            raise ValueError(
                f"x0: expected {len(step.model.states)} numbers, one for each of "
                f"{', '.join(step.model.states)}, got shape {self.x.shape}."
            )
        _refuse_not_finite("x0", self.x, step.model.states, "leave x0 out to start as the model")
        self._simulated = self.x.copy()
        longest = max([step.model.parameters[p].value for p in step.model.delays.values()] or [0.0])
        self._inputs: deque[np.ndarray] = deque(maxlen=int(longest / interval) + 3)

    def step(self, u, features=()) -> np.ndarray:
        """Return the outputs at the next sample, until which the inputs are held.

        `features` are further columns there. Where an output depends on an input itself, `output`
        gives it once the next input is known. After an error, of a wrong or not finite input or of
        the simulation that guides the network, nothing is advanced.
        """
        u, features = self._read(u), np.ravel(features)
        seen = self._features_along(features) if features.size else self._none
        acting, t = self._acting_along(u), self.t + self._times
        guide = self._guide(t, acting) if self._step.guide == "simulation" else self._none
        self._inputs.extend([u] if self._inputs else [u, u])
        self._features = features if features.size else self._features
        self.x = self._run(NetworkRecord(t, acting, acting, guide, seen, self.x))[0][-1]
        self.t = float(t[-1])
        return self._outputs(acting[-1])

    def output(self, u) -> np.ndarray:
        """Return the outputs at the present sample, as ``predict`` does; nothing is advanced."""
        return self._outputs(self._acting_along(self._read(u))[0])

    def _read(self, u) -> np.ndarray:
        """Return an input as an array; the first one settles states without an initial value."""
        u = np.atleast_1d(np.asarray(u, dtype=float))
        if u.shape != (len(self._late.inputs),):
            raise ValueError(
                f"u: expected {len(self._late.inputs)} numbers, one for each of "
                f"{', '.join(self._late.inputs)}, got shape {u.shape}."
            )
        if not all(map(isfinite, u.tolist())):
            told = f"repeat the last good one; the state is still that of t = {self.t:g} s"
            _refuse_not_finite("u", u, self._late.inputs, told)
        if not (self._told or self._inputs):
            for i, (state, value) in enumerate(settled_start(self._late, u).items()):
                if state in self._late.settled:
                    self.x[i] = self._simulated[i] = value
        return u

    def _outputs(self, acting) -> np.ndarray:
        return np.array(self._outputs_of(self.t, *self.x, *acting), dtype=float)

    def _acting_along(self, u) -> np.ndarray:
        """Return the inputs as they act at the steps of the network until the next sample.

        Before the start they had their first value.
        """
        parts = self._times.size - 1
        if not self._late.delays:
            return np.array([u] * (parts + 1))
        history = np.array([*(self._inputs or [u]), *[u] * parts])
        past = self.t - self._interval * np.arange(len(history) - parts + 1)[::-1]
        t = np.append(past, self.t + self._times[1:-1])
        acting = delayed_inputs(self._late, t, history)[-parts:, : u.size]
        return np.vstack([acting, acting[-1:]])

    def _features_along(self, features) -> np.ndarray:
        """Return further columns at the steps of the network; they change at the next sample."""
        if not all(map(isfinite, features.tolist())):
            raise ValueError(
                f"features: expected finite numbers, got {features.tolist()}. Remedy: repeat the "
                f"last good ones; nothing was advanced."
            )
        held = features if self._features is None else self._features
        return np.array([held] * (self._times.size - 1) + [features], dtype=float)

    def _guide(self, t, acting) -> np.ndarray:
        """Simulate the model along, in open loop."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SimulationWarning)  # it is an error here
            run = simulate(
                self._step.model, t, acting, self._simulated, substeps=self._step.substeps
            )
        if not run.success:
            at = zip(self._late.states, self._simulated.tolist(), strict=True)
            raise SimulationError(
                f"step: the simulation of {self._late.name!r}, which guides the network, became "
                f"non-finite between t = {t[0]:g} s and t = {t[-1]:g} s (before: "
                f"{', '.join(f'{state} = {value:.3g}' for state, value in at)}). Remedy: check x0, "
                f"the inputs and the parameters' values; begin with a new stepper; or train with "
                f"guide='terms', which simulates nothing beside the network. Nothing was advanced."
            )
        self._simulated = run.x[-1]
        slope, offset = self._line
        return run.x * slope + offset


def _refuse_not_finite(what: str, values, names, remedy: str) -> None:
    """Raise `ValueError` where a value is NaN or infinite, and name it."""
    for name, value in zip(names, values.tolist(), strict=True):
        if not isfinite(value):
            raise ValueError(
                f"{what}: expected finite numbers, got {value} for {name!r}. Remedy: {remedy}."
            )
