"""The job of ``sklearn-pgnn fleet``: find the machines' files, diagnose them, report."""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from joblib import parallel_config
from rich.console import Console

from sklearn_pgnn.cli.guard import one_line, writing
from sklearn_pgnn.cli.inputs import read_model, read_search
from sklearn_pgnn.cli.tables import heading, print_table, say, screen
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.fleet import FleetDiagnosis
from sklearn_pgnn.fleet.fleet_diagnosis import REPORT
from sklearn_pgnn.fleet.machine import SAID
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import chance
from sklearn_pgnn.inspection.result_files import as_strict_json
from sklearn_pgnn.trajectories.channel_logs import METADATA

MACHINE = "{machine}"
#: machines and changes shown on the screen; the report has all
SHOWN = 20


@contextmanager
def on_cluster(address: str | None) -> Iterator[None]:
    """Let joblib spread its work over a cluster of Dask."""
    if address is None:
        yield
        return
    with needed_by("--cluster"):
        from distributed import Client
    with Client(address), parallel_config("dask"):
        yield


@dataclass(frozen=True)
class FleetJob:
    """One call of ``sklearn-pgnn fleet``; its options, and those of `cli.diagnose.Job`."""

    model: str
    records: str
    output: str
    options: Mapping[str, Any]

    def run(self, progress: Callable) -> FleetDiagnosis:
        """Diagnose the machines, and write the findings."""
        model, options = read_model(self.model), dict(self.options)
        own = {name: options.pop(name) for name in ("earlier", "sample_time", "n_jobs")}
        machines = machine_files(Path(self.records), options.pop("pattern"))
        cluster = options.pop("cluster")
        options |= read_search(model, options)
        if Path(self.output).exists() and not Path(self.output).is_dir():
            raise OptionError(
                f"--output: {self.output}: expected a folder for the results, got a file."
            )
        fleet = FleetDiagnosis(model, options=options, folder=self.output, progress=progress, **own)
        try:
            with writing(self.output), on_cluster(cluster):
                return fleet.fit(machines)
        except BrokenProcessPool:
            raise click.ClickException(
                f"a worker process was killed, perhaps for lack of memory. Finished machines are "
                f"kept in {one_line(self.output)}. Remedy: the same command again, with fewer "
                f"--jobs."
            ) from None


def machine_files(folder: Path, pattern: str | None = None) -> dict[str, list[str]]:
    """Return the files of every machine below a folder."""
    if not folder.is_dir():
        raise RecordError(f"{folder}: expected a folder with the records of the machines.")
    named = _reader(pattern)
    machines: dict[str, list[str]] = {}
    for file in sorted(_records(folder)):
        place = file.relative_to(folder)
        name = None if any(part.startswith(".") for part in place.parts) else named(place)
        if name:
            machines.setdefault(name, []).append(str(file))
    if not machines:
        wanted = "files" if pattern is None else f"files like {pattern}"
        raise RecordError(
            f"{folder}: expected {wanted} with the records of the machines, got none."
        )
    return dict(sorted(machines.items()))


def _records(folder: Path) -> Iterator[Path]:
    """Yield the files below a folder; a ROS bag's own folder is one record."""
    bags = {path.parent for path in folder.rglob(METADATA)}
    for path in folder.rglob("*"):
        if path in bags or (path.is_file() and path.parent not in bags):
            yield path


def _reader(pattern: str | None) -> Callable[[Path], str | None]:
    """Return the function that reads a machine's name from the path of its file."""
    if pattern is None:
        return lambda place: place.stem if len(place.parts) == 1 else place.parts[0]
    if pattern.count(MACHINE) != 1:
        raise OptionError(
            f"--pattern: expected {MACHINE} once, for the part of a name that identifies the "
            f"machine, got {pattern!r}."
        )
    words = {MACHINE: "(?P<machine>[^/]+?)", "*": "[^/]*"}
    parts = re.split(r"(\{machine\}|\*)", pattern)
    wanted = re.compile("".join(words.get(part, re.escape(part)) for part in parts))

    return lambda place: (found := wanted.fullmatch(place.as_posix())) and found["machine"]


def print_fleet(
    fleet: FleetDiagnosis, output: str, *, as_json: bool, quiet: bool, opens: bool
) -> None:
    """Print the findings on a fleet; with `quiet` only how often every verdict came."""
    report = Path(output, REPORT)
    if as_json:
        click.echo(as_strict_json(fleet.to_dict()), nl=False)
    else:
        _print_summary(fleet, report, quiet)
    if opens:
        click.launch(str(report.absolute()))


def _print_summary(fleet: FleetDiagnosis, report: Path, quiet: bool) -> None:
    console = screen()
    counts = Counter(machine.said for machine in fleet.machines_.values())
    told = ", ".join(f"{said.lower()} {counts[said]}" for said in SAID if counts[said])
    say(console, f"{len(fleet.machines_)} machines: {told}.", "bold")
    if quiet:
        return
    if fleet.changes_:
        heading(console, "What changed")
        for change in fleet.changes_[:SHOWN]:
            say(console, f"- {change.machine}: {change.what}")
        _more(console, len(fleet.changes_))
    adequate = VERDICTS["model_adequate"]
    wrong = [m for m in fleet.machines_.values() if m.said != adequate]
    if wrong:
        heading(console, "Machines, most certain first")
        rows = (
            (
                m.name,
                m.said,
                ", ".join(cause_name(*pair) for pair in m.named) or m.failed,
                chance(m.sure) if m.named else "",
            )
            for m in wrong[:SHOWN]
        )
        print_table(console, ("machine", "verdict", "cause", "how sure"), rows)
        _more(console, len(wrong))
    console.print()
    say(console, f"Report: {one_line(report)}")


def _more(console: Console, count: int) -> None:
    if count > SHOWN:
        say(console, f"and {count - SHOWN} more in the report.")
