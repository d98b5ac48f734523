"""The report as HTML, and where it goes."""

import base64
import os
import platform
import re
import tempfile
from datetime import date
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.inspection.case import known_effects
from sklearn_pgnn.inspection.display import compare, draw_comparison, draw_evidence
from sklearn_pgnn.inspection.equations import equations_of
from sklearn_pgnn.inspection.evidence import find_evidence, missing_evidence
from sklearn_pgnn.inspection.report.finding import title, verdict_line
from sklearn_pgnn.inspection.report.next_step import next_step
from sklearn_pgnn.inspection.report.provenance import Provenance
from sklearn_pgnn.inspection.report.tiles import make_tiles, worst
from sklearn_pgnn.inspection.report.who_did_what import segments_of_bar
from sklearn_pgnn.inspection.style import new_figure, to_png
from sklearn_pgnn.inspection.words import (
    cause_name,
    chance,
    free_run_error,
    left_alone,
    measured,
    number,
    percent,
    remaining_sentence,
    rivals,
    separation_sentence,
    share,
    suspect_name,
    typeset_unit,
    unusable_sentence,
    verdict_sentence,
)

TEMPLATES = "templates"
LIBRARIES = ("numpy", "scipy", "sympy", "numba", "scikit-learn")
#: a hyphen that is a minus: before a number, and neither in a word nor in a range
MINUS = re.compile(r"(?<![\w)\]])-(?=[\d.])")


def write_report(diagnosis, path, provenance: Provenance | None = None) -> None:
    """Write the report of a diagnosis.

    The file contains its pictures and styles and loads nothing else. It is written whole or
    not at all.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        The fitted diagnosis.
    path : str or path-like
        Where to write.
    provenance : Provenance, optional
        Files, command and day, to be stated.
    """
    check_is_fitted(diagnosis)
    _write_whole(Path(path), render_report(diagnosis, provenance))


def render_report(diagnosis, provenance: Provenance | None = None) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        The fitted diagnosis.
    provenance : Provenance, optional
        Files, command and day, to be stated; the same report is written again from the same
        diagnosis if the day is told.

    Returns
    -------
    str
        The HTML text; names and units of the model are escaped.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    room = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(_source),
        finalize=_with_minus_signs,
    )
    room.filters["capitalize_first"] = lambda text: text[:1].upper() + text[1:]
    room.filters["as_it_is"] = _as_it_is
    content = report_content(diagnosis, provenance or Provenance())
    return room.get_template("report.html.j2").render(**content, style=_source("style.css"))


def _source(name: str) -> str:
    folder = files("sklearn_pgnn.inspection.report").joinpath(TEMPLATES)
    return folder.joinpath(name).read_text(encoding="utf-8")


def _with_minus_signs(value):
    """Return a text with minus signs in place of hyphens before numbers."""
    return MINUS.sub("\u2212", value) if type(value) is str else value


def _as_it_is(text):
    """Escape a text whose hyphens stay what they are, to be copied."""
    from markupsafe import escape

    return escape(text)


def report_content(diagnosis, provenance: Provenance) -> dict:
    """Return the content of the report: plain text by the template's variable."""
    tiles = make_tiles(diagnosis)
    return {
        "model": diagnosis.model.name,
        "title": title(diagnosis),
        "state": worst(tiles),
        "verdict_title": verdict_line(diagnosis),
        "sentence": verdict_sentence(diagnosis),
        "remaining": remaining_sentence(diagnosis),
        "tiles": tiles,
        "bar": segments_of_bar(diagnosis),
        "next_step": next_step(diagnosis),
        "provenance": provenance,
        "records": _records(diagnosis),
        "data_quality": diagnosis.data_quality_,
        "causes": [_cause(diagnosis, cause) for cause in diagnosis.causes_],
        "comparisons": [_comparison(diagnosis, kind) for kind in ("free_run", "windows")],
        "evidence": _all_evidence(diagnosis),
        "gain": [_gain(name, gain) for name, gain in diagnosis.gain_.items()],
        "free_run": [_free_run(diagnosis, output) for output in diagnosis.free_run_],
        "parameters": [_parameter(name, p) for name, p in diagnosis.parameters_.items()],
        "equation_blocks": _equation_blocks(diagnosis),
        "tried": _tried(diagnosis),
        "complete": diagnosis.complete_,
        "unusable": [
            {"name": suspect_name(effect, target), "reason": reason}
            for effect, target, reason in diagnosis.unusable_
        ],
        "unusable_sentence": unusable_sentence(diagnosis),
        "method": _method(diagnosis),
        "versions": _versions(),
        "date": provenance.date or date.today().isoformat(),
    }


# -- what is said ----------------------------------------------------------------------------------


def _records(diagnosis) -> list[dict]:
    """Return every record's name, samples and length."""
    windows = diagnosis.records_.windows
    return [
        {
            "name": name,
            "samples": int(b - a),
            "duration": f"{number(windows.t[b - 1] - windows.t[a], 3)} s",
        }
        for name, (a, b) in zip(diagnosis.records_.names, pairwise(windows.bounds), strict=True)
    ]


