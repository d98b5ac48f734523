"""Free-run simulation of a model from the initial states of the records."""

from itertools import pairwise

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.free_run import simulate_record, steps_for
from sklearn_pgnn.simulation.free_starts import fit_starts
from sklearn_pgnn.simulation.record_windows import WindowedRecords, window_records
from sklearn_pgnn.simulation.simulate import Simulation
from sklearn_pgnn.simulation.state_estimate import free_run


def run_records(model: PhysicsModel, records, **options) -> list[Simulation]:
    """Simulate every record in free run, with the hold and the substeps given, if any.

    The initial states are those given in the record, else those with which the model follows the
    record's beginning, see `sklearn_pgnn.simulation.free_starts`, else the model's initial state.
    """
    if all(record.y is not None for record in records):
        return run_from_starts(model, window_records(model, records, **options))
    steps = steps_for(model, records, **options)._asdict()
    return [simulate_record(model, record, **steps) for record in records]


def run_from_starts(model: PhysicsModel, windowed: WindowedRecords) -> list[Simulation]:
    """Simulate windowed records in free run, each from a start fitted to its beginning."""
    windows = windowed.windows
    starts = fit_starts(model, windows, windowed.states)
    return [
        free_run(model, windows, a, b, start)
        for (a, b), start in zip(pairwise(windows.bounds), starts, strict=True)
    ]
