"""The job of ``sklearn-pgnn simulate``: a model file run on the inputs of records."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.cli.inputs import read_model, told_warnings
from sklearn_pgnn.cli.tables import print_table, say, screen
from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.inspection.numbers import fit_text
from sklearn_pgnn.inspection.runs import fit_percentage, run_records
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.simulation.finite_run import quantities_of
from sklearn_pgnn.simulation.simulate import Simulation
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.files import open_file
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.trajectories.several_files import read_each


def simulate_files(
    model: FilePath, data: Sequence[FilePath], sample_time: float | None = None
) -> tuple[PhysicsModel, pd.DataFrame, dict[str, list[float]]]:
    """Simulate a model file on inputs of files in free run: a table, and fits [%] by record."""
    read = read_model(model)
    with told_warnings(RecordWarning):
        X, y = read_each(open_file, data, read, sample_time, needs_outputs=False)
    whole = set(y) == set(read.outputs)
    records = read_records(read, X, y[list(read.outputs)] if whole else None)
    runs = [run.check() for run in run_records(read, records)]
    pieces = [_table(read, r, run) for r, run in zip(records, runs, strict=True)]
    fits = {
        record.name: fit_percentage(record.y, run.y).tolist()
        for record, run in zip(records, runs, strict=True)
        if record.y is not None
    }
    return read, pd.concat(pieces, ignore_index=True), fits


def _table(model: PhysicsModel, record: Record, run: Simulation) -> pd.DataFrame:
    """Return a simulation in the form of a file of records."""
    values = dict(zip(model.states, run.x.T, strict=True))
    values |= dict(zip(model.outputs, run.y.T, strict=True))
    columns = {name: record.u[:, i] for i, name in enumerate(model.inputs)}
    columns |= {name: values[name] for name in quantities_of(model)}
    units = {name: f" [{model.unit(name)}]" if model.unit(name) else "" for name in columns}
    named = {f"{name}{units[name]}": np.asarray(v) for name, v in columns.items()}
    return pd.DataFrame({"trajectory": record.name, "t [s]": record.origin + record.t, **named})


def print_simulation(
    model: PhysicsModel, fits: dict, output: str, samples: int, *, quiet: bool
) -> None:
    """Print the fit [%] to the records, by record, and the location of the simulation."""
    if quiet:
        return
    console = screen()
    say(console, f"Wrote {samples} samples to {one_line(output)}.")
    if not fits:
        return
    console.print()
    say(console, "Fit to the measured outputs in free run (100 % is perfect)", "bold")
    rows = ((name, *(fit_text(p, 1) for p in percent)) for name, percent in fits.items())
    print_table(console, ("", *model.outputs), rows)
