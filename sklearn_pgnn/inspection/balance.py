r"""The missing part of an equation, estimated from the records.

The rate of a state that is measured (or whose position is) is compared with the model's rate at
the same states and inputs, over spans long enough to stand out from the noise:

.. math:: d_k = \frac{x_{k+m} - x_{k-m}}{t_{k+m} - t_{k-m}}
    - \frac{1}{t_{k+m} - t_{k-m}} \sum_{i=k-m}^{k+m-1}
    (t_{i+1} - t_i) \frac{f(x_i, u_i, p) + f(x_{i+1}, u_i, p)}{2}
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sklearn_pgnn.diagnosis.free_run import free_runs
from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.shown_states import told_states
from sklearn_pgnn.simulation.pointwise import evaluate_samples

#: a span is this share of a piece of a window, and at least two samples
SPAN_SHARE = 0.04


@dataclass(frozen=True)
class Samples:
    """A model and the value of its quantities at every sample of the records.

    The table has time, states, inputs as they act and parameters by name.
    """

    records: DiagnosisRecords
    model: PhysicsModel
    table: dict

    @classmethod
    def of(cls, records: DiagnosisRecords, model: PhysicsModel, states_of: PhysicsModel):
        """Take states and inputs from the records, and unobserved states from a simulation.

        `states_of` is the extended model, whose simulation fills those states.
        """
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
        ends = {name: _next(self.table[name]) for name in moving if name in self.table}
        both = self.value(expression, **other) + self.value(expression, **ends, **other)
        return self._by_record(both / 2, _mean)

    def _by_record(self, values, function):
        windows, m = self.records.windows, self.span
        out = np.full(windows.t.size, np.nan)
        for a, b in pairwise(windows.bounds):
            if b - a > 2 * m + 1:
                out[a + m : b - m] = function(windows.t[a:b], values[a:b], m)
        return out


def _next(values):
    """Return the value at the end of every sample's interval."""
    return np.append(values[1:], values[-1])


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


def starts(records: DiagnosisRecords, model: PhysicsModel) -> np.ndarray:
    """Return a model's initial states of all windows, as fitted with all that was found."""
    extended = records.fits[records.best]
    order = list(extended.model.states)
    return extended.x0[:, [order.index(state) for state in model.states]]
