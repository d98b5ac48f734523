"""Free runs of whole records, of which only the first sample is read, without NaN.

A trajectory that diverges causes a warning, and stays finite. A simulated output `RUNAWAY` times
larger than any in the fit tells nothing of the machine, finite as it may be.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.inputs import delayed_inputs
from sklearn_pgnn.simulation.simulate import (
    Simulation,
    hold_of,
    simulate,
    speed_of,
    start_of,
    steps_of_runs,
    substeps_of,
)
from sklearn_pgnn.simulation.substeps import Steps, given_steps, substeps_along
from sklearn_pgnn.trajectories.reader import rows_in_order
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user


def simulate_record(model: PhysicsModel, record: Record, **options) -> Simulation:
    """Simulate a record from its initial state, without a warning where it diverges.

    >>> from sklearn_pgnn.trajectories import read_records
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> (record,) = read_records(lag, [[0.0, 1.0], [1.0, 1.0]])
    >>> simulate_record(lag, record, substeps=4).y.round(4).ravel().tolist()
    [0.0, 0.3935]
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SimulationWarning)
        return simulate(model, record.t, record.u, start_of(model, record), **options)


def steps_for(
    model: PhysicsModel,
    records,
    substeps: int | None = None,
    method: str | None = None,
    hold: str | None = None,
) -> Steps:
    """Return how to step through records: as given, else as in the model, else as accuracy needs.

    Where only the number of steps is given, they are linearly implicit if others are not stable.
    """
    hold = hold_of(model, hold)
    said = {**model.simulation, **({"method": method} if method else {})}
    if substeps is not None or "substeps" in said:
        substeps = substeps_of(model, substeps)
    method = said.get("method")
    if substeps and method:
        return Steps(method, substeps)
    actings = [delayed_inputs(model, r.t, r.u, hold == "foh") for r in records]

    def run(steps: Steps) -> list[Simulation]:
        return [simulate_record(model, r, hold=hold, **steps._asdict()) for r in records]

    if substeps:
        return given_steps(substeps, None, speed_of(model, run(Steps(substeps=substeps)), actings))
    return steps_of_runs(model, run, actings, method)


#: a simulation this many times larger than any output in the fit has diverged
RUNAWAY = 1e3
#: trees and most networks hold numbers in single precision, whose largest is 3.4e38
LARGEST = float(np.finfo(np.float32).max)
#: what may help
REMEDY = (
    "check the parameters' values and units; simulate an unstable machine over shorter "
    "trajectories, or with its controller in the model"
)


def limits_of(y: np.ndarray) -> np.ndarray:
    """Return the magnitudes of outputs beyond which a simulation has diverged."""
    sizes = [np.max(np.abs(column[np.isfinite(column)]), initial=0.0) for column in y.T]
    largest = np.array(sizes)
    return np.where(largest > 0, RUNAWAY * largest, np.inf)


def what_is_beyond(model: PhysicsModel, run: Simulation, limits, remedy: str = REMEDY) -> str:
    """Return where the outputs of a free run leave their limits; empty if they do not.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": -0.01}, {"u": "V"}, name="lag")
    >>> run = lag.simulate([0.0, 0.1], [1.0, 1.0], substeps=100)
    >>> print(what_is_beyond(lag, run, limits_of(np.ones((1, 1)))).split(". ")[0])
    the simulation of 'lag' diverges: 'y' is -2.2e+04 at t = 0.1 s, more than 1000 times ...
    """
    beyond = np.argwhere(np.abs(run.y) > limits)
    if not beyond.size:
        return ""
    k, column = beyond[0]
    return (
        f"the simulation of {model.name!r} diverges: {list(model.outputs)[column]!r} is "
        f"{run.y[k, column]:.3g} at t = {run.t[k]:g} s, more than {RUNAWAY:g} times the largest "
        f"value in fit. Remedy: {remedy}."
    )


