"""Curves of every record: measured and simulated, the errors on their own scale, the inputs."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from sklearn_pgnn.diagnosis.free_run import free_runs
from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis
from sklearn_pgnn.inspection.display import called, typical
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.inspection.svg import Plot, Scale
from sklearn_pgnn.inspection.yardstick import MODELS, shown_models

#: the band of the noise, in standard deviations; and from how many on an error is marked
BAND, FAR = 2.0, 8.0


@dataclass(frozen=True)
class CurveDrawer:
    """Draws records and what models make of them.

    `simulated` has, by the model's key in `MODELS`, its outputs on all records, end to end, of
    shape (n_samples, n_outputs); `restarts` is whether the models restart on every window.
    """

    diagnosis: ModelDiagnosis
    simulated: Mapping[str, np.ndarray]
    restarts: bool

    @property
    def best(self) -> str:
        """The model whose error is shown: the last."""
        return list(self.simulated)[-1]

    def _css(self, which: str) -> str:
        return f"{which} best" if which == self.best else which

    def draw(self, record: int) -> dict:
        """Return the curves of a record: its title, and every plot with what is drawn."""
        names, model, rows = self.diagnosis.records_.names, self.diagnosis.model, self._rows(record)
        windows = self.diagnosis.records_.windows
        plots = [plot for i in range(len(model.outputs)) for plot in self._output(record, i)]
        for i, name in enumerate(model.inputs):
            plots.append(input_plot(windows.t[rows], windows.u[rows, i], name, model.unit(name)))
        return {"title": called(names[record], record, len(names)), "plots": plots}

    def _rows(self, record: int) -> slice:
        bounds = self.diagnosis.records_.windows.bounds
        return slice(bounds[record], bounds[record + 1])

    def _output(self, record: int, column: int) -> list[tuple[str, Markup]]:
        model, rows = self.diagnosis.model, self._rows(record)
        windows, name = self.diagnosis.records_.windows, list(model.outputs)[column]
        t, y = windows.t[rows], windows.y[rows, column]
        runs = {which: run[rows, column] for which, run in self.simulated.items()}
        title = f"{name} measured and simulated"
        curves = Plot(Scale.over(t, room=0), in_sight(y, runs.values()), title)
        self._mark(curves, record, y, y - runs[self.best], name)
        curves.line(t, y, "measured", "measured")
        for which, run in runs.items():
            curves.line(t, run, self._css(which), MODELS[which])
        noise = self.diagnosis.gain_[name].noise
        best = y - runs[self.best]
        errors = Plot(curves.x, _of_errors(best, noise), f"error of {name}", "low")
        errors.band(-BAND * noise, BAND * noise, "noise-band", "two standard deviations of noise")
        for which, run in runs.items():
            errors.line(t, y - run, self._css(which), f"error {MODELS[which]}")
        unit = model.unit(name)
        return [
            (label(name, unit), curves.html()),
            (label(f"error of {name}", unit), errors.html()),
        ]

    def _mark(self, plot: Plot, record: int, y, error, name: str) -> None:
        """Shade every second window, and mark gaps and samples that lie far off."""
        rows, windows = self._rows(record), self.diagnosis.records_.windows
        t, own = windows.t, np.flatnonzero(windows.record == record)
        if self.restarts:
            for start, length in zip(
                windows.starts[own][::2], windows.lengths[own][::2], strict=True
            ):
                plot.shade(t[start], t[start + length - 1], "window", "a window")
        for low, high in _gaps(t[rows], y):
            plot.shade(low, high, "gap", "nothing was measured")
        alone = _single(error) > FAR * self.diagnosis.gain_[name].noise
        if self.restarts and alone.any():
            plot.points(t[rows][alone], y[alone], "outlier", "a single sample that lies far off")


def curve_sections(diagnosis) -> tuple[dict, dict, list[dict]]:
    """Return the curves of a typical record in free run and over windows, then all others."""
    records, drawn = diagnosis.records_, shown_models(diagnosis)
    windowed = {which: records.windows.y - records.fits[which].residual for which in drawn}
    free = {which: np.concatenate([r.y for r in free_runs(records, which)]) for which in drawn}
    first = typical(records)
    runs = CurveDrawer(diagnosis, free, restarts=False)
    others = [runs.draw(k) for k in range(len(records.names)) if k != first]
    return runs.draw(first), CurveDrawer(diagnosis, windowed, restarts=True).draw(first), others


def keys(diagnosis) -> list[tuple[str, str]]:
    """Return the class and the name of every curve, for a legend."""
    *others, (best, said) = shown_models(diagnosis).items()
    return [("measured", "measured"), *others, (f"{best} best", said)]


def input_plot(t, u, name: str, unit: str) -> tuple[str, Markup]:
    """Return the name of an input with its unit, and its plot."""
    plot = Plot(Scale.over(t, room=0), Scale.over(u), f"input {name}", "low")
    plot.line(t, u, "input", name)
    return label(name, unit), plot.html()


def in_sight(known, curves) -> Scale:
    """Return an axis on which a diverging model does not hide the rest."""
    if not np.isfinite(known).any():  # this record lacks the output
        return Scale.over(*curves)
    low, high = np.nanmin(known), np.nanmax(known)
    reach = (high - low) or 1.0
    return Scale.over(*(np.clip(each, low - reach, high + reach) for each in (known, *curves)))


def _of_errors(error, noise: float) -> Scale:
    """Return an axis for the errors of the best model, single samples left out, and the noise."""
    known = error[np.isfinite(error)]
    most = np.percentile(np.abs(known), 99.5) if known.size else 0.0
    reach = 1.2 * max(float(most), 1.5 * BAND * noise) or 1.0
    return Scale(-reach, reach)


def _gaps(t, y):
    """Return the ends of the stretches in which nothing was measured."""
    missing = np.concatenate([[False], ~np.isfinite(y), [False]])
    starts, ends = (np.flatnonzero(np.diff(missing.astype(int)) == step) for step in (1, -1))
    return [(t[max(a - 1, 0)], t[min(b, t.size - 1)]) for a, b in zip(starts, ends, strict=True)]


def _single(error) -> np.ndarray:
    """Return by how much every sample's error exceeds those of its neighbours."""
    size = np.abs(np.nan_to_num(error))
    beside = np.concatenate([[0.0], size, [0.0]])
    found = size - np.maximum(beside[:-2], beside[2:])
    return np.where(np.isfinite(error), found, 0.0)
