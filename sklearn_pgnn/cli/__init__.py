"""The command line: ``sklearn-pgnn diagnose`` and ``sklearn-pgnn demo``."""

import click

from sklearn_pgnn import __version__
from sklearn_pgnn.cli.guard import guarded
from sklearn_pgnn.cli.progress import show_progress

EXAMPLE = """\b
Example:
  sklearn-pgnn diagnose --model model.yaml train.csv test.csv --output result
"""


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXAMPLE)
@click.version_option(__version__, "-V", "--version", prog_name="sklearn-pgnn")
def main():
    """Find what is wrong with a physical model of a machine, from records of the test rig."""


def _job_options(command):
    """Give a command the options that say how to work, not on what."""
    options = (
        click.option("--jobs", default=-1, show_default="all cores", help="Threads to use."),
        click.option("--quiet", is_flag=True, help="Print the verdict only, no progress."),
        click.option("--debug", is_flag=True, help="Show the traceback of an unexpected error."),
    )
    for option in reversed(options):
        command = option(command)
    return command


@main.command(epilog=EXAMPLE)
@click.argument("data", nargs=-1, required=True, metavar="DATA.csv [DATA.csv ...]")
@click.option("--model", required=True, metavar="MODEL.yaml", help="The model file.")
@click.option("--output", required=True, metavar="DIR", help="Where the results go.")
@click.option(
    "--hold",
    type=click.Choice(["auto", "zoh", "foh"]),
    default="auto",
    show_default=True,
    help="Inputs are held between samples (zoh), or run straight from one to the next (foh); "
    "auto: held, unless the records speak against it.",
)
@click.option(
    "--window",
    type=click.FloatRange(min=0, min_open=True),
    metavar="S",
    help="Window length [s]; by default the records tell.",
)
@click.option(
    "--max-causes",
    type=click.IntRange(min=1),
    default=4,
    show_default=True,
    help="Causes named at most.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Random seed."
)
@_job_options
def diagnose(data, model, output, jobs, quiet, debug, **options):
    """Diagnose a model on CSV records.

    Writes DIR/report.html (open it first), DIR/diagnosis.json and DIR/extended_model.yaml.

    A CSV file is one record: a header, the time t [s], the inputs and the measured outputs under
    the names that the model file gives them. The exit code is 0 with any verdict, 2 if the input
    cannot be used, 1 after a bug of ours, 130 or 143 after Ctrl-C or SIGTERM.
    """
    with guarded(debug):
        with show_progress(quiet) as progress:
            progress("loading the libraries")
            from sklearn_pgnn.cli.diagnose import Job

            job = Job(model, data, output, jobs=jobs, quiet=quiet, **options)
            diagnosis = job.run(progress)
        job.tell(diagnosis)


@main.command()
@click.option(
    "--output", default="sklearn_pgnn_demo", show_default=True, metavar="DIR", help="Where it goes."
)
@_job_options
def demo(output, jobs, quiet, debug):
    """Diagnose a simulated golf robot whose model misses its stick-slip.

    Writes the model file and the CSV records to DIR/input, and diagnoses them.
    """
    with guarded(debug):
        with show_progress(quiet) as progress:
            progress("loading the libraries")
            from sklearn_pgnn.cli.demo import run_demo
        run_demo(output, jobs=jobs, quiet=quiet)
