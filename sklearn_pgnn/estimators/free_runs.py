r"""Free runs of a model as the records of its fit allow: as accurate, and not larger by far.

A fit finds how many integration steps a sample interval :math:`T` takes. Elsewhere an integration
step is no longer than that: a step :math:`n T` from one row to the next, in a slower table or
across a gap, takes :math:`n` times as many.

A simulated output `RUNAWAY` times larger than any that was measured tells nothing of the machine:
the simulation has diverged, finite as it may be.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sklearn_pgnn.estimators.one_warning import one_simulation_warning
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.ahead import Machine, model_machine, predict_ahead
from sklearn_pgnn.simulation.finite_run import what_is_wrong
from sklearn_pgnn.simulation.free_run import simulate_record
from sklearn_pgnn.simulation.stepping import GAP, usual_interval
from sklearn_pgnn.trajectories import rows_in_order
from sklearn_pgnn.trajectories.record import Record

#: a simulation this many times larger than any measured output has diverged
RUNAWAY = 1e3
#: what may help against a divergence
REMEDY = (
    "check the parameters' values and units; simulate an unstable machine over shorter "
    "trajectories, or with its controller in the model"
)


@dataclass(frozen=True)
class FreeRuns:
    """How a fitted estimator simulates.

    Parameters
    ----------
    interval : float
        Sample interval of the fit [s].
    substeps : int
        Integration steps that it takes.
    limits : ndarray of shape (n_outputs,)
        Magnitude of the outputs beyond which a simulation has diverged.
    hold : {"zoh", "foh"}
        How the inputs vary between two samples.
    method : {"rk4", "euler"}, default="rk4"
        Scheme of a step.
    remedy : str, default=REMEDY
        What may help against a divergence.

    Examples
    --------
    >>> from sklearn_pgnn.trajectories import read_records
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> (record,) = read_records(lag, [[0.0, 1.0], [1.0, 1.0], [8.0, 1.0]])
    >>> runs = FreeRuns(1.0, 1, np.array([np.inf]), "zoh")
    >>> runs.substeps_along(record), runs.simulate(lag, [record], ["y"]).round(2).ravel().tolist()
    (7, [0.0, 0.39, 0.98])
    """

    interval: float
    substeps: int
    limits: np.ndarray
    hold: str
    method: str = "rk4"
    remedy: str = REMEDY

    def substeps_along(self, record: Record) -> int:
        """Return how many integration steps a record takes from sample to sample.

        Parameters
        ----------
        record : Record
            The record.

        Returns
        -------
        int
            Enough for its longest step, those apart that the simulation itself divides as gaps.
        """
        steps = np.diff(record.t)
        longest = np.max(steps[steps <= GAP * usual_interval(record.t)], initial=0.0)
        return self.substeps * max(1, round(longest / self.interval))

    def model_along(self, model: PhysicsModel, record: Record) -> PhysicsModel:
        """Return a model that is simulated along a record with enough integration steps.

        Parameters
        ----------
        model : PhysicsModel
            The model.
        record : Record
            The record.

        Returns
        -------
        PhysicsModel
            The model, its `simulation` changed where the record's steps are longer.
        """
        substeps = self.substeps_along(record)
        if substeps == self.substeps:
            return model
        return model.replace(simulation={"hold": self.hold, "substeps": substeps})

    def ahead(self, model: PhysicsModel, records, steps: int, noise: np.ndarray):
        """Predict states and outputs some samples ahead of the known outputs.

        Parameters
        ----------
        model : PhysicsModel
            The model.
        records : sequence of Record
            The records, with outputs.
        steps, noise
            See `sklearn_pgnn.simulation.ahead.predict_ahead`.

        Returns
        -------
        states : ndarray of shape (n_samples, n_states)
            Finite numbers in the order of the table's rows, those of `simulate` where a prediction
            diverges. One `SimulationWarning` tells of all simulations that fail.
        outputs : ndarray of shape (n_samples, n_outputs)
            In the same order.
        """
        machines = [model_machine(model, each, **self._options(each)) for each in records]
        with one_simulation_warning() as failed:
            machines = [replace(each, run=partial(_noted, each, failed)) for each in machines]
            found = np.hstack(predict_ahead(machines, steps, noise))
            n_states = len(model.states)
            with np.errstate(invalid="ignore"):
                within = (np.abs(found[:, n_states:]) <= self.limits).all(axis=1)
            lost = ~(within & np.isfinite(found).all(axis=1))
            if lost.any():
                found[lost] = self.simulate(model, records, [*model.states, *model.outputs])[lost]
        return found[:, :n_states], found[:, n_states:]

    def simulate(self, model: PhysicsModel, records, names: Sequence[str]) -> np.ndarray:
        """Simulate every record in free run; of one that diverges the first row is repeated.

        Parameters
        ----------
        model : PhysicsModel
            The model.
        records : sequence of Record
            Time, inputs and initial states.
        names : sequence of str
            States and outputs to return.

        Returns
        -------
        ndarray of shape (n_samples, n_names)
            Finite numbers in the order of the table's rows. One `SimulationWarning` tells of the
            trajectories that diverge.
        """
        found, wrong = [], {}
        for record in records:
            run = simulate_record(model, record, **self._options(record))
            columns = dict(zip(model.states, run.x.T, strict=True))
            columns |= dict(zip(model.outputs, run.y.T, strict=True))
            values = np.column_stack([columns[name] for name in names])
            what = self._beyond(model, run) or self._not_finite(run, values, names)
            if what:
                wrong[record.name] = what
                first = np.repeat(values[:1], len(values), axis=0)
                values = np.nan_to_num(first, posinf=0.0, neginf=0.0)
            found.append(values)
        _warn_of_diverging(wrong)
        return rows_in_order(records, np.concatenate(found))

    def _options(self, record: Record) -> dict:
        return {"hold": self.hold, "method": self.method, "substeps": self.substeps_along(record)}

    def _beyond(self, model: PhysicsModel, run) -> str:
        """Return where the outputs leave their limits; empty if they do not."""
        beyond = np.argwhere(np.abs(run.y) > self.limits)
        if not beyond.size:
            return ""
        k, column = beyond[0]
        return (
            f"the simulation of {model.name!r} diverges: {list(model.outputs)[column]!r} is "
            f"{run.y[k, column]:.3g} at t = {run.t[k]:g} s, more than {RUNAWAY:g} times what was "
            f"measured. Remedy: {self.remedy}."
        )

    def _not_finite(self, run, values, names) -> str:
        what = what_is_wrong(run, values, names)
        return f"{what} Or {self.remedy}." if what and self.remedy != REMEDY else what


def _noted(machine: Machine, failed: list[str], a: int, b: int, x):
    """Run a machine, and note the name of the trajectory if the run fails."""
    states, outputs = machine.run(a, b, x)
    if not np.isfinite(states[-1]).all():
        failed.append(machine.record.name)
    return states, outputs


def usual_step(records) -> float:
    """Return the median sample interval of records [s].

    Parameters
    ----------
    records : sequence of Record
        The records.

    Returns
    -------
    float
        The interval.
    """
    return float(np.median(np.concatenate([np.diff(record.t) for record in records])))


def without_long_steps(records) -> list[Record]:
    """Return records in which no step is longer than a usual one, to find the substeps of that.

    Parameters
    ----------
    records : sequence of Record
        The records.

    Returns
    -------
    list of Record
        The records; steps that are to be divided are as long as `usual_step`.

    Examples
    --------
    >>> t, none = np.array([0.0, 1.0, 2.0, 9.0]), np.zeros((4, 0))
    >>> (record,) = without_long_steps([Record(t, none, None, np.zeros(1), "a", np.arange(4))])
    >>> record.t.tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    usual, closed = usual_step(records), []
    for record in records:
        steps = np.diff(record.t)
        steps = np.where(np.rint(steps / usual) > 1, usual, steps)
        closed.append(replace(record, t=record.t[0] + np.append(0.0, np.cumsum(steps))))
    return closed


def limits_of(y: np.ndarray) -> np.ndarray:
    """Return the magnitudes of outputs beyond which a simulation has diverged.

    Parameters
    ----------
    y : ndarray of shape (n_samples, n_outputs)
        Measured outputs, NaN where there is none.

    Returns
    -------
    ndarray of shape (n_outputs,)
        `RUNAWAY` times the largest one; infinite where nothing but zero was measured.

    Examples
    --------
    >>> limits_of(np.array([[1.0, 0.0, np.nan], [-2.0, 0.0, np.nan]])).tolist()
    [2000.0, inf, inf]
    """
    largest = np.max(np.abs(y), axis=0, initial=0.0, where=np.isfinite(y))
    return np.where(largest > 0, RUNAWAY * largest, np.inf)


def _warn_of_diverging(wrong: dict[str, str]) -> None:
    if not wrong:
        return
    first, *others = wrong
    more = f" So do those of {len(others)} more: {', '.join(others)}." if others else ""
    warnings.warn(
        f"trajectory {first!r}: {wrong[first]} Its rows get the values of its first row.{more}",
        SimulationWarning,
        stacklevel=5,
    )
