"""The job of ``sklearn-pgnn demo``: a golf robot whose model lacks stick-slip."""

import shlex
from pathlib import Path
from typing import Any

import click

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.cli.diagnose import NAMES, Job
from sklearn_pgnn.cli.guard import one_line, show_progress, writing
from sklearn_pgnn.cli.output import check_free
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.physics.effects import StribeckFriction
from sklearn_pgnn.physics.systems import golf_robot

HIDDEN = StribeckFriction("omega", level=0.1, peak=0.1, velocity=0.3)
SIZES: dict[str, Any] = {"n_records": 6, "duration": 10.0, "sample_rate": 100.0}


def run_demo(
    output: FilePath,
    *,
    n_jobs: int = -1,
    quiet: bool = False,
    force: bool = False,
    as_json: bool = False,
    opens: bool = False,
) -> None:
    """Write the model file and the records to ``input``, diagnose them, and report the findings."""
    check_free(Path(output), NAMES, force=force)
    place, words = Path(output) / "input", not (quiet or as_json)
    with show_progress(quiet) as progress:
        progress("simulating the records")
        with writing(place):
            model, data = write_input(place)
    if words:
        _print_task(model, data)
    job = Job(model, data, output, quiet, force, as_json, opens, options={"n_jobs": n_jobs})
    with show_progress(quiet) as progress:
        done = job.run(progress)
    job.print_summary(done)
    if words:
        _print_truth(model, output)


def write_input(folder: Path) -> tuple[Path, list[Path]]:
    """Write the model file and the records, with units as a measuring system would."""
    hidden = make_hidden_effect(golf_robot(), HIDDEN, **SIZES, random_state=0)
    folder.mkdir(parents=True, exist_ok=True)
    model, prior = folder / "golf_robot.yaml", hidden.prior
    rounded = {name: float(f"{p.value:.4g}") for name, p in prior.parameters.items()}
    prior.with_parameters(**rounded).to_yaml(model)  # as on a data sheet
    names, paths = [*prior.inputs, *prior.outputs], []
    titles = {"t": "t [s]", **{name: f"{name} [{prior.unit(name)}]" for name in names}}
    table = hidden.X[["trajectory", "t", *prior.inputs]].join(hidden.y)
    for number, rows in table.groupby("trajectory"):
        paths.append(folder / f"record_{number + 1}.csv")
        rows = rows.drop(columns="trajectory").rename(columns=titles)
        rows.to_csv(paths[-1], index=False, float_format="%.6g")
    return model, paths


def _print_task(model: Path, data: list[Path]) -> None:
    click.echo(
        f"A golf robot, a driven pendulum, was simulated with stick-slip in its bearing: "
        f"{len(data)} records of {SIZES['duration']:g} s.\n"
        f"Its model lacks the stick-slip, and its parameters are some percent off.\n"
        f"Model file and records are in {one_line(model.parent)}.\n"
    )


def _print_truth(model: Path, output: FilePath) -> None:
    fields = {"level": "N m", "peak": "N m", "velocity": "rad/s"}
    truth = ", ".join(f"{name} {getattr(HIDDEN, name):g} {unit}" for name, unit in fields.items())
    command = (
        f"sklearn-pgnn diagnose --model {shlex.quote(str(model))} "
        f"{shlex.quote(str(model.parent))}/record_*.csv --output {shlex.quote(str(output))} "
        f"--force"
    )
    click.echo(f"\nWhat was hidden: stick-slip with {truth}.\nThe same as a command:\n  {command}")
