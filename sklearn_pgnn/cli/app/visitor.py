"""The session of the page: its files, its process, and the progress of the work."""

import asyncio
import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic

from sklearn_pgnn.cli.app.work import (
    ALL_BYTES,
    NAME,
    NO_MEMORY,
    PATIENCE,
    RECORDS,
    Ended,
    Refused,
    Worker,
)
from sklearn_pgnn.inspection.result_files import EXTENDED
from sklearn_pgnn.stages import BEST, in_words
from sklearn_pgnn.trajectories.several_files import is_conditions, unique


@dataclass(frozen=True)
class RecordFile:
    """A file of records: its number in the folder, its size [bytes], and the label to show."""

    number: int
    label: str
    size: int
    sha256: str

    @property
    def file(self) -> str:
        """Name in the folder."""
        return f"{self.number}.csv"


@dataclass
class Stages:
    """The stages of the work in progress, which `began` [s] by `time.monotonic`."""

    what: str
    began: float = field(default_factory=monotonic)
    past: list[tuple[str, float]] = field(default_factory=list)
    stage: str = "starting"
    done: int = 0
    total: int = 1
    best: str = ""

    def __post_init__(self) -> None:
        self._stage_began = self.began

    def step(self, told: dict) -> None:
        """Record a step of the process."""
        stage = in_words(told["stage"])
        if stage.startswith(BEST):
            self.best = stage
            return
        if stage != self.stage:
            now = monotonic()
            self.past.append((self.stage, now - self._stage_began))
            self._stage_began = now
        self.stage, self.done, self.total = stage, told["step"], told["steps"]

    @property
    def seconds(self) -> float:
        """Time since the beginning [s]."""
        return monotonic() - self.began


