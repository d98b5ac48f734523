"""The job of ``sklearn-pgnn check``: the content of the files, and a first simulation."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import click
import pandas as pd
from rich.console import Console

from sklearn_pgnn import __version__
from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.cli.inputs import open_model
from sklearn_pgnn.cli.tables import heading, print_findings, print_table, say, screen
from sklearn_pgnn.exceptions import ModelWarning, RecordWarning, code_of
from sklearn_pgnn.inspection.first_look import FirstLook, first_look, told_table
from sklearn_pgnn.inspection.missing_efforts import missing_efforts
from sklearn_pgnn.inspection.numbers import fit_text, number
from sklearn_pgnn.inspection.result_files import as_strict_json
from sklearn_pgnn.physics.channel_kinds import in_words
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import finding_of
from sklearn_pgnn.record_quality.identifiability import Identifiability, identifiability
from sklearn_pgnn.record_quality.joint_torques import has_several_joints
from sklearn_pgnn.trajectories.file_table import FileTable
from sklearn_pgnn.trajectories.files import open_file
from sklearn_pgnn.trajectories.several_files import read_each


class Checked(NamedTuple):
    """Result of a check: a first look, what the records can tell, columns, missing efforts."""

    look: FirstLook
    told: Identifiability
    unused: list[str]
    converted: dict[str, tuple[str, str]]
    missing: pd.DataFrame | None = None


def check_model(
    model: FilePath, data: Sequence[FilePath], sample_time: float | None = None
) -> Checked:
    """Check a model file against files of records."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("ignore")
        warnings.simplefilter("once", ModelWarning)
        warnings.simplefilter("once", RecordWarning)
        read = open_model(model)
        tables: list[FileTable] = []

        def opened(path: FilePath, model: PhysicsModel, sample_time: float | None) -> FileTable:
            tables.append(open_file(path, model, sample_time))
            return tables[-1]

        X, y = read_each(opened, data, read, sample_time)
        unused = dict.fromkeys(name for table in tables for name in table.unused())
        converted = {name: units for table in tables for name, units in table.converted().items()}
        look, known = first_look(read, X, y), identifiability(read, X, y)
        missing = missing_efforts(read, X, y) if has_several_joints(read) else None
    said = dict.fromkeys((code_of(each.category), str(each.message)) for each in told)
    found = (finding_of(code.replace("_", " "), message) for code, message in said)
    look = replace(look, findings=(*found, *look.findings))
    return Checked(look, known, list(unused), converted, missing)


def print_check(checked: Checked, *, as_json: bool, quiet: bool) -> None:
    """Print the result of a check."""
    look = checked.look
    if as_json:
        more: dict = {"unused_columns": checked.unused, "converted": checked.converted}
        more["version"] = __version__
        if checked.missing is not None:
            more["missing_efforts"] = checked.missing.to_dict("index")
        more["identifiability"] = checked.told.to_dict()
        click.echo(as_strict_json({**look.to_dict(), **more}), nl=False)
        return
    console = screen()
    say(console, _summary(look), "bold")
    if look.findings:
        heading(console, "Warnings")
        print_findings(console, look.findings, "yellow")
    if not quiet:
        _print_contents(console, checked)
    heading(console, "First simulation of the model as given, in free run")
    fits = (
        (o.output, fit_text(o.fit), number(o.error, 3), number(o.noise, 3), o.unit or "-")
        for o in look.outputs
    )
    print_table(console, ("", "fit", "error (rms)", "noise", ""), fits)
    say(console, "A fit of 100 % is perfect, 0 % no better than the mean of the records.", "dim")
    if checked.missing is not None:
        _print_missing(console, checked.missing)
    if not quiet:
        _print_told(console, checked.told)


def _summary(look: FirstLook) -> str:
    model = look.model
    kinds = ("states", "inputs", "outputs", "free_parameters")
    sizes = {kind[:-1].replace("_", " "): len(getattr(model, kind)) for kind in kinds}
    counts = [f"{n} {kind}{'' if n == 1 else 's'}" for kind, n in sizes.items()]
    held = "can be used" if not look.findings else "can be read, with warnings"
    return f"The model of the {model.name} ({', '.join(counts)}) and the records {held}."


def _print_contents(console: Console, checked: Checked) -> None:
    """Print what is in the files: the records, and the quantities."""
    look = checked.look
    heading(console, "Records")
    outputs = look.outputs if len(look.records) > 1 else ()  # of one record, the last table tells
    fits = [f"fit of {one_line(o.output)}" for o in outputs]
    records = (
        (
            r.name,
            r.samples,
            f"{number(r.duration)} s",
            f"{number(r.sample_time)} s",
            *(fit_text(r.fit[o.output]) for o in outputs),
        )
        for r in look.records
    )
    print_table(console, ("", "samples", "duration", "sample time", *fits), records)
    heading(console, "Contents")
    quantities = (
        (q.name, q.role, number(q.low), number(q.high), q.unit or "-", q.missing or "")
        for q in look.quantities
    )
    print_table(console, ("", "", "from", "to", "", "missing"), quantities)
    for name, (given, wanted) in checked.converted.items():
        say(console, f"Converted: {name} from {given} to {wanted}.")
    say(console, f"Assumed of the channels: {in_words(look.model)}.")
    if checked.unused:
        say(console, f"Not used: {', '.join(checked.unused)}.")


def _print_told(console: Console, told: Identifiability) -> None:
    """Print which parameters the records can tell, and what would help."""
    if not (told.parameters or told.remarks):
        return
    heading(console, "What these records can tell")
    print_table(console, *told_table(told))
    for remark in told.remarks:
        say(console, remark)


def _print_missing(console: Console, missing: pd.DataFrame) -> None:
    """Print what is missing at each port, and what explains it best."""
    heading(console, "Missing at the joints, by torque minus inverse dynamics")
    rows = (
        (
            name,
            number(row["missing"]),
            row["unit"],
            *(f"{100 * row[law]:.0f} %" for law in ("sign(flow)", "all")),
        )
        for name, row in missing.iterrows()
    )
    titles = ("", "missing (rms)", "", "explained by sign of the velocity", "by all laws")
    print_table(console, titles, rows)
