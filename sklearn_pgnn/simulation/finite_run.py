"""Free runs without NaN: a trajectory that diverges causes a warning, and stays finite."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.divergence import REMEDY, what_is_beyond, what_is_wrong
from sklearn_pgnn.simulation.free_run import simulate_record, steps_for
from sklearn_pgnn.simulation.long_steps import substeps_along
from sklearn_pgnn.simulation.simulate import Simulation, hold_of
from sklearn_pgnn.simulation.substeps import Steps
from sklearn_pgnn.trajectories.reader import rows_in_order
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user


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
