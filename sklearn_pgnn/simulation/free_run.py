"""Free run of whole records: only the first sample of a record is read."""

import warnings

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
from sklearn_pgnn.simulation.substeps import Steps, given_steps
from sklearn_pgnn.trajectories.record import Record


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