def what_is_wrong(run: Simulation, values: np.ndarray, names) -> str:
    """Return why a free run (n_samples, n_names) cannot be trained on; empty if it can.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": -0.01}, {"u": "V"})
    >>> run = lag.simulate([0.0, 1.0, 2.0], [1.0, 1.0, 1.0], [1e-9], substeps=100)
    >>> print(what_is_wrong(run, run.y, ["y"]).split(",")[0])
    'y' diverges: it is -1.86e+43 at t = 1 s
    """
    if run.message:
        return run.message
    bad = np.argwhere(~(np.abs(values) <= LARGEST))
    if not bad.size:
        return ""
    k, column = bad[0]
    if not np.isfinite(values[k, column]):
        return "an output is not finite. Remedy: check the output's expression."
    return (
        f"{names[column]!r} diverges: it is {values[k, column]:.3g} at t = {run.t[k]:g} s, beyond "
        f"single precision. Remedy: {REMEDY}."
    )


def quantities_of(model: PhysicsModel) -> list[str]:
    """Name a model's states, then its outputs, each once."""
    return list(dict.fromkeys([*model.states, *model.outputs]))


@dataclass(frozen=True)
class FreeRuns:
    """How a fitted estimator simulates: as accurately as its fit, and not larger by far.

    The interval [s] and the substeps are those of the fit; outputs of a magnitude beyond `limits`,
    of shape (n_outputs,), have diverged, and `remedy` is what may help.
    """

    interval: float
    substeps: int
    limits: np.ndarray
    hold: str
    method: str = "rk4"
    remedy: str = REMEDY

    def options(self, record: Record) -> dict:
        """Return the options of `simulate` along a record."""
        substeps = substeps_along(record, self.interval, self.substeps)
        return {"hold": self.hold, "method": self.method, "substeps": substeps}

    def model_along(self, model: PhysicsModel, record: Record) -> PhysicsModel:
        """Return a model that is simulated along a record with enough integration steps."""
        substeps = substeps_along(record, self.interval, self.substeps)
        if substeps == self.substeps:
            return model
        return model.replace(
            simulation={"hold": self.hold, **Steps(self.method, substeps).settings}
        )

    def run(self, model: PhysicsModel, record: Record) -> Simulation:
        """Simulate a record in free run."""
        return simulate_record(model, record, **self.options(record))

    def simulate(self, model: PhysicsModel, records, names: Sequence[str]) -> np.ndarray:
        """Simulate every record in free run; of one that diverges the first row is repeated.

        Return finite numbers of shape (n_samples, n_names), for states and outputs by `names`, in
        the order of the table's rows. One `SimulationWarning` tells of the trajectories that
        diverge.
        """
        found, wrong = [], {}
        for record in records:
            run = self.run(model, record)
            values = _values(model, run, names)
            what = what_is_beyond(model, run, self.limits, self.remedy)
            what = what or self._not_finite(run, values, names)
            if what:
                wrong[record.name] = what
                first = np.repeat(values[:1], len(values), axis=0)
                values = np.nan_to_num(first, posinf=0.0, neginf=0.0)
            found.append(values)
        _warn_of_diverging(wrong)
        return rows_in_order(records, np.concatenate(found))

    def _not_finite(self, run, values, names) -> str:
        what = what_is_wrong(run, values, names)
        return f"{what} Or {self.remedy}." if what and self.remedy != REMEDY else what


def simulate_quantities(model: PhysicsModel, records, names) -> np.ndarray:
    """Simulate every record in free run, as the model's `simulation` says."""
    limits, steps = np.full(len(model.outputs), np.inf), steps_for(model, records)
    runs = FreeRuns(np.inf, steps.substeps, limits, hold_of(model), steps.method)
    return runs.simulate(model, records, names)


def _values(model: PhysicsModel, run: Simulation, names) -> np.ndarray:
    columns = dict(zip(model.states, run.x.T, strict=True))
    columns |= dict(zip(model.outputs, run.y.T, strict=True))
    return np.column_stack([columns[name] for name in names])


def _warn_of_diverging(wrong: dict[str, str]) -> None:
    if not wrong:
        return
    first, *others = wrong
    more = f" So do those of {len(others)} more: {', '.join(others)}." if others else ""
    warn_user(
        f"trajectory {first!r}: {wrong[first]} Its rows get the values of its first row.{more}",
        SimulationWarning,
    )
