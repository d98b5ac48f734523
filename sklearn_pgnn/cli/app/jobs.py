"""What a visitor's process does: models, columns, a look, a diagnosis. It works in its folder."""

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from sklearn_pgnn.annotations import Table
from sklearn_pgnn.cli.app.columns import read_mapped, seen_columns, with_kinds
from sklearn_pgnn.cli.app.page import render
from sklearn_pgnn.cli.diagnose import fit_kept, write_results
from sklearn_pgnn.cli.guard import Bug
from sklearn_pgnn.cli.inputs import read_search
from sklearn_pgnn.cli.options import SYSTEMS, make_system
from sklearn_pgnn.cli.screen import described_files
from sklearn_pgnn.cli.template import commented
from sklearn_pgnn.datasets import make_cart
from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.exceptions import ModelError, ModelWarning, RecordWarning
from sklearn_pgnn.inspection.equations import equations_of
from sklearn_pgnn.inspection.first_look import FirstLook, SeenRecord, first_look, told_table
from sklearn_pgnn.inspection.numbers import fit_text, number, typeset_unit
from sklearn_pgnn.inspection.report import Provenance, SourceFile
from sklearn_pgnn.inspection.report.curves_section import in_sight, input_plot
from sklearn_pgnn.inspection.report.finding import next_step, title, verdict_line
from sklearn_pgnn.inspection.report.tiles import make_tiles, worst
from sklearn_pgnn.inspection.runs import run_records
from sklearn_pgnn.inspection.style import label
from sklearn_pgnn.inspection.svg import Plot, Scale
from sklearn_pgnn.inspection.words import verdict_sentence
from sklearn_pgnn.physics.effects import CoulombFriction
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_file import robot_in
from sklearn_pgnn.record_quality.identifiability import identifiability
from sklearn_pgnn.simulation.simulate import Simulation
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.record import Record

MODEL, NEW = Path("model.yaml"), Path("new_model.yaml")
RESULT, LOOK = Path("result"), Path("look.html")
#: hidden effect of the example's cart, and the number of its records
FRICTION, RECORDS = CoulombFriction("v", level=1.0), 4
_HEADER = {"t": "t [s]", "force": "force [N]", "position": "position [m]"}


def draw_look(model: PhysicsModel, X: Table, y: Table, warned: Sequence[str] = ()) -> str:
    """Return how the model as given follows the records: warnings, a table, and every record."""
    seen, told = first_look(model, X, y), identifiability(model, X, y)
    records = read_records(model, X, y)
    runs = run_records(model, records)
    return render(
        "look.html.j2",
        warnings=[*warned, *seen.warnings],
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
        told=told_table(told),
        remarks=told.remarks,
        records=[
            {
                "name": r.name,
                "about": f"{r.samples} samples, {number(r.duration, 3)} s{_fits(r, seen)}",
                "plots": _plots(model, record, run),
            }
            for r, record, run in zip(seen.records, records, runs, strict=True)
        ],
    )


def _fits(record: SeenRecord, seen: FirstLook) -> str:
    """Return the fit of one record among several, by output; of one, the table tells."""
    if len(seen.records) == 1:
        return ""
    fits = ", ".join(f"{fit_text(fit)} of {name}" for name, fit in record.fit.items())
    return f", fit {fits}"


def _plots(model: PhysicsModel, record: Record, run: Simulation) -> list[tuple[str, Markup]]:
    """Return the plots of a record: every output, measured and simulated, then the inputs."""
    x = Scale.over(record.t, room=0)
    plots = []
    for i, name in enumerate(model.outputs):
        y, simulated = np.asarray(record.y)[:, i], run.y[:, i]
        plot = Plot(x, in_sight(y, [simulated]), f"{name} measured and simulated", "medium")
        plot.line(record.t, y, "measured", "measured")
        plot.line(record.t, simulated, "prior", "model as given")
        plots.append((label(name, model.unit(name)), plot.html()))
    for i, name in enumerate(model.inputs):
        plots.append(input_plot(record.t, record.u[:, i], name, model.unit(name)))
    return plots


