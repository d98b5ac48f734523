"""One machine of a fleet: its diagnosis, what is kept of it, and the causes of many."""

import json
import time
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from scipy.stats import binomtest

from sklearn_pgnn import __version__
from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.estimation.candidate import Candidate
from sklearn_pgnn.exceptions import UNUSABLE, DiagnosisWarning, RecordWarning
from sklearn_pgnn.inspection.report import Provenance, render_report
from sklearn_pgnn.inspection.report.causes import file_of
from sklearn_pgnn.inspection.result_files import FILE, as_strict_json
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.threads import end_with_parent
from sklearn_pgnn.trajectories.files import read_files
from sklearn_pgnn.whole_file import remove_leftovers, write_whole

FAILED = "Not diagnosed"
#: the verdicts in words, with an entry for no verdict
SAID = (*VERDICTS.values(), FAILED)
#: the order of verdicts in a fleet
ORDER = (*VERDICTS, "failed")


@dataclass(frozen=True)
class Machine:
    """The results of one machine.

    Parameters
    ----------
    name : str
        Its name.
    found : mapping or None
        The result of `ModelDiagnosis.to_dict`; None where the records could not be used.
    failed : str, default=""
        Why there is no diagnosis.
    seconds : float, default=0
        Processor time that the diagnosis took [s].
    warned : tuple of str, default=()
        Warnings about the records.

    Examples
    --------
    >>> Machine("pump 7", None, "no time in the file").verdict
    'failed'
    """

    name: str
    found: Mapping | None = field(repr=False)
    failed: str = ""
    seconds: float = 0.0
    warned: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """The verdict, as `ModelDiagnosis.verdict_`, or ``"failed"``."""
        return "failed" if self.found is None else self.found["verdict"]

    @property
    def said(self) -> str:
        """The verdict in words, one of `SAID`."""
        return FAILED if self.found is None else VERDICTS[self.verdict]

    @property
    def named(self) -> dict[Candidate, Mapping]:
        """The named causes by effect and target, the most important first."""
        causes = () if self.found is None else self.found["causes"]
        return {Candidate(cause["effect"], cause["target"]): cause for cause in causes}

    @property
    def alike(self) -> dict[Candidate, set[Candidate]]:
        """For every named cause, itself and those that the records do not separate from it."""
        return {
            pair: {pair, *(Candidate(r["effect"], r["target"]) for r in cause["confused_with"])}
            for pair, cause in self.named.items()
        }

    @property
    def sure(self) -> float:
        """Probability that a cause, or a rival in its place, acts; 0 where none was tested."""
        return max(map(acts, self.named.values()), default=0.0)

    @property
    def rank(self) -> tuple:
        """Sort key of machines, the surest first."""
        first = next(iter(self.named.values()), None)
        alone = 0.0 if first is None else first["probability"] or 0.0
        return ORDER.index(self.verdict), -self.sure, -alone, -self.explained, self.name

    @property
    def explained(self) -> float:
        """Largest share of an output's error power that the extension explains."""
        gains = () if self.found is None else self.found["gain"].values()
        return max((gain["explained_share"] or 0.0 for gain in gains), default=0.0)


def acts(cause: Mapping) -> float:
    """Return the probability that a cause of `ModelDiagnosis.to_dict`, or a rival of it, acts.

    >>> acts({"probability": 0.5, "confused_with": [{"probability": 0.25}]})
    0.75
    >>> acts({"probability": None, "confused_with": []})  # provisional
    0.0
    """
    each = [cause["probability"], *(rival["probability"] for rival in cause["confused_with"])]
    return min(1.0, float(sum(probability or 0.0 for probability in each)))


@dataclass(frozen=True)
class FleetCause:
    """A cause that is named on some machines.

    Parameters
    ----------
    effect, target : str
        Id of the effect in the catalogue, and what it acts on.
    machines : tuple of str
        The machines where it is named, the surest first.
    possible : tuple of str
        The machines where another cause is named and this one is not refuted in its place.
    low, high : float
        Ends of the 95 % interval (Wilson) of the share of machines of this kind where it is named.

    Examples
    --------
    >>> cause = FleetCause("leak", "h", ("tank 3", "tank 7"), ("tank 1",), low=0.01, high=0.03)
    >>> len(cause.machines), len(cause.possible)
    (2, 1)
    """

    effect: str
    target: str
    machines: tuple[str, ...]
    possible: tuple[str, ...]
    low: float
    high: float

    @property
    def is_of_the_model(self) -> bool:
        """Whether most machines have it, so that it belongs in the model they share."""
        return self.low > 0.5


def common_causes(machines: Iterable[Machine]) -> tuple[FleetCause, ...]:
    """Return the causes that are named in a fleet, the most frequent first.

    >>> found = {"verdict": "cause_named", "gain": {}, "causes": [
    ...     {"effect": "input_bias", "target": "F", "probability": 1.0, "confused_with": []}]}
    >>> (bias,) = common_causes([Machine(str(k), found) for k in range(9)])
    >>> bias.machines, bias.is_of_the_model
    (('0', '1', '2', '3', '4', '5', '6', '7', '8'), True)
    """
    told = [machine for machine in machines if machine.found is not None]
    pairs = dict.fromkeys(pair for machine in told for pair in machine.named)
    causes = []
    for pair in pairs:
        named = tuple(m.name for m in told if pair in m.named)
        rivals = tuple(
            m.name
            for m in told
            if pair not in m.named and any(pair in alike for alike in m.alike.values())
        )
        share = binomtest(len(named), len(told)).proportion_ci(method="wilson")
        causes.append(FleetCause(*pair, named, rivals, float(share.low), float(share.high)))
    return tuple(sorted(causes, key=lambda cause: -len(cause.machines)))


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
