"""The job of ``sklearn-pgnn diagnose``: read, diagnose, write, print."""

import shlex
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import click
from click.core import ParameterSource

from sklearn_pgnn.annotations import Table
from sklearn_pgnn.cli.guard import Bug, one_line
from sklearn_pgnn.cli.inputs import read_model, read_search, told_warnings
from sklearn_pgnn.cli.options import RUN_KINDS
from sklearn_pgnn.cli.output import (
    check_free,
    remove_files,
    result_folder,
    strict_json,
    write_files,
)
from sklearn_pgnn.cli.screen import print_diagnosis
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.exceptions import DiagnosisWarning, ModelError, ModelWarning, RecordWarning
from sklearn_pgnn.export import to_mjcf, to_urdf
from sklearn_pgnn.inspection.case import model_with_all
from sklearn_pgnn.inspection.report import Provenance, render_report
from sklearn_pgnn.inspection.result_files import EXTENDED, RIVALS, model_files
from sklearn_pgnn.inspection.run_files import RUNS, check_kind, simulated_records, write_runs
from sklearn_pgnn.priors.robot_section import described_in
from sklearn_pgnn.trajectories.files import read_files

#: how a copy of a robot's file is written, by its ending, and the copy's name without it
ROBOTS = {".urdf": to_urdf, ".xml": to_mjcf, ".mjcf": to_mjcf}
ROBOT = "extended_model"
#: the files of a diagnosis
NAMES = (
    "diagnosis.json",
    EXTENDED,
    *(f"{ROBOT}{ending}" for ending in ROBOTS),
    "report.html",
    *(f"{RUNS}.{ending}" for ending in (*RUN_KINDS, "xml")),
)
#: what is in the files of runs
WHAT = "measured and simulated outputs, and the residual, over time"
LAYOUT = "their layout for PlotJuggler"
#: time [s] that a diagnosis gets in any case
SOON = 1e-3


def command_line() -> str:
    """Return the running command with its arguments, for a report; empty outside a command."""
    context = click.get_current_context(silent=True)
    if context is None:
        return ""
    words = context.command_path.split()
    for parameter in context.command.params:
        name = parameter.name
        if name and context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            value = context.params[name]
            values = value if isinstance(value, tuple) else (value,)
            option = [] if isinstance(parameter, click.Argument) else [parameter.opts[-1]]
            if getattr(parameter, "is_flag", False):
                words += option if value else []
            else:
                words += [word for each in values for word in (*option, str(each))]
    return shlex.join(words)


class Done(NamedTuple):
    """The result of a job: the diagnosis, its warnings, and whether files were replaced."""

    diagnosis: ModelDiagnosis
    warned: list[str]
    replaced: bool


