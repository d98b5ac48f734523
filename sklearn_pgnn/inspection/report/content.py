"""The content of a report, by the variables of its templates."""

from collections.abc import Callable
from datetime import date
from itertools import pairwise
from typing import Any

from sklearn_pgnn.exceptions import DiagnosisWarning
from sklearn_pgnn.inspection.cause_names import candidate_name, cause_name
from sklearn_pgnn.inspection.equations import equations_of
from sklearn_pgnn.inspection.numbers import (
    free_run_error,
    least_size,
    number,
    percent,
    times,
    typeset_unit,
)
from sklearn_pgnn.inspection.report.causes import all_members, told_causes
from sklearn_pgnn.inspection.report.curves_section import curve_sections
from sklearn_pgnn.inspection.report.dot_plot import dot_plot
from sklearn_pgnn.inspection.report.evidence_section import (
    characteristics,
    residual_maps,
    residual_tests,
)
from sklearn_pgnn.inspection.report.finding import leaves_more, next_step, title, verdict_line
from sklearn_pgnn.inspection.report.formula import FoundFormula, told_formula
from sklearn_pgnn.inspection.report.parameters import correlation, forest
from sklearn_pgnn.inspection.report.provenance import Provenance, method, versions
from sklearn_pgnn.inspection.report.tiles import STATES, make_tiles, worst
from sklearn_pgnn.inspection.words import (
    NOT_COMPARED,
    early_end,
    remaining_sentence,
    spread_sentence,
    told_verdict,
    unusable_sentence,
)
from sklearn_pgnn.inspection.yardstick import ratio, shown_models, together
from sklearn_pgnn.user_line import warn_user


def part(what: str, make: Callable[..., Any], *of: Any, without: Any) -> Any:
    """Return a part of a report; after an error what stands in its place, with a warning."""
    try:
        return make(*of)
    except Exception as error:
        warning = DiagnosisWarning(
            f"the report lacks {what} ({type(error).__name__}: {error}). Remedy: report it as a "
            f"bug of sklearn-pgnn; all else of the report is there."
        )
        warning.__cause__ = error
        warn_user(warning, DiagnosisWarning)
        return without


def error_rows(diagnosis) -> list[dict]:
    """Return the errors over held-out windows and in free run, output by output."""
    return [
        {
            "output": output,
            "how": how,
            "errors": [
                {
                    "value": free_run_error(error),
                    "times": times(ratio(error, gain.noise)).replace("diverges", ""),
                }
                for error in (getattr(errors, which) for which in shown_models(diagnosis))
            ],
            "noise": number(gain.noise, 3),
            "unit": typeset_unit(diagnosis.model.unit(output)) or "-",
        }
        for output, gain in diagnosis.gain_.items()
        for how, errors in (("held-out windows", gain), ("free run", diagnosis.free_run_[output]))
    ]


def _smallest(row) -> dict:
    """Return the smallest size of an effect that would have been named."""
    size = f"{row.parameter.replace('_', ' ')} {least_size(row)}" if row.smallest > 0 else ""
    return {"name": cause_name(row.effect, row.target), "size": size, "reason": row.reason}


def report_content(diagnosis, provenance: Provenance, detectability=None) -> dict:
    """Return the content of the report: plain text and pictures by the template's variable."""
    formula = None if diagnosis.discrepancy_ is None else FoundFormula(diagnosis)
    return {
        **_top(diagnosis),
        "provenance": provenance,
        "records": _records(diagnosis),
        "versions": versions(),
        "date": provenance.date or date.today().isoformat(),
        **_story(diagnosis, formula),
        **_appendix(diagnosis),
        "smallest": [] if detectability is None else list(map(_smallest, detectability.rows)),
        "power": "" if detectability is None else f"{100 * detectability.power:.0f}",
    }


def _top(diagnosis) -> dict:
    tiles, (sentence, more) = make_tiles(diagnosis), told_verdict(diagnosis)
    return {
        "title": title(diagnosis),
        "state": worst(tiles),
        "verdict": diagnosis.verdict_,
        "verdict_title": verdict_line(diagnosis),
        "sentence": sentence,
        "more": " ".join((early_end(diagnosis), more, remaining_sentence(diagnosis))).strip(),
        "tiles": tiles,
        "states": STATES,
        "next_step": next_step(diagnosis),
        "data_quality": diagnosis.data_quality_,
    }


def _story(diagnosis, formula: FoundFormula | None) -> dict:
    """Return the causes, the formula, and the pictures of both."""
    members = part("rivals", all_members, diagnosis, without={})
    drawn = part("characteristics", characteristics, diagnosis, members, without=[])
    maps = []
    if formula or leaves_more(diagnosis):
        maps = part("maps of what is left", residual_maps, diagnosis, formula, without=[])
    return {
        "not_compared": "" if diagnosis.complete_ else NOT_COMPARED,
        "causes": told_causes(diagnosis, members),
        "formula": None if formula is None else told_formula(formula),
        "characteristics": drawn,
        "maps": maps,
        **curve_sections(diagnosis),
        "window": f"{number(diagnosis.window_, 3)} s",
        "candidates": part("candidates", dot_plot, diagnosis, without=None),
        "retuned_only": times(together(diagnosis).refitted),
        "tests": part("tests of what is left", residual_tests, diagnosis, without={}),
        "smallest_share": percent(diagnosis.smallest_share),
    }


def _appendix(diagnosis) -> dict:
    return {
        "models": list(shown_models(diagnosis).values()),
        "errors": error_rows(diagnosis),
        "forest": forest(diagnosis),
        "pinned": spread_sentence(diagnosis),
        "correlation": part("correlations", correlation, diagnosis, without=None),
        "equation_blocks": _equation_blocks(diagnosis),
        "unusable": [
            {"name": candidate_name(effect, target), "reason": reason}
            for effect, target, reason in diagnosis.unusable_
        ],
        "unusable_sentence": unusable_sentence(diagnosis),
        "method": method(diagnosis),
    }


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


def _equation_blocks(diagnosis):
    prior, extended = diagnosis.model, diagnosis.extended_model_
    if diagnosis.discrepancy_ is not None:
        extended = diagnosis.discrepancy_.model
    elif not diagnosis.causes_:
        return [("Unchanged", equations_of(prior, prior), False)]
    return [
        ("Before", equations_of(prior, extended, marks=False), False),
        ("After", equations_of(extended, prior), True),
    ]
