"""Free runs as columns of a table: as accurate as in the fit, and not larger by far.

An integration step is nowhere longer than in the fit: in a slower table or across a gap, a step of
n sample intervals takes n times as many.

What has diverged is told by the outputs of the fit. A transformer's y may be in another unit than
the model's outputs (`sklearn.compose.TransformedTargetRegressor` standardises it), so that an
output has diverged only if it is too large both for the unit of y as it is, and for the one in
which the medians of y and of the simulation are the same.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.finite_run import what_is_wrong
from sklearn_pgnn.simulation.free_run import simulate_record
from sklearn_pgnn.simulation.stepping import GAP, usual_interval
from sklearn_pgnn.trajectories import rows_in_order
from sklearn_pgnn.trajectories.outputs import read_outputs
from sklearn_pgnn.trajectories.record import Record

#: a simulation this many times larger than any output of the fit has diverged
RUNAWAY = 1e3


@dataclass(frozen=True)
class SimulatedColumns:
    """How a transformer simulates.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    names : sequence of str
        States and outputs to return.
    interval : float
        Sample interval of the fit [s].
    substeps : int
        Integration steps that it takes.
    limits : ndarray of shape (n_outputs,)
        Magnitude of the outputs beyond which a simulation has diverged.
    hold : {"zoh", "foh"}
        How the inputs vary between two samples.
    method : {"rk4", "euler"}
        Scheme of a step.
    """

    model: PhysicsModel
    names: Sequence[str]
    interval: float
    substeps: int
    limits: np.ndarray
    hold: str
    method: str

    def __call__(self, records) -> np.ndarray:
        """Simulate every record in free run; of one that diverges the first row is repeated.

        Parameters
        ----------
        records : sequence of Record
            Time, inputs and initial states.

        Returns
        -------
        ndarray of shape (n_samples, n_names)
            Finite numbers in the order of the table's rows. One `SimulationWarning` tells of the
            trajectories that diverge.
        """
        found, wrong = [], {}
        for record in records:
            run = self.run(record)
            columns = dict(zip(self.model.states, run.x.T, strict=True))
            columns |= dict(zip(self.model.outputs, run.y.T, strict=True))
            values = np.column_stack([columns[name] for name in self.names])
            what = self._beyond(run) or what_is_wrong(run, values, self.names)
            if what:
                wrong[record.name] = what
                first = np.repeat(values[:1], len(values), axis=0)
                values = np.nan_to_num(first, posinf=0.0, neginf=0.0)
            found.append(values)
        _warn_of_diverging(wrong)
        return rows_in_order(records, np.concatenate(found))

    def run(self, record: Record):
        """Simulate a record with enough integration steps for its longest step.

        Parameters
        ----------
        record : Record
            The record; steps that the simulation itself divides as gaps do not count.

        Returns
        -------
        Simulation
            The free run.
        """
        steps = np.diff(record.t)
        longest = np.max(steps[steps <= GAP * usual_interval(record.t)], initial=0.0)
        substeps = self.substeps * max(1, round(float(longest) / self.interval))
        options = {"hold": self.hold, "method": self.method, "substeps": substeps}
        return simulate_record(self.model, record, **options)

    def _beyond(self, run) -> str:
        """Return where the outputs leave their limits; empty if they do not."""
        beyond = np.argwhere(np.abs(run.y) > self.limits)
        if not beyond.size:
            return ""
        k, column = beyond[0]
        return (
            f"the simulation of {self.model.name!r} diverges: {list(self.model.outputs)[column]!r} "
            f"is {run.y[k, column]:.3g} at t = {run.t[k]:g} s, more than {RUNAWAY:g} times what "
            f"fit saw. Remedy: check the parameters' values and units; simulate an unstable "
            f"machine over shorter trajectories, or with its controller in the model."
        )


def usual_step(records) -> float:
    """Return the median sample interval of records [s]; infinite if they have a sample each.

    Parameters
    ----------
    records : sequence of Record
        The records.

    Returns
    -------
    float
        The interval.
    """
    steps = np.concatenate([np.diff(record.t) for record in records])
    return float(np.median(steps)) if steps.size else np.inf


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


def limits_of(model: PhysicsModel, simulated: np.ndarray, y) -> np.ndarray:
    """Return the magnitudes of the outputs beyond which a simulation has diverged.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    simulated : ndarray of shape (n_samples, n_outputs)
        Outputs simulated in the fit.
    y : array-like or None
        Targets of the fit: measured outputs, perhaps in another unit, or something else.

    Returns
    -------
    ndarray of shape (n_outputs,)
        `RUNAWAY` times the largest measured output, in the larger one of two units. Where y are no
        outputs of the model, `RUNAWAY` times the largest finite simulated one. Infinite where all
        are zero.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> volt = np.array([[1.0], [2.0], [1e9]])  # one of three rows has diverged
    >>> y = np.array([1.0, 2.0, 3.0])
    >>> [limits_of(lag, volt, each)[0].item() for each in (y, y / 1000, None)]
    [3000.0, 3000.0, 1000000000000.0]
    """
    measured = _as_outputs(model, y, len(simulated))
    if measured is None:
        largest = _largest(simulated)
    else:
        ours, theirs = _median(simulated), _median(measured)
        unit = np.divide(ours, theirs, out=np.ones_like(ours), where=theirs > 0)
        largest = np.maximum(unit, 1.0) * _largest(measured)
    return np.where(largest > 0, RUNAWAY * largest, np.inf)


def _as_outputs(model: PhysicsModel, y, n_samples: int) -> np.ndarray | None:
    """Return the targets of a fit if they can be the model's outputs, else None."""
    try:
        return None if y is None else read_outputs(model, y, n_samples)
    except (TypeError, ValueError):
        return None


def _largest(values: np.ndarray) -> np.ndarray:
    return np.max(np.abs(values), axis=0, initial=0.0, where=np.isfinite(values))


def _median(values: np.ndarray) -> np.ndarray:
    """Return the median magnitudes; 0 where there is none."""
    columns = (np.abs(column[np.isfinite(column)]) for column in values.T)
    return np.array([np.median(column) if column.size else 0.0 for column in columns])


def _warn_of_diverging(wrong: dict[str, str]) -> None:
    if not wrong:
        return
    first, *others = wrong
    more = f" So do those of {len(others)} more: {', '.join(others)}." if others else ""
    warnings.warn(
        f"trajectory {first!r}: {wrong[first]} Its rows get the values of its first row.{more}",
        SimulationWarning,
        stacklevel=4,
    )
