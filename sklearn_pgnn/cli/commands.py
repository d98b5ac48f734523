"""The commands around a diagnosis: a model file, its check, its simulation, its fit, a fleet."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from sklearn_pgnn.cli.guard import job
from sklearn_pgnn.cli.options import (
    CANDIDATES,
    CORES,
    DIAGNOSIS,
    FILE,
    FORCE,
    HOLD,
    JSON,
    LIST_EFFECTS,
    MODEL,
    MODEL_FILE,
    NOISE,
    PROCESSES,
    RECORDS,
    SAID_HOLD,
    SAMPLE_TIME,
    SEED,
    SHOW,
    SUBSTEPS,
    SYSTEMS,
    TALK,
    WINDOW,
    output_option,
    with_options,
)
from sklearn_pgnn.progress_display import Show

FLEETS = """\b
Example:
  sklearn-pgnn fleet --model pump.yaml march --pattern "{machine}_*.csv" --output march_result
  sklearn-pgnn fleet --model pump.yaml april --pattern "{machine}_*.csv" --output april_result \\
      --earlier march_result
"""


@click.command()
@click.argument("path", default=MODEL_FILE, metavar="[MODEL.yaml | ROBOT.urdf]", type=FILE)
@click.option(
    "--like",
    type=click.Choice(tuple(SYSTEMS)),
    default=next(iter(SYSTEMS)),
    show_default=True,
    help="The ready system to start from.",
)
@click.option(
    "--records",
    metavar="DATA",
    type=FILE,
    help="A file of records, whose columns are listed; or a robot's description.",
)
@with_options(FORCE, *TALK)
@job
def init(
    _progress: Show, path: str, like: str, records: str | None, force: bool, quiet: bool
) -> Callable[[], object]:
    """Write a commented model file to start from.

    It is a complete model of a ready system; replace it by your machine. Of a robot in URDF or MJCF
    (.xml, .mjcf) it is the model: model.yaml names that file, and lists ports, inputs, outputs and
    parameters.
    """
    from sklearn_pgnn.cli.template import write_template

    return lambda: write_template(path, like, records, force=force, quiet=quiet)


@click.command()
@with_options(*RECORDS, JSON, *TALK)
@job
def check(
    progress: Show,
    model: str,
    data: tuple[str, ...],
    sample_time: float | None,
    as_json: bool,
    quiet: bool,
) -> Callable[[], object]:
    """Compare a model file with records, in seconds.

    Shows the contents of the files and the fit of the model as given, and warns of missing columns,
    wrong units, wrong signs and inputs that never change.
    """
    from sklearn_pgnn.cli.check import check_model, print_check

    progress("reading and simulating")
    checked = check_model(model, data, sample_time)
    return lambda: print_check(checked, as_json=as_json, quiet=quiet)


@click.command()
@with_options(*RECORDS, output_option("FILE.csv"), FORCE, *TALK)
@job
def simulate(
    progress: Show,
    model: str,
    data: tuple[str, ...],
    sample_time: float | None,
    output: str,
    force: bool,
    quiet: bool,
) -> Callable[[], object]:
    """Simulate a model file on the inputs of records, in free run.

    A record starts from the states in its file, else from those that its outputs show, else from
    the model's initial state. The files need no outputs; if they have them, the fit is printed.
    """
    from sklearn_pgnn.cli.output import refuse_existing, write_file
    from sklearn_pgnn.cli.simulate import print_simulation, simulate_files

    refuse_existing(output, force=force)
    progress("simulating")
    read, rows, fits = simulate_files(model, data, sample_time)
    text = rows.to_csv(index=False, float_format="%.9g", lineterminator="\n")
    write_file(output, text, force=force)
    return lambda: print_simulation(read, fits, output, len(rows), quiet=quiet)


@click.command()
@with_options(*RECORDS, output_option("FITTED.yaml"))
@click.option(
    "--free",
    multiple=True,
    metavar="NAMES",
    help="Parameters to fit, separated by commas; by default all that are not fixed.",
)
@click.option("--free-run", is_flag=True, help="Fit the free run of whole records, not windows.")
@with_options(FORCE, JSON, NOISE, SAID_HOLD, SUBSTEPS, WINDOW, SEED, CORES, *TALK)
@job
def fit(
    progress: Show,
    model: str,
    data: tuple[str, ...],
    output: str,
    force: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> Callable[[], object]:
    """Fit the free parameters of a model file to records.

    The fit uses the bounds of the parameters, not their spreads; it does not look for missing
    effects.
    """
    from sklearn_pgnn.cli.fit import FitJob
    from sklearn_pgnn.cli.inputs import told_warnings
    from sklearn_pgnn.cli.output import refuse_existing, write_file

    refuse_existing(output, force=force)
    progress("reading the model and the records")
    job = FitJob(model, data, **options)
    progress("fitting")
    with told_warnings(UserWarning):
        job.run()
    write_file(output, job.text(output), force=force)
    return lambda: job.print_summary(output, as_json=as_json, quiet=quiet)


@click.command()
@click.argument("one", metavar="A", type=FILE)
@click.argument("other", metavar="B", type=FILE)
@click.option("--output", metavar="FILE.html", type=FILE, help="File for a report (optional).")
@with_options(FORCE, *SHOW, *TALK)
@job
def compare(
    _progress: Show,
    one: str,
    other: str,
    output: str | None,
    force: bool,
    as_json: bool,
    opens: bool,
    quiet: bool,
) -> Callable[[], object]:
    """Compare two diagnoses: before and after a repair, say, or two machines.

    A and B are folders that diagnose has written, or the diagnosis.json in them.
    """
    from sklearn_pgnn.cli.output import write_file
    from sklearn_pgnn.cli.screen import print_comparison
    from sklearn_pgnn.exceptions import OptionError
    from sklearn_pgnn.inspection import compare as compare_diagnoses
    from sklearn_pgnn.inspection.comparison_report import render_comparison

    if opens and output is None:
        raise OptionError("--open: expected a report to open. Remedy: name it (--output).")
    found = compare_diagnoses(one, other)
    if output is not None:
        write_file(output, render_comparison(found), force=force)
        if opens:
            click.launch(str(Path(output).absolute()))
    return lambda: print_comparison(found, as_json=as_json, quiet=quiet)


@click.command()
@click.option(
    "--port",
    type=click.IntRange(min=0, max=65535),
    default=8765,
    show_default=True,
    help="Port of the page; 0 selects a free one.",
)
@click.option("--open", "opens", is_flag=True, help="Open the page.")
@with_options(*TALK)
@job
def app(_progress: Show, port: int, opens: bool, quiet: bool) -> Callable[[], object]:
    """Serve a page on which files are dropped and diagnosed.

    It is accessible from this computer only, and no data leave it. Drop a model file and CSV files,
    assign the columns, compare the records with the model, and start a diagnosis.
    """
    from sklearn_pgnn.cli.app.serve import serve

    return lambda: serve(port, opens=opens, quiet=quiet)


@click.command()
@with_options(*RECORDS)
@click.option(
    "--power",
    type=click.FloatRange(min=0, max=1, min_open=True, max_open=True),
    default=0.9,
    show_default=True,
    help="Probability with which an effect of the smallest size is named.",
)
@with_options(JSON, NOISE, HOLD, SUBSTEPS, WINDOW, *CANDIDATES, SEED, CORES, *TALK, LIST_EFFECTS)
@job
def detect(
    progress: Show, model: str, data: tuple[str, ...], as_json: bool, quiet: bool, **options: Any
) -> Callable[[], object]:
    """Find how large every effect must be to be named on records like these.

    Every effect is added to the re-tuned model, with the inputs and the noise of the records.
    """
    from sklearn_pgnn.cli.detect import DetectJob

    progress("reading the model and the records")
    job = DetectJob(model, data, **options)
    found = job.run(progress)
    return lambda: job.print_summary(found, as_json=as_json, quiet=quiet)


@click.command(epilog=FLEETS)
@click.argument("records", metavar="FOLDER", type=FILE)
@with_options(MODEL, output_option("DIR", "Folder for the results."))
@click.option(
    "--pattern",
    metavar="PATTERN",
    help="Names of the files below FOLDER, with {machine} for the machine and * for anything, as "
    "in {machine}/run_*.csv; by default every folder in FOLDER is a machine, and every file.",
)
@click.option(
    "--earlier",
    metavar="DIR",
    type=FILE,
    help="Results of an earlier run, to report what changed.",
)
@with_options(SAMPLE_TIME)
@click.option(
    "--cluster",
    metavar="ADDRESS",
    help="Scheduler of a Dask cluster that does the work, as in tcp://10.0.0.1:8786; its workers "
    "read the same files.",
)
@with_options(*SHOW, *DIAGNOSIS, PROCESSES, *TALK, LIST_EFFECTS)
@job
def fleet(
    progress: Show,
    model: str,
    records: str,
    output: str,
    quiet: bool,
    as_json: bool,
    opens: bool,
    **options: Any,
) -> Callable[[], object]:
    """Diagnose many machines of one kind on their records.

    Writes DIR/index.html (open it first) with one row per machine, DIR/fleet.json, and for every
    machine the files that diagnose writes. Finished machines are kept in DIR: a stopped run
    continues there, and only machines whose records, model or options differ are diagnosed again.
    """
    from sklearn_pgnn.cli.fleet_job import FleetJob, print_fleet

    progress("reading the model")
    found = FleetJob(model, records, output, options).run(progress)
    return lambda: print_fleet(found, output, as_json=as_json, quiet=quiet, opens=opens)
