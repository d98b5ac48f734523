"""The job of ``sklearn-pgnn diagnose``: read, diagnose, write, tell."""

import warnings
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import click

from sklearn_pgnn.cli.output import result_folder, strict_json
from sklearn_pgnn.cli.screen import one_line, show_progress, tell
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.exceptions import SimulationError
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories.csv_file import read_csv_files


class Unusable(click.ClickException):
    """Input that cannot be used: one line on stderr."""

    exit_code = 2


class Unexpected(click.ClickException):
    """What should not have happened: one line on stderr."""

    exit_code = 1


@contextmanager
def guarded(debug: bool):
    """Turn errors into one line: 2 for input that cannot be used, 1 for the unexpected."""
    try:
        yield
    except click.ClickException:
        raise
    except (ValueError, SimulationError, OSError) as error:
        if debug:
            raise
        raise Unusable(one_line(_said(error))) from None
    except Exception as error:
        if debug:
            raise
        what = f"unexpected {type(error).__name__}: {error}. --debug shows where; please report it."
        raise Unexpected(one_line(what)) from None


def _said(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error) or type(error).__name__


@dataclass(frozen=True)
class Job:
    """One call of ``sklearn-pgnn diagnose``.

    Parameters
    ----------
    model : str or path-like
        The model file.
    data : sequence of str or path-like
        The CSV files.
    output : str or path-like
        Folder of the results.
    hold, window, max_causes, seed, jobs
        As `ModelDiagnosis` has them.
    quiet : bool
        Whether to print the verdict only.
    """

    model: str | PathLike
    data: Sequence[str | PathLike]
    output: str | PathLike
    hold: str = "auto"
    window: float | None = None
    max_causes: int = 4
    seed: int = 0
    jobs: int = -1
    quiet: bool = False

    def run(self) -> ModelDiagnosis:
        """Read, diagnose, write and tell."""
        model = PhysicsModel.from_yaml(self.model)
        X, y = read_csv_files(self.data, model)
        with result_folder(Path(self.output)) as folder:
            diagnosis = self._fit(model, X, y)
            folder.joinpath("diagnosis.json").write_text(strict_json(diagnosis), encoding="utf-8")
            diagnosis.to_html(folder / "report.html")
            diagnosis.extended_model_.to_yaml(folder / "extended_model.yaml")
        tell(diagnosis, Path(self.output), quiet=self.quiet)
        return diagnosis

    def _fit(self, model, X, y) -> ModelDiagnosis:
        with show_progress(self.quiet) as progress, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ModelDiagnosis(
                model,
                hold=self.hold,
                window=self.window,
                max_causes=self.max_causes,
                n_jobs=self.jobs,
                random_state=self.seed,
                progress=progress,
            ).fit(X, y)
