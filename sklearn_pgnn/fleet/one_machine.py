"""One machine of a fleet: its diagnosis in a worker process, and what of it is kept on disk."""

import json
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from sklearn_pgnn import __version__
from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.exceptions import UNUSABLE, DiagnosisWarning, RecordWarning
from sklearn_pgnn.fleet.machine import Machine
from sklearn_pgnn.inspection.report import Provenance, render_report
from sklearn_pgnn.inspection.report.causes import file_of
from sklearn_pgnn.inspection.result_files import FILE, as_strict_json
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.threads import end_with_parent
from sklearn_pgnn.trajectories.files import read_files
from sklearn_pgnn.whole_file import remove_leftovers, write_whole

MACHINES, FINISHED, PAGE, MODEL = "machines", "finished.json", "report.html", "extended_model.yaml"


@dataclass(frozen=True)
class Outcome:
    """What a worker returns of a machine; it `is_final` if the same records would give it again."""

    machine: Machine
    is_final: bool
    extended_model: str = field(default="", repr=False)
    page: str = field(default="", repr=False)


@dataclass(frozen=True)
class Job:
    """The task to run for every machine; `with_page` is whether a report is written."""

    model: PhysicsModel
    options: Mapping[str, Any]
    sample_time: float | None
    with_page: bool

    def run(self, name: str, records: tuple | list[str]) -> Outcome:
        """Diagnose a machine by its (X, y) or its files; an error ends this machine only."""
        end_with_parent()
        began, found, failed, is_final, written = time.process_time(), None, "", True, ("", "")
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("ignore")
            warnings.simplefilter("always", RecordWarning)
            warnings.simplefilter("always", DiagnosisWarning)
            try:
                found, written = self._diagnose(records)
            except UNUSABLE as error:
                failed = str(error)
            except Exception as error:
                failed, is_final = f"a bug in sklearn-pgnn, {type(error).__name__}: {error}", False
        is_final = is_final and not any(issubclass(w.category, DiagnosisWarning) for w in told)
        warned = tuple(dict.fromkeys(str(warning.message) for warning in told))
        machine = Machine(name, found, failed, time.process_time() - began, warned)
        return Outcome(machine, is_final, *written)

    def _diagnose(self, records: tuple | list[str]) -> tuple[dict, tuple[str, str]]:
        """Return the diagnosis as plain data, and the files of its extended model and its page."""
        files = records if isinstance(records, list) else []
        X, y = read_files(files, self.model, self.sample_time) if files else records
        diagnosis = ModelDiagnosis(self.model, **{**self.options, "n_jobs": 1}).fit(X, y)
        page = render_report(diagnosis, Provenance.of_files(None, files)) if self.with_page else ""
        model = file_of(diagnosis.extended_model_) if self.with_page else ""
        return {**diagnosis.to_dict(), "version": __version__}, (model, page)


class Store:
    """The folder of a fleet."""

    def __init__(self, folder: FilePath):
        self.folder = Path(folder)

    def place(self, name: str) -> Path:
        """Return the folder of a machine; characters that file systems do not allow are quoted."""
        quoted = quote(name, safe=" ()[]+,=@")
        only_dots = not name.strip(".")
        return self.folder / MACHINES / (quoted.replace(".", "%2E") if only_dots else quoted)

    def names(self) -> list[str]:
        """Return the finished machines, by name."""
        files = self.folder.glob(f"{MACHINES}/*/{FINISHED}")
        return sorted(json.loads(file.read_text(encoding="utf-8"))["machine"] for file in files)

    def load(self, name: str, key: str | None = None) -> Machine | None:
        """Return a finished machine; None if it is not finished, or its hash differs."""
        place = self.place(name)
        about = _read(place / FINISHED)
        if about is None or key not in (None, about["key"]):
            return None
        found = None if about["failed"] else _read(place / FILE)
        return Machine(name, found, about["failed"], about["seconds"], tuple(about["warned"]))

    def save(self, outcome: Outcome, key: str) -> None:
        """Save the outcome of a machine; it counts as finished with the last file."""
        machine = outcome.machine
        place = self.place(machine.name)
        place.mkdir(parents=True, exist_ok=True)
        remove_leftovers(place)
        (place / FINISHED).unlink(missing_ok=True)
        for name in (PAGE, MODEL, FILE):
            (place / name).unlink(missing_ok=True)
        if machine.found is not None:
            write_whole(place / PAGE, outcome.page)
            write_whole(place / MODEL, outcome.extended_model)
            write_whole(place / FILE, as_strict_json(machine.found))
        about = {"machine": machine.name, "key": key, "seconds": machine.seconds}
        about |= {"failed": machine.failed, "warned": machine.warned}
        write_whole(place / FINISHED, as_strict_json(about))


def _read(path: Path) -> dict | None:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
