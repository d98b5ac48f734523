r"""Predictions some samples ahead: the state is estimated from the outputs up to a sample.

The estimate is that of an extended Kalman filter with central differences along the covariance's
axes in place of derivatives [1]_, so that any function from one state to the next can be used. How
far the model can be trusted is not known beforehand: several filters run in parallel, each with
another process noise, and the estimate is that of the filter with the best predictions so far.

References
----------
.. [1] M. Norgaard, N. K. Poulsen, O. Ravn, "New developments in state estimation for nonlinear
   systems", Automatica 36(11), 2000, :doi:`10.1016/S0005-1098(00)00089-3`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.inputs import delayed_inputs
from sklearn_pgnn.simulation.simulate import hold_of, simulate_acting, start_of, told_steps
from sklearn_pgnn.simulation.stepping import usual_interval
from sklearn_pgnn.simulation.substeps import Steps
from sklearn_pgnn.trajectories.reader import rows_in_order
from sklearn_pgnn.trajectories.record import Record

#: variances that a filter's process noise adds per sample, as shares of the states' variances
PROCESS_NOISE = (0.0, 1e-8, 1e-6, 1e-4, 1e-2)


@dataclass(frozen=True)
class Machine:
    """A simulation that runs along one record.

    ``run(a, b, x)`` returns states and outputs of the samples ``a`` to ``b``, ``b`` included, from
    the state ``x`` at ``a``.
    """

    record: Record
    x0: np.ndarray
    run: Callable


def check_steps(steps) -> None:
    """Raise `OptionError` unless predictions can be `steps` samples ahead.

    >>> check_steps(1)
    """
    if not isinstance(steps, Integral) or steps < 1:
        raise OptionError(f"steps: expected an integer >= 1, got {steps!r}.")


def model_machine(model: PhysicsModel, record, *, method: str | None = None, **options) -> Machine:
    """Return a model as a `Machine` along a record."""
    hold = hold_of(model, options.get("hold"))
    steps = told_steps(model, options.get("substeps"), method) or Steps()
    acting = delayed_inputs(model, record.t, record.u, hold == "foh")
    usual = usual_interval(record.t)

    def run(a, b, x):
        part = slice(a, b + 1)
        found = simulate_acting(model, record.t[part], acting[part], x, *steps, hold, usual=usual)
        return found.x, found.y

    return Machine(record, np.array(start_of(model, record), dtype=float), run)


def predict_ahead(machines: list[Machine], steps: int, noise: np.ndarray):
    """Predict states and outputs `steps` samples ahead of the known outputs.

    Return states and outputs of shapes (n_samples, n_states) and (n_samples, n_outputs), in the
    order of the table's rows; the first `steps` rows of a record are the free run's. The standard
    deviations `noise` of the measurements are known beforehand: an estimate from the record itself
    would leak information on later samples.
    """
    check_steps(steps)
    records = tuple(machine.record for machine in machines)
    with np.errstate(all="ignore"):
        free = [each.run(0, len(each.record.t) - 1, each.x0) for each in machines]
        x = np.concatenate([x for x, _ in free])
        spread = np.nanstd(np.where(np.isfinite(x), x, np.nan), axis=0)
        spread = np.where(spread > 0, spread, 1.0)  # of states that do not move
        pairs = [
            _ahead(machine, run, noise**2, spread, steps)
            for machine, run in zip(machines, free, strict=True)
        ]
    return tuple(rows_in_order(records, np.concatenate(part)) for part in zip(*pairs, strict=True))


def _ahead(machine, free, noise, spread, steps):
    """Predict along one record; predictions that are not finite are the free run's."""
    x, y = free[0].copy(), free[1].copy()
    n = len(x)
    if steps >= n:
        return x, y
    estimates = _estimate(machine, free[0], noise, spread, n - steps)
    for k, start in enumerate(estimates):
        states, outputs = machine.run(k, k + steps, start)
        if np.isfinite(states[-1]).all() and np.isfinite(outputs[-1]).all():
            x[k + steps], y[k + steps] = states[-1], outputs[-1]
    return x, y


def _estimate(machine, free, noise, spread, n) -> np.ndarray:
    """Estimate the states of the first samples, each from the outputs up to that sample."""
    known = machine.record.x0
    told = np.zeros(len(spread), dtype=bool)
    told[: len(known)] = np.isfinite(known)
    start = np.diag(np.where(told, 0.0, spread**2))
    filters = [_Filter(machine, noise, share * spread**2, start.copy()) for share in PROCESS_NOISE]
    found = np.empty((n, len(spread)))
    for k in range(n):
        for each in filters:
            each.take(k)
        best = max(filters, key=lambda each: each.likelihood)
        found[k] = best.x if np.isfinite(best.likelihood) else free[k]
    return found


class _Filter:
    """A filter along one record.

    The variances `noise` of the measurements and `process` that a step adds have shapes
    (n_outputs,) and (n_states,); the covariance is that of the initial state.
    """

    def __init__(self, machine: Machine, noise, process, covariance):
        self.machine, self.noise, self.process = machine, noise, np.diag(process)
        self.y = np.asarray(machine.record.y)
        self.x, self.P, self.likelihood = machine.x0.copy(), covariance, 0.0

    def take(self, k: int) -> None:
        """Step to sample k, and update with its outputs."""
        if not np.isfinite(self.likelihood):
            return
        before = max(k - 1, 0)
        root = _root(self.P + self.process if k else self.P)
        x, y = self._run(before, k, self.x)
        up = [self._run(before, k, self.x + column) for column in root.T]
        down = [self._run(before, k, self.x - column) for column in root.T]
        by_x, by_y = (
            np.array([(a[i] - b[i]) / 2 for a, b in zip(up, down, strict=True)]) for i in (0, 1)
        )
        self.x, self.P = x, by_x.T @ by_x
        if not all(np.isfinite(part).all() for part in (x, y, by_x, by_y)):
            self.likelihood = -np.inf
            return
        seen = np.isfinite(self.y[k])
        self._correct((self.y[k] - y)[seen], by_x, by_y[:, seen], self.noise[seen])

    def _run(self, a, b, x):
        states, outputs = self.machine.run(a, b, x)
        return states[-1], outputs[-1]

    def _correct(self, surprise, by_x, by_y, noise) -> None:
        """Correct the state by the innovation of the outputs."""
        expected = by_y.T @ by_y + np.diag(noise)
        gain = np.linalg.solve(expected, by_y.T @ by_x).T
        weighed = np.linalg.solve(expected, surprise)
        self.likelihood -= 0.5 * (surprise @ weighed + np.linalg.slogdet(expected)[1])
        self.x = self.x + gain @ surprise
        self.P = self.P - gain @ expected @ gain.T


def _root(covariance: np.ndarray) -> np.ndarray:
    """Return a square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0.0))