def _cause(diagnosis, cause) -> dict:
    symbols = known_effects(diagnosis)[cause.effect](cause.target).names()
    return {
        "name": cause_name(cause.effect, cause.target),
        "summary": cause.summary,
        "check": cause.check,
        "parameters": [
            {
                "name": field.replace("_", " "),
                "symbol": symbols[field],
                "value": measured(e.value, e.low, e.high, typeset_unit(e.unit)),
            }
            for field, e in cause.parameters.items()
        ],
        "gain": percent(abs(cause.gain) / 100),
        "direction": "smaller" if cause.gain >= 0 else "larger",
        "probability": chance(cause.probability),
        "confused": rivals(cause),
        "separations": [
            separation_sentence(found)
            for found in diagnosis.separations_
            if found.cause == (cause.effect, cause.target)
        ],
    }


def _gain(output, gain) -> dict:
    errors = ("prior", "refitted", "extended", "noise")
    return {
        "output": output,
        **{which: number(getattr(gain, which), 3) for which in errors},
        "unit": typeset_unit(gain.unit) or "-",
        "share": share(gain),
    }


def _free_run(diagnosis, output) -> dict:
    error = diagnosis.free_run_[output]
    return {
        "output": output,
        "prior": free_run_error(error.prior),
        "refitted": free_run_error(error.refitted),
        "extended": free_run_error(error.extended),
        "unit": diagnosis.model.unit(output) or "-",
    }


def _parameter(name, parameter) -> dict:
    p = parameter
    change = f"{100 * (p.value / p.prior - 1):+.1f} %" if p.prior else number(p.value, 3)
    return {
        "name": name,
        "prior": number(p.prior),
        "value": measured(p.value, p.low, p.high, typeset_unit(p.unit)),
        "change": change,
        "changed": p.changed,
    }


def _equation_blocks(diagnosis):
    prior, extended = diagnosis.model, diagnosis.extended_model_
    if not diagnosis.causes_:
        return [("Unchanged", equations_of(prior, prior), False)]
    return [
        ("Before", equations_of(prior, extended), False),
        ("After", equations_of(extended, prior), True),
    ]


def _tried(diagnosis) -> list[dict]:
    named = {(cause.effect, cause.target) for cause in diagnosis.causes_}
    return [
        {
            "name": cause_name(effect, target),
            "left": left_alone(left),
            "width": round(100 * min(max(float(left), 0.0), 1.0), 1),
            "named": (effect, target) in named,
        }
        for effect, target, left in diagnosis.candidates_
    ]


def _method(diagnosis) -> str:
    records, window = diagnosis.records_, diagnosis.window_
    count, samples = len(records.names), records.windows.t.size
    return (
        f"{samples} samples in {count} {'record' if count == 1 else 'records'} were cut into "
        f"{len(records.windows)} windows of about {window:.3g} s, each with an initial state of "
        f"its own. Every candidate was fitted together with the model's free parameters and these "
        f"initial states. A cause is named only if a likelihood ratio on windows its parameters "
        f"were not fitted to speaks for it, at a rate of false names of {diagnosis.alpha:g}; if it "
        f"explains {percent(diagnosis.smallest_share)} of an output's error or more; and if the "
        f"free run does not speak against it. Inputs: {_hold(diagnosis.hold_)}; "
        f"integration steps from sample to sample: {diagnosis.substeps_}. "
        f"Intervals are 95 % intervals, robust to residuals that are not white."
    )


def _hold(hold: str) -> str:
    return "held between samples" if hold == "zoh" else "straight from sample to sample"


def _versions() -> str:
    package = import_module(__name__.split(".")[0])
    used = ", ".join(f"{name} {_version(name)}" for name in LIBRARIES)
    return f"sklearn-pgnn {package.__version__} (Python {platform.python_version()}, {used})"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "of unknown version"


# -- what is drawn ---------------------------------------------------------------------------------


def _comparison(diagnosis, kind) -> dict:
    comparison = compare(diagnosis, kind=kind)
    outputs = len(comparison.outputs)
    figure = new_figure(8.0, 3.6 * outputs)
    draw_comparison(figure.subplots(2 * outputs, height_ratios=[2.2, 1.3] * outputs), comparison)
    captions = {
        "free_run": "Free run: the models see only the inputs and the first state of the record.",
        "windows": f"Restarted from the record every {diagnosis.window_:.3g} s, as the models "
        f"were judged: errors have no time to add up.",
    }
    return _figure(figure, f"measured and simulated outputs, {comparison.title}", captions[kind])


def _all_evidence(diagnosis) -> list[dict]:
    """Draw the evidence for every cause, and for an unnamed discrepancy."""
    drawn = [
        _evidence(find_evidence(diagnosis, cause), cause_name(cause.effect, cause.target))
        for cause in diagnosis.causes_
    ]
    if diagnosis.discrepancy_ is not None:
        drawn.append(_evidence(missing_evidence(diagnosis), "what is missing and has no name"))
    return drawn


def _evidence(evidence, alt) -> dict:
    figure = new_figure(8.0, 3.6)
    draw_evidence(figure.subplots(), evidence)
    return _figure(figure, alt, evidence.note)


def _figure(figure, alt, caption) -> dict:
    data = base64.b64encode(to_png(figure)).decode("ascii")
    return {"alt": alt, "caption": caption, "source": f"data:image/png;base64,{data}"}


# -- where it goes ---------------------------------------------------------------------------------


def _write_whole(path: Path, text: str) -> None:
    """Write beside the file and put it in place in one step."""
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(text)
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
