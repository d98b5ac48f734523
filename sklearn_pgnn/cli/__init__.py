"""The command line; nothing heavy is imported before the first word is on the screen."""

from collections.abc import Callable
from typing import Any

import click

from sklearn_pgnn import __version__
from sklearn_pgnn.cli.commands import app, check, compare, detect, fit, fleet, init, simulate
from sklearn_pgnn.cli.ending import run_to_the_end, take_any_text
from sklearn_pgnn.cli.explain import explain
from sklearn_pgnn.cli.export import export
from sklearn_pgnn.cli.guard import job
from sklearn_pgnn.cli.options import (
    CORES,
    DIAGNOSIS,
    FILE,
    FORCE,
    LIST_EFFECTS,
    PROGRAM,
    RECORDS,
    RUN_KINDS,
    SHELLS,
    SHOW,
    TALK,
    completion_script,
    output_option,
    with_options,
)
from sklearn_pgnn.progress_display import Show

EXAMPLE = """\b
Example:
  sklearn-pgnn diagnose --model model.yaml train.csv test.csv --output result
"""
WHERE = """\b
Install it with:
  bash  eval "$(sklearn-pgnn completion bash)"   in ~/.bashrc
  zsh   eval "$(sklearn-pgnn completion zsh)"    in ~/.zshrc
  fish  sklearn-pgnn completion fish > ~/.config/fish/completions/sklearn-pgnn.fish
"""


class InOrder(click.Group):
    """Commands that are listed as one comes to use them."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the command line."""
        take_any_text()
        return super().main(*args, **kwargs)

    def list_commands(self, context: click.Context) -> list[str]:
        """Return the names of the commands as they were added."""
        return list(self.commands)


@click.group(cls=InOrder, context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXAMPLE)
@click.version_option(__version__, "-V", "--version", prog_name=PROGRAM)
def main() -> None:
    """Find what is wrong with a physical model of a machine, from records of the test rig."""


@click.command(epilog=EXAMPLE)
@with_options(*RECORDS, output_option("DIR", "Folder for the results."), FORCE, *SHOW)
@click.option(
    "--runs",
    type=click.Choice(RUN_KINDS),
    help="Also write measured and simulated outputs, and the residual, over one time, to "
    "DIR/runs.csv or such, with a layout for PlotJuggler, runs.xml.",
)
@with_options(*DIAGNOSIS, CORES, *TALK, LIST_EFFECTS)
@job
def diagnose(
    progress: Show,
    data: tuple[str, ...],
    model: str,
    output: str,
    quiet: bool,
    force: bool,
    as_json: bool,
    opens: bool,
    runs: str | None,
    **options: Any,
) -> Callable[[], object]:
    """Diagnose a model on records.

    Writes DIR/report.html (open it first), DIR/diagnosis.json and DIR/extended_model.yaml (of a
    robot a copy of its URDF or MJCF file), and a model file with each rival of an ambiguous cause.

    A file is one record: CSV, MAT, Parquet or Excel, with the time t [s], the inputs and the
    measured outputs under the names that the model file gives them. The exit code is 0 with any
    verdict, 2 if the input cannot be used, 3 after an internal error that left a result, 1 after
    one that left none, 130 or 143 after Ctrl-C or SIGTERM.
    """
    from sklearn_pgnn.cli.diagnose import Job

    asked = Job(model, data, output, quiet, force, as_json, opens, runs, options)
    done = asked.run(progress)
    return lambda: asked.print_summary(done)


@click.command()
@click.option(
    "--output",
    default="sklearn_pgnn_demo",
    show_default=True,
    metavar="DIR",
    type=FILE,
    help="Folder for the files of the demo.",
)
@with_options(FORCE, *SHOW, CORES, *TALK)
@job
def demo(_progress: Show, output: str, quiet: bool, **options: Any) -> Callable[[], object]:
    """Diagnose a simulated golf robot whose model lacks stick-slip.

    Writes the model file and the CSV records to DIR/input, and diagnoses them.
    """
    from sklearn_pgnn.cli.demo import run_demo

    return lambda: run_demo(output, quiet=quiet, **options)


@click.command(epilog=WHERE)
@click.argument("shell", type=click.Choice(SHELLS))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print the script with which a shell completes commands, options, files and effects."""
    click.echo(completion_script(context.find_root().command, shell))


def run() -> None:
    """Run the command line as a process."""
    run_to_the_end(lambda: main(prog_name=PROGRAM))


COMMANDS = (demo, init, check, simulate, fit, diagnose, detect, compare, fleet, export, app)
for command in (*COMMANDS, explain, completion):
    main.add_command(command)
