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
from sklearn_pgnn.threads import end_with_parent
from sklearn_pgnn.trajectories.files import read_files


@dataclass(frozen=True)
class Outcome:
    """The outcome of one machine, as returned by a worker.

    `found` is the result of `ModelDiagnosis.to_dict`; where there is none, `failed` says why. It
    `is_final` if the same records would give the same outcome again, which they may not after a
    bug. `seconds` are processor time; the extended model is a model file, and the page the report
    as HTML.
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

    The options are those of `ModelDiagnosis`, and the sample time [s] is that of files without a
    time; `with_page` is whether a report is written.
    """

    model: PhysicsModel
    options: Mapping[str, Any]
    sample_time: float | None
    with_page: bool

    def run(self, name: str, records) -> Outcome:
        """Diagnose a machine; an error ends this machine only.

        The records are a tuple of (X, y), or a list of files.
        """
        end_with_parent()
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