def take_model(progress: Callable, label: str) -> dict:
    """Accept the new model file, if it is valid, and return its content."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ModelWarning)
        try:
            if (robot := robot_in(NEW)) is not None:
                raise ModelError(
                    f"{NEW}: expected a model that is whole, got one of a robot in "
                    f"{robot['file']!r}. Remedy: sklearn-pgnn diagnose --model MODEL.yaml, where "
                    f"both files are."
                )
            model = PhysicsModel.from_yaml(NEW)
        except ModelError as error:
            raise ModelError(str(error).replace(str(NEW), label)) from error
    os.replace(NEW, MODEL)
    said = [str(w.message) for w in told if issubclass(w.category, ModelWarning)]
    return _told_model(model, label, [text.replace(str(NEW), label) for text in said])


def take_system(progress: Callable, system: str) -> dict:
    """Write the model file of a ready system, and return its content."""
    if system not in SYSTEMS:
        raise ModelError(f"expected one of the systems {', '.join(SYSTEMS)}, got {system!r}.")
    model = make_system(system)
    MODEL.write_text(commented(model), encoding="utf-8")
    return _told_model(model, f"{system}.yaml", [])


def make_example(progress: Callable) -> dict:
    """Write the model and the records of a cart with friction that its model lacks."""
    made = make_cart(RECORDS, effect=FRICTION, sample_rate=100, parameter_error=0)
    rows = made.X[["trajectory", "t", "force"]].join(made.y).round(5)
    names = []
    for place, (_, record) in enumerate(rows.groupby("trajectory"), start=1):
        table = record[["t", "force", "position"]].rename(columns=_HEADER)
        table.to_csv(f"{place}.csv", index=False)
        names.append(f"cart_{place}.csv")
    return {"model": take_system(progress, "cart-on-spring"), "files": names}


def _told_model(model: PhysicsModel, label: str, said: Sequence[str]) -> dict:
    """Return the data of a model for display."""
    return {
        "label": label,
        "text": MODEL.read_text(encoding="utf-8"),
        "name": model.name,
        "parts": {
            part: [_with_unit(name, model.unit(name)) for name in getattr(model, part)]
            for part in ("states", "inputs", "outputs")
        },
        "parameters": [
            f"{name} = {number(p.value)} {typeset_unit(p.unit)}".rstrip()
            for name, p in model.parameters.items()
        ],
        "equations": [[e.mathml, e.text] for e in equations_of(model, model)],
        "warnings": list(said),
    }


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{typeset_unit(unit)}]" if typeset_unit(unit) else name


def show_columns(progress: Callable, files: Sequence[Mapping]) -> dict:
    """Return the names of the files' columns, and the quantity that each may be."""
    return seen_columns(PhysicsModel.from_yaml(MODEL), files)


def _read(files: Sequence[Mapping], mapping: Mapping) -> tuple:
    """Return the model and the records as they were mapped."""
    model = with_kinds(PhysicsModel.from_yaml(MODEL), mapping)
    return model, *read_mapped(model, files, mapping)


def look(
    progress: Callable, files: Sequence[Mapping], mapping: Mapping, options: Mapping[str, Any]
) -> dict:
    """Plot the records together with the model as given."""
    progress("reading the records")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", RecordWarning)
        model, X, y = _read(files, mapping)
    warned = [str(each.message) for each in told if issubclass(each.category, RecordWarning)]
    progress("simulating the model as given, and fitting it")
    LOOK.write_text(draw_look(model, X, y, warned), encoding="utf-8")
    return {}


def diagnose(
    progress: Callable,
    files: Sequence[Mapping],
    mapping: Mapping,
    options: Mapping[str, Any],
    label: str,
) -> dict:
    """Diagnose, write the files of the result, and return the data for display."""
    progress("reading the model and the records")
    model, X, y = _read(files, mapping)
    known = dict(options)
    diagnosis = ModelDiagnosis(model, progress=progress, **read_search(model, known), **known)
    broken, warned = fit_kept(diagnosis, X, y)
    progress("writing the report")
    RESULT.mkdir(exist_ok=True)
    for file in RESULT.iterdir():
        file.unlink()
    data = tuple(SourceFile(file["label"], file["sha256"]) for file in files)
    source = Provenance(SourceFile(label, SourceFile.read(MODEL).sha256), data, "sklearn-pgnn app")
    error = broken or write_results(RESULT, diagnosis, source)
    return {
        "title": title(diagnosis),
        "verdict": verdict_line(diagnosis),
        "sentence": verdict_sentence(diagnosis),
        "next": next_step(diagnosis),
        "state": worst(make_tiles(diagnosis)),
        "files": list(described_files(diagnosis).items()),
        "warnings": warned if error is None else [*warned, Bug(error).message],
    }


JOBS: dict[str, Callable] = {
    "model": take_model,
    "system": take_system,
    "example": make_example,
    "columns": show_columns,
    "look": look,
    "diagnose": diagnose,
}
