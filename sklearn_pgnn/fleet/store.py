"""Finished machines on disk: each complete or absent, and none of another model or record.

A machine's folder holds ``report.html``, ``extended_model.yaml``, ``diagnosis.json`` and, written
last, ``finished.json`` with the hash of all that the result depends on.
"""

import json
from pathlib import Path
from urllib.parse import quote

from sklearn_pgnn.fleet.machine import Machine
from sklearn_pgnn.fleet.one_machine import Outcome
from sklearn_pgnn.inspection.diagnosis_comparison import FILE
from sklearn_pgnn.inspection.strict_json import as_strict_json
from sklearn_pgnn.whole_file import remove_leftovers, write_whole

MACHINES, FINISHED, PAGE, MODEL = "machines", "finished.json", "report.html", "extended_model.yaml"


class Store:
    """The folder of a fleet."""

    def __init__(self, folder):
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
        place = self.place(outcome.name)
        place.mkdir(parents=True, exist_ok=True)
        remove_leftovers(place)
        (place / FINISHED).unlink(missing_ok=True)
        for name in (PAGE, MODEL, FILE):
            (place / name).unlink(missing_ok=True)
        if outcome.found is not None:
            write_whole(place / PAGE, outcome.page)
            write_whole(place / MODEL, outcome.extended_model)
            write_whole(place / FILE, as_strict_json(outcome.found))
        about = {"machine": outcome.name, "key": key, "seconds": outcome.seconds}
        about |= {"failed": outcome.failed, "warned": outcome.warned}
        write_whole(place / FINISHED, as_strict_json(about))


def _read(path: Path) -> dict | None:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
