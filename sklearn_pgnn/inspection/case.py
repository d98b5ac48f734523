"""A named cause together with the records: the data from which its evidence is computed."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from sklearn_pgnn.diagnosis.free_run import free_runs
from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords
from sklearn_pgnn.estimation.hypothesis import sensors_last
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE, read_catalogue
from sklearn_pgnn.physics.effects.differences import DIFFERENCES
from sklearn_pgnn.physics.effects.formula import known_part
from sklearn_pgnn.physics.effects.wiring import WIRINGS
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.port import Port, inertia_at
from sklearn_pgnn.physics.shown_states import shown_states, told_states
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.windows import evaluate

#: a span is this share of a piece of a window, and at least two samples
SPAN_SHARE = 0.04


@dataclass(frozen=True)
class Samples:
    """A model, and by name the time, states, acting inputs and parameters at every sample."""

    records: DiagnosisRecords
    model: PhysicsModel
    table: dict

    @classmethod
    def of(cls, records: DiagnosisRecords, model: PhysicsModel, states_of: PhysicsModel):
        """Take states and inputs from the records, others from a simulation of `states_of`."""
        windows = records.windows
        table: dict[str, np.ndarray | float] = {"t": windows.t, **_states(records, states_of)}
        acting = windows.acting_inputs(model)
        table |= {name: acting[:, i] for i, name in enumerate(model.inputs)}
        table |= {name: parameter.value for name, parameter in model.parameters.items()}
        return cls(records, model, table)

    def value(self, expression, **other) -> np.ndarray:
        """Evaluate an expression at every sample, with other values in place of some."""
        table = {**self.table, **other}
        return evaluate_samples(expression, table, np.size(table["t"]))

    @property
    def span(self) -> int:
        """Half of the span, in samples, over which rates are compared."""
        windows = self.records.windows
        return max(1, round(SPAN_SHARE * float(np.median(windows.lengths)) / windows.blocks / 2))

    def rate(self, state: str) -> np.ndarray:
        """Return the measured rate of a state; NaN at the ends of the records."""
        return self._by_record(self.table[state], _slope)

    def mean(self, expression, **other) -> np.ndarray:
        """Return the mean of an expression over the span about every sample."""
        moving = [*self.records.fits[self.records.best].model.states, "t"]
        if self.records.windows.hold == "foh":
            moving += self.model.inputs
        ends = {
            name: np.append(self.table[name][1:], self.table[name][-1])
            for name in moving
            if name in self.table
        }
        both = self.value(expression, **other) + self.value(expression, **ends, **other)
        return self._by_record(both / 2, _mean)

    def _by_record(self, values, function):
        windows, m = self.records.windows, self.span
        out = np.full(windows.t.size, np.nan)
        for a, b in pairwise(windows.bounds):
            if b - a > 2 * m + 1:
                out[a + m : b - m] = function(windows.t[a:b], values[a:b], m)
        return out


def _slope(t, x, m):
    return (x[2 * m :] - x[: -2 * m]) / (t[2 * m :] - t[: -2 * m])


def _mean(t, f, m):
    total = np.concatenate([[0.0], np.cumsum(f[:-1] * np.diff(t))])
    return (total[2 * m :] - total[: -2 * m]) / (t[2 * m :] - t[: -2 * m])


def _states(records: DiagnosisRecords, model: PhysicsModel) -> dict[str, np.ndarray]:
    prior = records.fits["prior"].model
    table = {name: records.states[:, i] for i, name in enumerate(prior.states)}
    simulated = set(model.states) - told_states(prior)
    if simulated:
        run = np.concatenate([run.x for run in free_runs(records, records.best)])
        table |= {name: run[:, list(model.states).index(name)] for name in simulated}
    return table


@dataclass(frozen=True)
class Case:
    """A cause, the models with all that was found and without this cause, and the records."""

    records: DiagnosisRecords
    full: PhysicsModel
    without: PhysicsModel
    effect: Effect

    @property
    def name(self) -> str:
        """The cause in words."""
        return self.effect.title(self.effect.target)

    @property
    def parameters(self) -> list[Parameter]:
        """The parameters of the effect, as identified."""
        return [self.full.parameters[name] for name in self.effect.names().values()]

    @property
    def prior(self) -> PhysicsModel:
        """The model as it was given."""
        return self.records.fits["prior"].model

    @cached_property
    def samples(self) -> Samples:
        """The records with the parameters of both models."""
        found = Samples.of(self.records, self.without, self.full)
        values = {name: p.value for name, p in self.full.parameters.items()}
        return Samples(self.records, self.without, {**values, **found.table})

    @property
    def seen(self) -> frozenset[str]:
        """The states that can be taken from the records."""
        return shown_states(self.prior)

    def missing_rate(self, state: str) -> np.ndarray:
        """Return the measured rate of a state minus that of the model without the cause."""
        samples = self.samples
        return samples.rate(state) - samples.mean(self.without.equations[state])

    def shows(self, port: Port) -> bool:
        """Return whether the flow at a port can be taken from the records."""
        flow = set(map(str, port.flow.free_symbols)) & set(self.full.states)
        return flow <= self.seen

    def missing_effort(self, port: Port) -> np.ndarray:
        """Return the effort at a port that would make up for the missing rate of its flow."""
        missing = missing_rate_of(port, self.full, self.missing_rate)
        return missing * self.samples.value(inertia_at(port, self.full))


def missing_rate_of(
    port: Port, model: PhysicsModel, of_state: Callable[[str], np.ndarray]
) -> np.ndarray:
    """Return the missing rate of a port's flow, from those of its states."""
    values = {symbol(name): p.value for name, p in model.parameters.items()}
    slopes = {s: port.flow.diff(symbol(s)).xreplace(values) for s in model.states}
    parts = [float(slope) * of_state(s) for s, slope in slopes.items() if slope != 0]
    return np.sum(parts, axis=0)


def model_with_all(diagnosis) -> PhysicsModel:
    """Return the model with all causes found, and the formula if there is one."""
    part = diagnosis.discrepancy_
    return diagnosis.extended_model_ if part is None else part.model


def known_effects(diagnosis) -> dict:
    """Return the effects that a diagnosis may name, by id."""
    kinds = (*CATALOGUE, *WIRINGS, *DIFFERENCES, *read_catalogue(diagnosis.catalogue))
    return {effect.id: effect for effect in kinds}


def make_case(diagnosis, cause) -> Case:
    """Return a cause with all that was found, with and without it, and the records."""
    known, part = known_effects(diagnosis), diagnosis.discrepancy_
    full, without = model_with_all(diagnosis), diagnosis.records_.problem.prior
    others = (known[each.id](each.target) for each in diagnosis.records_.causes)
    for other in sensors_last(without, tuple(others)):
        if (other.id, other.target) != (cause.effect, cause.target):
            without = other.apply(without)
    if part is not None:
        without = known_part(part.effect, without).apply(without)
    values = {n: p.value for n, p in full.parameters.items() if n in without.parameters}
    if cause.target in diagnosis.model.parameters:
        values.pop(cause.target)
    effect = known[cause.effect](cause.target)
    return Case(diagnosis.records_, full, without.with_parameters(**values), effect)


def window_residual(case: Case, model: PhysicsModel) -> np.ndarray:
    """Return the error on windows that start in the initial states found with all causes."""
    extended = case.records.fits[case.records.best]
    order = list(extended.model.states)
    x0 = extended.x0[:, [order.index(state) for state in model.states]]
    return evaluate(model, case.records.windows, x0, ()).residual
