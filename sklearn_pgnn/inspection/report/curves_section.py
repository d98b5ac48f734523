"""Curves of every record: measured and simulated, the errors on their own scale, the inputs."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from markupsafe import Markup

from sklearn_pgnn.diagnosis.free_run import free_runs
from sklearn_pgnn.inspection.display import called
from sklearn_pgnn.inspection.numbers import fit_text
from sklearn_pgnn.inspection.runs import fit_percentage
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.inspection.svg import Plot, Scale
from sklearn_pgnn.inspection.yardstick import MODELS, ToldError, shown_models, told_error

#: the band of the noise, in standard deviations; and from how many on an error is marked
BAND, FAR = 2.0, 8.0
#: a record in which an output moves by less than this share of its farthest is quiet
QUIET = 0.1
#: class and name of what was measured, for a legend
MEASURED = ("measured", "measured")


def curve_sections(diagnosis) -> dict:
    """Return the curves that tell most, those of their record in full, and of all others."""
    records, drawn, told = diagnosis.records_, shown_models(diagnosis), told_error(diagnosis)
    windowed = {which: records.windows.y - records.fits[which].residual for which in drawn}
    free = {which: np.concatenate([r.y for r in free_runs(records, which)]) for which in drawn}
    *others, (best, said) = drawn.items()
    legend = [MEASURED, *others, (f"{best} best", said)]
    first = _missed_most(diagnosis, told, free if told.is_free else windowed)
    return {
        "telling": _telling(diagnosis, told, free if told.is_free else windowed, first),
        "windowed": _curves(diagnosis, windowed, first, restarts=True),
        "free_run": _curves(diagnosis, free, first),
        "other_records": [
            _curves(diagnosis, free, k) for k in range(len(records.names)) if k != first
        ],
        "curve_keys": legend,
    }


def _missed_most(diagnosis, told: ToldError, simulated: Mapping) -> int:
    """Return the record that the model as given fits worst, of those in which the output moves."""
    windows, i = diagnosis.records_.windows, list(diagnosis.model.outputs).index(told.output)
    y, run = windows.y[:, i], simulated["prior"][:, i]
    rows = [slice(*ends) for ends in pairwise(windows.bounds)]
    reach = np.nan_to_num([np.fmax.reduce(y[each]) - np.fmin.reduce(y[each]) for each in rows])
    fits = [float(fit_percentage(y[each], run[each])[0]) for each in rows]
    moves = (reach >= QUIET * reach.max()) & ~np.isnan(fits)
    return int(np.argmin(np.where(moves, fits, np.inf)))


def _telling(diagnosis, told: ToldError, simulated: Mapping, record: int) -> dict:
    """Return one output of a record: measured, as given, and with all found, with their fits."""
    windows, i = diagnosis.records_.windows, list(diagnosis.model.outputs).index(told.output)
    rows = slice(windows.bounds[record], windows.bounds[record + 1])
    t, y, (best, run) = windows.t[rows], windows.y[rows, i], list(simulated.items())[-1]
    runs = {"prior": simulated["prior"][rows, i], f"{best} best": run[rows, i]}
    fits = (fit_text(float(fit_percentage(y, run)[0]), 1) for run in runs.values())
    said = (MODELS["prior"], MODELS[best])
    named = [(css, f"{who}, fit {fit}") for css, who, fit in zip(runs, said, fits, strict=True)]
    title = called(diagnosis.records_.names[record], record, len(diagnosis.records_.names))
    about = f"{told.output} of {title}: measured; {'; '.join(said for _, said in named)}"
    plot = Plot(Scale.over(t, room=0), in_sight(y, runs.values()), about, "telling")
    plot.line(t, y, "measured", "measured")
    for css, text in named:
        plot.line(t, runs[css], css, text)
    shown = [(label(told.output, told.unit), plot.html())]
    return {"title": title, "is_free": told.is_free, "legend": [MEASURED, *named], "plots": shown}


def _curves(diagnosis, simulated: Mapping, record: int, *, restarts: bool = False) -> dict:
    """Return the curves of a record: its title, and every plot with what is drawn.

    `simulated` has, by the model's key in `MODELS`, its outputs on all records, end to end.
    """
    names, model, windows = diagnosis.records_.names, diagnosis.model, diagnosis.records_.windows
    rows, plots = slice(windows.bounds[record], windows.bounds[record + 1]), []
    for i, name in enumerate(model.outputs):
        t, y, noise = windows.t[rows], windows.y[rows, i], diagnosis.gain_[name].noise
        runs = {which: run[rows, i] for which, run in simulated.items()}
        *_, best = runs.values()
        title = f"{name} measured and simulated"
        curves = Plot(Scale.over(t, room=0), in_sight(y, runs.values()), title)
        if restarts:
            _shade_windows(curves, windows, record)
        for low, high in _gaps(t, y):
            curves.shade(low, high, "gap", "nothing was measured")
        alone = _single(y - best) > FAR * noise
        if restarts and alone.any():
            title = "a single sample that lies far off"
            curves.points(t[alone], y[alone], "outlier", title)
        plots += _draw(curves, t, y, runs, noise, name, model.unit(name))
    for i, name in enumerate(model.inputs):
        plots.append(input_plot(windows.t[rows], windows.u[rows, i], name, model.unit(name)))
    return {"title": called(names[record], record, len(names)), "plots": plots}


def _draw(curves: Plot, t, y, runs: Mapping, noise: float, name: str, unit: str) -> list[tuple]:
    """Draw an output as measured and simulated, and the errors on a scale of their own."""
    *_, best = runs
    errors = Plot(curves.x, _of_errors(y - runs[best], noise), f"error of {name}", "low")
    errors.band(-BAND * noise, BAND * noise, "noise-band", "two standard deviations of noise")
    curves.line(t, y, "measured", "measured")
    for which, run in runs.items():
        css = f"{which} best" if which == best else which
        curves.line(t, run, css, MODELS[which])
        errors.line(t, y - run, css, f"error {MODELS[which]}")
    shown = label(name, unit), label(f"error of {name}", unit)
    return list(zip(shown, (curves.html(), errors.html()), strict=True))


def _shade_windows(plot: Plot, windows, record: int) -> None:
    """Shade every second window."""
    own = np.flatnonzero(windows.record == record)[::2]
    for start, length in zip(windows.starts[own], windows.lengths[own], strict=True):
        ends = windows.t[start], windows.t[start + length - 1]
        plot.shade(*ends, "window", "a window")


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
