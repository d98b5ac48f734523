"""The job of ``sklearn-pgnn detect``: how large an effect must be before the records show it."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import click

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.cli.inputs import (
    check_candidates,
    choose_effects,
    choose_targets,
    read_model_and_records,
    read_noise,
)
from sklearn_pgnn.cli.tables import print_table, say, screen
from sklearn_pgnn.diagnosis import Detectability, ModelDiagnosis
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import least_size
from sklearn_pgnn.inspection.result_files import as_strict_json
from sklearn_pgnn.physics.effects.differences import DIFFERENCES

#: what a model that leaves structure hides
HIDES = (
    "The re-tuned model leaves more than noise, which counts as noise here. Remedy: diagnose "
    "first, and take the resulting extended_model.yaml."
)


class DetectJob:
    """The detectability of effects in files of records; `options` are those of `ModelDiagnosis`."""

    def __init__(
        self,
        model: FilePath,
        data: Sequence[FilePath],
        *,
        power: float,
        noise: Sequence[str],
        catalogue: Iterable[str],
        exclude: Iterable[str],
        targets: Iterable[str],
        sample_time: float | None = None,
        **options: Any,
    ):
        read, self.X, self.y = read_model_and_records(model, data, sample_time)
        self.power, self.effects = power, choose_effects(catalogue, exclude)
        self.differences = () if tuple(catalogue) else DIFFERENCES
        self.targets = choose_targets(targets, read)
        check_candidates(read, self.effects, self.targets)
        self.diagnosis = ModelDiagnosis(
            read, catalogue=(), noise_std=read_noise(noise, list(read.outputs)), **options
        )

    def run(self, progress: Callable) -> Detectability:
        """Re-tune the model, and add every effect to it."""
        self.diagnosis.set_params(progress=progress).fit(self.X, self.y)
        effects = (*self.effects, *self.differences)
        return self.diagnosis.detectability(effects, self.targets, power=self.power)

    def print_summary(self, found: Detectability, *, as_json: bool, quiet: bool) -> None:
        """Print the smallest sizes."""
        if as_json:
            rows = found.to_frame().to_dict("records")
            click.echo(as_strict_json({"power": found.power, "effects": rows}), nl=False)
            return
        console = screen()
        if not quiet and self.diagnosis.remaining_.kind != "noise":
            say(console, HIDES, "yellow")
        say(console, f"Named with probability {100 * found.power:.0f} % from this size on", "bold")
        seen = (
            (cause_name(r.effect, r.target), r.parameter.replace("_", " "), least_size(r, 3))
            for r in found.rows
            if not r.reason
        )
        print_table(console, ("", "", ""), seen)
        never = [(cause_name(r.effect, r.target), r.reason) for r in found.rows if r.reason]
        if never and not quiet:
            console.print()
            say(console, "Without a smallest size in these records", "bold")
            print_table(console, ("", ""), never)
