"""The records together with the model as given, as a part of a page."""

import numpy as np
from markupsafe import Markup

from sklearn_pgnn.cli.app.render import render
from sklearn_pgnn.inspection.first_look import first_look
from sklearn_pgnn.inspection.numbers import fit_text, number, typeset_unit
from sklearn_pgnn.inspection.start_runs import run_records
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.inspection.svg import Plot, Scale
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories import read_records

#: a simulation that exceeds the record by more than this multiple of its range is clipped
SIGHT = 1.0


def draw_look(model: PhysicsModel, X, y) -> str:
    """Return how the model as given follows the records: warnings, a table, and every record."""
    seen = first_look(model, X, y)
    records = read_records(model, X, y)
    runs = run_records(model, records)
    return render(
        "look.html.j2",
        warnings=seen.warnings,
        fits=[
            {
                "name": o.output,
                "fit": fit_text(o.fit),
                "error": number(o.error, 3),
                "noise": number(o.noise, 3),
                "unit": typeset_unit(o.unit) or "-",
            }
            for o in seen.outputs
        ],
        records=[
            {
                "name": r.name,
                "about": f"{r.samples} samples, {number(r.duration, 3)} s{_fits(r, seen)}",
                "plots": _plots(model, record, run),
            }
            for r, record, run in zip(seen.records, records, runs, strict=True)
        ],
    )


def _fits(record, seen) -> str:
    """Return the fit of one record among several, by output; of one, the table tells."""
    if len(seen.records) == 1:
        return ""
    fits = ", ".join(f"{fit_text(fit)} of {name}" for name, fit in record.fit.items())
    return f", fit {fits}"


def _plots(model: PhysicsModel, record, run) -> list[tuple[str, Markup]]:
    """Return the plots of a record: every output, measured and simulated, then the inputs."""
    x = Scale.over(record.t, room=0)
    plots = []
    for i, name in enumerate(model.outputs):
        y, simulated = record.y[:, i], run.y[:, i]
        plot = Plot(x, _in_sight(y, simulated), f"{name} measured and simulated", "medium")
        plot.line(record.t, y, "measured", "measured")
        plot.line(record.t, simulated, "prior", "model as given")
        plots.append((label(name, model.unit(name)), plot.html()))
    for i, name in enumerate(model.inputs):
        plot = Plot(x, Scale.over(record.u[:, i]), f"input {name}", "low")
        plot.line(record.t, record.u[:, i], "input", name)
        plots.append((label(name, model.unit(name)), plot.html()))
    return plots


def _in_sight(y, simulated) -> Scale:
    low, high = np.nanmin(y), np.nanmax(y)
    reach = SIGHT * ((high - low) or 1.0)
    return Scale.over(y, np.clip(simulated, low - reach, high + reach))
