"""The input of every command: the model file and the files of records."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

import click
import pandas as pd

from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.exceptions import ModelWarning, RecordWarning
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.priors import from_fmu
from sklearn_pgnn.priors.robot_section import ROBOTS
from sklearn_pgnn.trajectories.files import open_file, read_files
from sklearn_pgnn.trajectories.several_files import read_each

#: how files are read that are no model files, by their ending
READERS = {".fmu": from_fmu, **ROBOTS}


def read_model_and_records(
    model: str | PathLike, data: Sequence[str | PathLike], sample_time: float | None
) -> tuple[PhysicsModel, pd.DataFrame, pd.DataFrame]:
    """Read a model file and files of records."""
    read = read_model(model)
    with told_warnings(RecordWarning):
        return read, *read_files(data, read, sample_time)


def read_model(path: str | PathLike) -> PhysicsModel:
    """Read a model file, and print what is doubtful in it."""
    with told_warnings(ModelWarning):
        return open_model(path)


def open_model(path: str | PathLike) -> PhysicsModel:
    """Return the model of a model file, of a functional mock-up unit, or of a robot."""
    return READERS.get(Path(path).suffix.lower(), PhysicsModel.from_yaml)(path)


def read_inputs(
    model: PhysicsModel, data: Sequence[str | PathLike], sample_time: float | None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read files of records in which outputs may be missing."""
    with told_warnings(RecordWarning):
        return read_each(open_file, data, model, sample_time, needs_outputs=False)


@contextmanager
def told_warnings(*kinds: type[Warning]) -> Iterator[None]:
    """Print warnings of some categories on one line each, and no others."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("ignore")
        for kind in kinds:
            warnings.simplefilter("always", kind)
        yield
    for warning in told:
        click.echo(f"Warning: {one_line(warning.message)}", err=True)
