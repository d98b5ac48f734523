"""The command ``sklearn-pgnn export``: a model file in the language of another tool."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from sklearn_pgnn.cli.ending import held
from sklearn_pgnn.cli.guard import job, one_line, writing
from sklearn_pgnn.cli.options import FILE, FORCE, POSITIVE, TALK, output_option, with_options
from sklearn_pgnn.progress_display import Show
from sklearn_pgnn.whole_file import WorkingFolder

#: the targets, and the options of each besides the name
TARGETS = {
    "c": ("interval", "substeps", "precision", "parameters"),
    "fmu": ("interval", "substeps", "fmi", "compiler"),
    "modelica": ("friction_width",),
}
#: the required options of a target
NEEDED = {"c": ("interval",), "fmu": ("interval",), "modelica": ()}


@click.command()
@click.option("--model", required=True, metavar="MODEL.yaml", type=FILE, help="The model file.")
@click.option(
    "--to",
    "target",
    required=True,
    type=click.Choice([*TARGETS]),
    help="One C99 file, an FMU for co-simulation, or Modelica text.",
)
@with_options(output_option("FILE"))
@click.option(
    "--interval",
    type=POSITIVE,
    metavar="S",
    help="c, fmu: time from sample to sample [s].",
)
@click.option("--name", help="Prefix of all names in the file; by default the model's name.")
@click.option(
    "--substeps",
    type=click.IntRange(min=1, max=10_000),
    metavar="N",
    help="c, fmu: integration steps from sample to sample; by default as the model file says.",
)
@click.option(
    "--precision",
    type=click.Choice(["double", "single"]),
    help="c: of all numbers; by default double.",
)
@click.option(
    "--parameters",
    type=click.Choice(["constants", "struct"]),
    help="c: in the equations, or in a struct that may change; by default constants.",
)
@click.option("--fmi", type=click.Choice(["2", "3"]), help="fmu: version of FMI; by default 2.")
@click.option(
    "--compiler",
    metavar="CC",
    help="fmu: makes the binary, or none for source only; by default gcc.",
)
@click.option(
    "--friction-width",
    type=POSITIVE,
    metavar="SPEED",
    help="modelica: speed over which the jump of dry friction is rounded off.",
)
@with_options(FORCE, *TALK)
@job
def export(
    progress: Show,
    model: str,
    target: str,
    output: str,
    name: str | None,
    force: bool,
    quiet: bool,
    **options: Any,
) -> Callable[[], object] | None:
    """Write a model file in the language of another tool.

    The C file and the FMU compute the same as the simulation, with sticking friction and delays.
    """
    from sklearn_pgnn.cli.inputs import read_model
    from sklearn_pgnn.cli.output import refuse_existing

    given = check_options(target, options)
    refuse_existing(output, force=force)
    progress("reading the model")
    read = read_model(model)
    progress("writing")
    write = writer_of(target)
    _replace(Path(output), lambda path: write(read, path, name=name, **given))
    return None if quiet else lambda: click.echo(f"Written: {one_line(output)}.")


def check_options(target: str, options: dict) -> dict:
    """Return the given options, if the target accepts them and none is missing.

    >>> check_options("c", {"interval": 0.01, "fmi": None})
    {'interval': 0.01}
    """
    from sklearn_pgnn.exceptions import OptionError

    given = {name: value for name, value in options.items() if value is not None}
    strange = [name for name in given if name not in TARGETS[target]]
    missing = [name for name in NEEDED[target] if name not in given]
    if strange:
        takes = ", ".join(map(_flag, TARGETS[target]))
        raise OptionError(f"{_flag(strange[0])}: --to {target} takes {takes}, not this.")
    if missing:
        raise OptionError(
            f"{_flag(missing[0])}: --to {target} needs it. Remedy: {_flag(missing[0])} 0.01 for a "
            f"hundred samples a second."
        )
    return given


def writer_of(target: str) -> Callable:
    """Return the function that writes a model to a path."""
    from sklearn_pgnn import export as room

    if target == "fmu":
        return lambda model, path, fmi="2", compiler="gcc", **options: room.to_fmu(
            model, path, fmi=int(fmi), compiler=None if compiler == "none" else compiler, **options
        )
    texts: dict[str, Callable[..., str]] = {"c": room.to_c, "modelica": room.to_modelica}
    text = texts[target]
    return lambda model, path, **options: path.write_text(
        text(model, **options), encoding="utf-8", newline="\n"
    )


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _replace(path: Path, write: Callable[[Path], None]) -> None:
    """Write a file completely or not at all."""
    with held(), writing(path):
        folder = WorkingFolder(path.absolute().parent)
        try:
            write(folder.path / path.name)
            os.replace(folder.path / path.name, path)
        finally:
            folder.remove()
