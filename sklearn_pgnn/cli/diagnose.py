"""The job of ``sklearn-pgnn diagnose``: read, diagnose, write, tell."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from sklearn_pgnn.cli.guard import OWN, Bug, one_line
from sklearn_pgnn.cli.output import result_folder, strict_json, write_files
from sklearn_pgnn.cli.screen import tell
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.inspection.report import render_report
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories.csv_file import read_csv_files


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

    def run(self, progress: Callable) -> ModelDiagnosis:
        """Read, diagnose and write.

        Parameters
        ----------
        progress : callable
            Called as ``progress(stage, done, total)``.

        Returns
        -------
        ModelDiagnosis
            The fitted diagnosis.

        Raises
        ------
        Bug
            If something of ours breaks down; what was found before is written.
        """
        progress("reading the model and the records")
        model = PhysicsModel.from_yaml(self.model)
        X, y = read_csv_files(self.data, model)
        with result_folder(Path(self.output)) as folder:
            diagnosis, broken = self._fit(model, X, y, progress)
            progress("writing the report")
            failed = write_files(folder, _texts(diagnosis, broken))
            kept = sorted(file.name for file in folder.iterdir())
        if broken or failed:
            error = broken or next(iter(failed.values()))
            raise Bug(error, self._kept(kept)) from error
        return diagnosis

    def tell(self, diagnosis: ModelDiagnosis) -> None:
        """Print what was found, and where it is."""
        tell(diagnosis, Path(self.output), quiet=self.quiet)

    def _fit(self, model, X, y, progress) -> tuple[ModelDiagnosis, Exception | None]:
        """Return the diagnosis, and what ended it if it has something to say all the same."""
        diagnosis = ModelDiagnosis(
            model,
            hold=self.hold,
            window=self.window,
            max_causes=self.max_causes,
            n_jobs=self.jobs,
            random_state=self.seed,
            progress=progress,
        )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return diagnosis.fit(X, y), None
        except OWN:
            raise
        except Exception as error:
            if not hasattr(diagnosis, "verdict_"):
                raise
            return diagnosis, error

    def _kept(self, names: Sequence[str]) -> str:
        """Say what was written all the same."""
        if not names:
            return ""
        return f"What was found before is in {one_line(self.output)}: {', '.join(names)}."


def _texts(diagnosis: ModelDiagnosis, broken: Exception | None) -> dict[str, Callable[[], str]]:
    """Return by name what gives the text of each file."""
    return {
        "diagnosis.json": lambda: strict_json(diagnosis, broken),
        "extended_model.yaml": lambda: diagnosis.extended_model_.to_yaml(),
        "report.html": lambda: render_report(diagnosis),
    }
