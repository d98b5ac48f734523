"""The command ``sklearn-pgnn fleet``: many machines, each with a page, and one report of all."""

import click

from sklearn_pgnn.cli.completion import FILE
from sklearn_pgnn.cli.guard import guarded
from sklearn_pgnn.cli.options import (
    diagnosis_options,
    fleet_options,
    list_effects,
    model_option,
    sample_time_option,
    show_options,
)
from sklearn_pgnn.cli.progress import show_progress

EXAMPLE = """\b
Example:
  sklearn-pgnn fleet --model pump.yaml march --pattern "{machine}_*.csv" --output march_result
  sklearn-pgnn fleet --model pump.yaml april --pattern "{machine}_*.csv" --output april_result \\
      --earlier march_result
"""


@click.command(epilog=EXAMPLE)
@click.argument("records", metavar="FOLDER", type=FILE)
@model_option
@click.option("--output", required=True, metavar="DIR", type=FILE, help="Folder for the results.")
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
@sample_time_option
@click.option(
    "--cluster",
    metavar="ADDRESS",
    help="Scheduler of a Dask cluster that does the work, as in tcp://10.0.0.1:8786; its workers "
    "read the same files.",
)
@show_options
@diagnosis_options
@fleet_options
@list_effects
def fleet(model, records, output, quiet, debug, as_json, opens, **options):
    """Diagnose many machines of one kind on their records.

    Writes DIR/index.html (open it first) with one row per machine, DIR/fleet.json, and for every
    machine the files that diagnose writes. Finished machines are kept in DIR: a stopped run
    continues there, and only machines whose records, model or options differ are diagnosed again.
    """
    with guarded(debug):
        with show_progress(quiet) as progress:
            progress("loading the libraries")
            from sklearn_pgnn.cli.fleet_job import FleetJob, print_fleet

            progress("reading the model")
            job = FleetJob(model, records, output, options)
            found = job.run(progress)
        print_fleet(found, output, as_json=as_json, quiet=quiet, opens=opens)
