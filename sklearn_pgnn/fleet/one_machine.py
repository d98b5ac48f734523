"""The diagnosis of one machine in a worker process: plain data in, plain data out."""

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sklearn_pgnn import __version__
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.exceptions import UNUSABLE, DiagnosisWarning, RecordWarning
from sklearn_pgnn.inspection.model_files import file_of
from sklearn_pgnn.inspection.report import Provenance, render_report
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.files import read_files


@dataclass(frozen=True)
class Outcome:
    """The outcome of one machine, as returned by a worker.

    Parameters
    ----------
    name : str
        The machine.
    found : dict or None
        The result of `ModelDiagnosis.to_dict`; None where there is none.
    failed : str, default=""
        Why there is no diagnosis.
    is_final : bool, default=True
        Whether the same records would give the same outcome again; false after a bug.
    seconds : float, default=0
        Processor time [s].
    warned : tuple of str, default=()
        Warnings about the records.
    extended_model, page : str, default=""
        The extended model as a model file, and the report as HTML.
    """

    name: str
    found: dict | None
    failed: str = ""
    is_final: bool = True
    seconds: float = 0.0
    warned: tuple[str, ...] = ()
    extended_model: str = field(default="", repr=False)
    page: str = field(default="", repr=False)


@dataclass(frozen=True)
class Job:
    """The task to run for every machine.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    options : mapping
        Options of `ModelDiagnosis`, by name.
    sample_time : float or None
        Time from sample to sample [s] of files without a time.
    with_page : bool
        Whether a report is written.
    """

    model: PhysicsModel
    options: Mapping[str, Any]
    sample_time: float | None
    with_page: bool

    def run(self, name: str, records) -> Outcome:
        """Diagnose a machine; an error ends this machine only.

        Parameters
        ----------
        name : str
            The machine.
        records : tuple of (X, y), or list of str
            Its records, or its files.

        Returns
        -------
        Outcome
            What was found.
        """
        began = time.process_time()
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("ignore")
            warnings.simplefilter("always", RecordWarning)
            warnings.simplefilter("always", DiagnosisWarning)
            try:
                parts = self._diagnose(records)
            except UNUSABLE as error:
                parts = {"found": None, "failed": str(error)}
            except Exception as error:
                said = f"a bug in sklearn-pgnn, {type(error).__name__}: {error}"
                parts = {"found": None, "failed": said, "is_final": False}
        if any(issubclass(warning.category, DiagnosisWarning) for warning in told):
            parts["is_final"] = False
        warned = tuple(dict.fromkeys(str(warning.message) for warning in told))
        return Outcome(name, seconds=time.process_time() - began, warned=warned, **parts)

    def _diagnose(self, records) -> dict:
        files = records if isinstance(records, list) else []
        X, y = read_files(files, self.model, self.sample_time) if files else records
        diagnosis = ModelDiagnosis(self.model, **{**self.options, "n_jobs": 1}).fit(X, y)
        page = render_report(diagnosis, Provenance.of_files(None, files)) if self.with_page else ""
        model = file_of(diagnosis.extended_model_) if self.with_page else ""
        found = {**diagnosis.to_dict(), "version": __version__}
        return {"found": found, "extended_model": model, "page": page}