class Visitor:
    """A visitor's files and their results.

    `model`, `columns` and `result` are the results of reading the model, of reading the records,
    and of the diagnosis. `mapping` has ``column``, ``unit`` and ``kind`` by quantity, and
    ``sample_time``. `looked` is whether the plots of the records and the model are available;
    `message` is the last error and its remedy, empty if there is none.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.worker = Worker(self.folder)
        self.model: dict | None = None
        self.records: list[RecordFile] = []
        self.columns: dict | None = None
        self.mapping: dict = {}
        self.looked = False
        self.result: dict | None = None
        self.running: Stages | None = None
        self.message = ""
        self._count = 0
        self._task: asyncio.Task | None = None

    # -- what is brought ---------------------------------------------------------------------------

    def check_idle(self) -> None:
        """Refuse a change during a diagnosis; a look in progress does not prevent it."""
        if self.running is not None and self.running.what == "diagnose":
            raise Refused("A diagnosis is running: wait for it, or stop it first.")

    async def take_model(self, content: bytes, label: str) -> None:
        """Take a model file."""
        self.check_idle()
        (self.folder / "new_model.yaml").write_bytes(content)
        await self._read_model({"do": "model", "label": shown_name(label)})

    async def go_on(self) -> None:
        """Use the extended model as the model."""
        extended = self.folder / "result" / EXTENDED
        if self.result is None or not extended.exists():
            raise Refused("Expected a diagnosis with an extended model first.")
        await self.take_model(extended.read_bytes(), EXTENDED)

    def all_files(self) -> dict[str, Path]:
        """Return the model, the records and the results, by their names in one archive."""
        labels = unique(record.label for record in self.records)
        files = {"model.yaml": self.folder / "model.yaml"} if self.model else {}
        for label, record in zip(labels, self.records, strict=True):
            files[f"records/{label}"] = self.folder / record.file
        names = [name for name, _ in (self.result or {}).get("files", ())]
        return files | {f"result/{name}": self.folder / "result" / name for name in names}

    async def take_system(self, system: str) -> None:
        """Use a ready system as the model."""
        self.check_idle()
        await self._read_model({"do": "system", "system": system})

    async def _read_model(self, command: dict) -> None:
        self.model = await self.ask(command)
        await self.read_columns()

    async def take_example(self) -> None:
        """Replace all files by a simulated cart and its records."""
        self.check_idle()
        made = await self.ask({"do": "example"})
        self.model, self.records = made["model"], []
        self._count = len(made["files"])
        for number, label in enumerate(made["files"], start=1):
            content = (self.folder / f"{number}.csv").read_bytes()
            self.records.append(_record(number, label, content))
        await self.read_columns()

    def new_number(self) -> int:
        """Return the number for a new file."""
        self.check_room(0)
        self._count += 1
        return self._count

    def check_room(self, size: int) -> None:
        """Refuse a file of a given size during a diagnosis, or beyond the accepted total."""
        self.check_idle()
        if len(self.records) >= RECORDS:
            raise Refused(f"Expected at most {RECORDS} files of records.")
        if self.size + size > ALL_BYTES:
            raise Refused(f"Expected at most {ALL_BYTES / 1e6:g} MB in all files of records.")

    async def take_record(self, number: int, label: str, content: bytes) -> None:
        """Take a file of records; a diagnosis may have begun, or others come, since its number."""
        self.check_room(len(content))
        record = _record(number, shown_name(label), content)
        (self.folder / record.file).write_bytes(content)
        self.records.append(record)
        try:
            await self.read_columns()
        except Refused:
            await self.drop_record(number)
            raise

    async def drop_record(self, number: int) -> None:
        """Remove a file of records."""
        self.check_idle()
        for record in [record for record in self.records if record.number == number]:
            self.records.remove(record)
            (self.folder / record.file).unlink()
        await self.read_columns()

    @property
    def size(self) -> int:
        """Size of all records in bytes."""
        return sum(record.size for record in self.records)

    async def read_columns(self) -> None:
        """Read the names of the files' columns; guess those that were not chosen, or are gone."""
        self.looked, self.result, self.message, self.running = False, None, "", None
        self.columns = None
        if self.model is None or all(is_conditions(record.label) for record in self.records):
            self.mapping = {}
            return
        self.columns = await self.ask({"do": "columns", "files": self.files})
        guess, there = self.columns["guess"], self.columns["columns"]
        chosen = {name: self.mapping[name] for name in guess if name in self.mapping}
        kept = {name: said for name, said in chosen.items() if said["column"] in there}
        self.mapping = {**guess, **kept}

    @property
    def files(self) -> list[dict]:
        """The files in the form that the process takes."""
        return [{"file": r.file, "label": r.label, "sha256": r.sha256} for r in self.records]

    # -- what is done ------------------------------------------------------------------------------

    async def ask(self, command: dict) -> dict:
        """Carry out a short command."""
        try:
            async with asyncio.timeout(PATIENCE):
                return await self.worker.ask(command, lambda _: None)
        except TimeoutError:
            await self.worker.end()
            raise Refused(f"This took longer than {PATIENCE:g} s and was ended.") from None
        except Ended:
            raise Refused(NO_MEMORY) from None

    def begin(self, what: str, mapping: dict, options: dict) -> None:
        """Begin a look or a diagnosis, which runs in the background."""
        self.check_idle()
        if self.columns is None:
            raise Refused("Expected a model and records first.")
        self.mapping, self.message, self.result = mapping, "", None
        self.running = Stages(what)
        label = self.model["label"] if self.model else ""
        command = {"do": what, "files": self.files, "mapping": mapping, "options": options}
        command |= {"label": label} if what == "diagnose" else {}
        self._task = asyncio.create_task(self._work(command, self.running))

    async def _work(self, command: dict, running: Stages) -> None:
        """Wait for the work in progress; the result of replaced work is dropped."""
        found, message = None, ""
        try:
            found = await self.worker.ask(command, running.step)
        except Refused as refused:
            message = str(refused)
        except Ended:
            message = NO_MEMORY
        if self.running is not running:
            return
        self.running, self.message, self.result = None, message, found or None
        if running.what == "look":
            self.looked = not message

    async def stop(self) -> None:
        """Stop the work in progress."""
        if self.running is not None:
            self.running, self.message = None, "Stopped."
            await self.worker.end()

    async def close(self) -> None:
        """End the process."""
        self.running = None
        await self.worker.end()


def _record(number: int, label: str, content: bytes) -> RecordFile:
    return RecordFile(number, label, len(content), hashlib.sha256(content).hexdigest())


def shown_name(name: str) -> str:
    r"""Return the name of a file for display: its last part, printable, not too long.

    >>> shown_name("C:\\rig\\run 1.csv"), shown_name("../../etc/passwd"), shown_name("")
    ('run 1.csv', 'passwd', 'file')
    """
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    return "".join(sign for sign in last if sign.isprintable())[-NAME:].strip() or "file"
