"""The job of ``sklearn-pgnn fit``: the free parameters of a model file, fitted to records."""

from collections.abc import Iterable, Sequence
from typing import Any

import click
import numpy as np

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.cli.inputs import read_model_and_records, read_noise, split
from sklearn_pgnn.cli.tables import change, heading, print_table, say, screen
from sklearn_pgnn.estimation.plain_data import plain
from sklearn_pgnn.estimators import PhysicsModelRegressor
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.inspection.numbers import fit_text, measured, number
from sklearn_pgnn.inspection.result_files import as_strict_json
from sklearn_pgnn.inspection.runs import fit_percentage, run_records
from sklearn_pgnn.priors.robot_section import described_in, robot_text
from sklearn_pgnn.trajectories import read_records


class FitJob:
    """A model file fitted to files of records; `options` are those of `PhysicsModelRegressor`."""

    def __init__(
        self,
        model: FilePath,
        data: Sequence[FilePath],
        *,
        free_run: bool,
        free: Iterable[str],
        noise: Sequence[str],
        sample_time: float | None = None,
        **options: Any,
    ):
        self.source = model
        self.prior, self.X, self.y = read_model_and_records(model, data, sample_time)
        names, known = split(free), self.prior.parameters
        for name in names:
            if name not in known:
                raise OptionError(
                    f"--free: expected parameters of the model ({', '.join(known) or 'none'}), "
                    f"got {name!r}."
                )
        if free_run:
            options["window_length"] = "trajectory"
        options["noise_std"] = read_noise(noise, list(self.prior.outputs))
        self.regressor = PhysicsModelRegressor(self.prior, free=names or None, **options)

    def run(self) -> None:
        """Fit, and simulate the model before and after."""
        self.regressor.fit(self.X, self.y)
        records = read_records(self.prior, self.X, self.y)
        y = np.concatenate([record.y for record in records])
        told = {"hold": self.regressor.hold, "substeps": self.regressor.substeps}
        self.fits = {
            which: fit_percentage(
                y, np.concatenate([r.y for r in run_records(model, records, **told)])
            )
            for which, model in (("as given", self.prior), ("fitted", self.regressor.model_))
        }

    def text(self, output: str) -> str:
        """Return the fitted model as a model file; of a robot it names the description."""
        found = self.regressor.model_
        if described_in(self.source) is not None:
            return robot_text(found, self.source, output)
        return found.to_yaml()

    def to_dict(self) -> dict:
        """Return what was fitted as plain data."""
        outputs = list(self.prior.outputs)
        return {
            "parameters": {
                name: {"prior": self.prior.parameters[name].value, **plain(found)}
                for name, found in self.regressor.parameters_.items()
            },
            "fit_percent": {
                which: dict(zip(outputs, fit.tolist(), strict=True))
                for which, fit in self.fits.items()
            },
            "window": self.regressor.window_,
            "hold": self.regressor.hold_,
            "substeps": self.regressor.substeps_,
            "method": self.regressor.method_,
        }

    def print_summary(self, output: str, *, as_json: bool, quiet: bool) -> None:
        """Print what was fitted."""
        if as_json:
            click.echo(as_strict_json(self.to_dict()), nl=False)
            return
        console = screen()
        say(console, "Fit in free run (100 % is perfect)", "bold")
        fits = (
            (name, *(fit_text(fit[i], 1) for fit in self.fits.values()))
            for i, name in enumerate(self.prior.outputs)
        )
        print_table(console, ("", "as given", "fitted"), fits)
        if quiet:
            return
        heading(console, "Parameters (95 % interval)")
        given = {name: p.value for name, p in self.prior.parameters.items()}
        rows = (
            (
                name,
                number(given[name]),
                measured(e.value, e.low, e.high, e.unit),
                change(e.value, given[name]),
            )
            for name, e in self.regressor.parameters_.items()
        )
        print_table(console, ("", "as given", "fitted", "change"), rows)
        heading(console, "Written")
        console.print(f"  {one_line(output)}  (the fitted model; a model file again)")