@dataclass(frozen=True)
class Job:
    """One call of ``sklearn-pgnn diagnose``.

    With `quiet` the verdict only is printed, with `as_json` ``diagnosis.json`` in place of words;
    `runs` is the kind of file for the records with their simulations, None for none.
    The options are ``sample_time`` as in `read_files`; words for ``noise``, ``catalogue``,
    ``exclude`` and ``targets``, see `sklearn_pgnn.cli.inputs`; all others as in `ModelDiagnosis`.
    """

    model: str | PathLike
    data: Sequence[str | PathLike]
    output: str | PathLike
    quiet: bool = False
    force: bool = False
    as_json: bool = False
    opens: bool = False
    runs: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def run(self, progress: Callable) -> Done:
        """Read, diagnose and write."""
        check_kind(self.runs)
        rivals = sorted(file.name for file in Path(self.output).glob(RIVALS))
        earlier = check_free(Path(self.output), [*NAMES, *rivals], force=self.force)
        progress("reading the model and the records")
        model = read_model(self.model)
        begun = monotonic()
        options = {name: value for name, value in self.options.items() if name != "sample_time"}
        options |= read_search(model, options)
        diagnosis = ModelDiagnosis(model, **options, progress=progress)
        with told_warnings(RecordWarning):
            X, y = read_files(self.data, model, self.options.get("sample_time"))
        if diagnosis.time_limit is not None:
            left = diagnosis.time_limit - (monotonic() - begun)
            diagnosis.set_params(time_limit=max(left, SOON))
        provenance = Provenance.of_files(self.model, self.data, command_line())
        with result_folder(Path(self.output)) as folder:
            broken, warned = fit_kept(diagnosis, X, y)
            progress("writing the report")
            failed = write_results(folder, diagnosis, provenance)
            write_robot(described_in(self.model), diagnosis, folder)
            try:
                if self.runs is not None and hasattr(diagnosis, "records_"):
                    write_runs(simulated_records(diagnosis), folder, self.runs)
            except Exception as unwritten:  # the result is not lost with a file beside it
                failed = failed or unwritten
            kept = sorted(file.name for file in folder.iterdir())
        remove_files(Path(self.output), {*rivals} - {*kept})
        if (error := broken or failed) is not None:
            place = f"The results so far are in {one_line(self.output)}: {', '.join(kept)}."
            raise Bug(error, place if kept else "") from error
        return Done(diagnosis, warned, bool(earlier))

    def print_summary(self, done: Done) -> None:
        """Print the findings and the location of the files."""
        if done.replaced and not self.quiet:
            place = one_line(self.output)
            click.echo(f"Replaced the files of an earlier diagnosis in {place}.", err=True)
        for warning in done.warned:
            click.echo(f"Warning: {one_line(warning)}", err=True)
        if self.as_json:
            click.echo(strict_json(done.diagnosis), nl=False)
        else:
            more = {f"{RUNS}.{self.runs}": WHAT, f"{RUNS}.xml": LAYOUT} if self.runs else {}
            print_diagnosis(done.diagnosis, Path(self.output), quiet=self.quiet, more=more)
        if self.opens:
            click.launch(str(Path(self.output, "report.html").absolute()))


def fit_kept(diagnosis: ModelDiagnosis, X: Table, y: Table) -> tuple[Exception | None, list[str]]:
    """Fit; return the error of a stage that was left out, or None, and the warnings."""
    with _noted(RecordWarning, DiagnosisWarning) as told:
        try:
            diagnosis.fit(X, y)
        except SystemExit:
            click.echo(
                "No result of the search is kept. Remedy: --time-limit SECONDS ends a search with "
                "the best result so far.",
                err=True,
            )
            raise
    records = [str(each) for each in told if isinstance(each, RecordWarning)]
    return _left_out(told), records


def write_results(
    folder: Path, diagnosis: ModelDiagnosis, provenance: Provenance
) -> Exception | None:
    """Write the files of a result; return the error of a file or a part that was left out."""
    with _noted(DiagnosisWarning) as told:
        texts = {
            "diagnosis.json": lambda: strict_json(diagnosis),
            **model_files(diagnosis),
            "report.html": lambda: render_report(diagnosis, provenance),
        }
        failed = write_files(folder, texts)
    return next(iter(failed.values()), None) or _left_out(told)


def write_robot(source: Path | None, diagnosis: ModelDiagnosis, folder: Path) -> None:
    """Write what was found at joints into a copy of a robot's file, or print why it cannot be."""
    if source is None or not hasattr(diagnosis, "extended_model_"):
        return
    ending = source.suffix.lower()
    try:
        with told_warnings(ModelWarning):
            ROBOTS[ending](model_with_all(diagnosis), source, folder / f"{ROBOT}{ending}")
    except ModelError as error:
        click.echo(f"Warning: {one_line(error)}", err=True)


@contextmanager
def _noted(*categories: type[Warning]) -> Iterator[list[Warning]]:
    """Yield a list that holds the warnings of some categories afterwards; others are ignored."""
    noted: list[Warning] = []
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("ignore")
        for category in categories:
            warnings.simplefilter("always", category)
        yield noted
        noted += [each.message for each in told if isinstance(each.message, Warning)]


def _left_out(told: Iterable[Warning]) -> Exception | None:
    """Return the error of the first stage or part that was left out."""
    errors = (each.__cause__ for each in told if isinstance(each, DiagnosisWarning))
    return next((error for error in errors if isinstance(error, Exception)), None)
