"""The job of ``sklearn-pgnn detect``: how large an effect must be before the records show it."""

from collections.abc import Callable

import click

from sklearn_pgnn.cli.inputs import (
    check_candidates,
    choose_effects,
    choose_targets,
    read_model_and_records,
    read_noise,
)
from sklearn_pgnn.cli.tables import cell, print_table, say, screen, table, warn
from sklearn_pgnn.diagnosis import Detectability, ModelDiagnosis
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import least_size
from sklearn_pgnn.inspection.result_files import as_strict_json


class DetectJob:
    """The detectability of effects in files of records.

    `power` is the probability with which an effect should be named; for the words of `noise`,
    `catalogue`, `exclude` and `targets` see `sklearn_pgnn.cli.inputs`. The sample time [s] is that
    of files without a time; `options` are those of `ModelDiagnosis`.
    """

    def __init__(
        self, model, data, *, power, noise, catalogue, exclude, targets, sample_time=None, **options
    ):
        read, self.X, self.y = read_model_and_records(model, data, sample_time)
        self.power, self.effects = power, choose_effects(catalogue, exclude)
        self.targets = choose_targets(targets, read)
        check_candidates(read, self.effects, self.targets)
        self.diagnosis = ModelDiagnosis(
            read, catalogue=(), noise_std=read_noise(noise, list(read.outputs)), **options
        )

    def run(self, progress: Callable) -> Detectability:
        """Re-tune the model, and add every effect to it."""
        self.diagnosis.set_params(progress=progress).fit(self.X, self.y)
        return self.diagnosis.detectability(self.effects, self.targets, power=self.power)

    def print_summary(self, found: Detectability, *, as_json: bool, quiet: bool) -> None:
        """Print the smallest sizes."""
        if as_json:
            rows = found.to_frame().to_dict("records")
            click.echo(as_strict_json({"power": found.power, "effects": rows}), nl=False)
            return
        console = screen()
        if not quiet:
            warn(console, self._reservations())
        say(console, f"Named with probability {100 * found.power:.0f} % from this size on", "bold")
        seen = [row for row in found.rows if not row.reason]
        rows = table("", "", "")
        for row in seen:
            size = least_size(row, 3)
            what = row.parameter.replace("_", " ")
            rows.add_row(cell(cause_name(row.effect, row.target)), cell(what), cell(size))
        print_table(console, rows)
        never = [row for row in found.rows if row.reason]
        if quiet or not never:
            return
        console.print()
        say(console, "Without a smallest size in these records", "bold")
        rows = table("", "")
        for row in never:
            rows.add_row(cell(cause_name(row.effect, row.target)), cell(row.reason))
        print_table(console, rows)

    def _reservations(self) -> list[str]:
        """Return that a model which leaves more than noise hides more."""
        if self.diagnosis.remaining_.kind == "noise":
            return []
        return [
            "The re-tuned model leaves more than noise, which counts as noise here. Remedy: "
            "diagnose first, and take the resulting extended_model.yaml."
        ]
