"""The content of a report, by the variables of its templates."""

from datetime import date
from itertools import pairwise

from sklearn_pgnn.inspection.cause_names import candidate_name
from sklearn_pgnn.inspection.equations import equations_of
from sklearn_pgnn.inspection.numbers import number, percent, times
from sklearn_pgnn.inspection.parameter_ends import spread_sentence
from sklearn_pgnn.inspection.report.causes import told_causes
from sklearn_pgnn.inspection.report.characteristics import characteristics
from sklearn_pgnn.inspection.report.correlation import correlation
from sklearn_pgnn.inspection.report.curves_section import curve_sections, keys
from sklearn_pgnn.inspection.report.dot_plot import dot_plot
from sklearn_pgnn.inspection.report.finding import leaves_more, title, verdict_line
from sklearn_pgnn.inspection.report.forest import forest
from sklearn_pgnn.inspection.report.formula import FoundFormula, told_formula
from sklearn_pgnn.inspection.report.members import all_members
from sklearn_pgnn.inspection.report.method import method, versions
from sklearn_pgnn.inspection.report.next_step import next_step
from sklearn_pgnn.inspection.report.part import part
from sklearn_pgnn.inspection.report.provenance import Provenance
from sklearn_pgnn.inspection.report.residual_maps import residual_maps
from sklearn_pgnn.inspection.report.residual_tests import residual_tests
from sklearn_pgnn.inspection.report.smallest import smallest_rows
from sklearn_pgnn.inspection.report.tables import error_rows
from sklearn_pgnn.inspection.report.tiles import make_tiles, worst
from sklearn_pgnn.inspection.report.who_did_what import segments_of_bar
from sklearn_pgnn.inspection.words import (
    NOT_COMPARED,
    remaining_sentence,
    unusable_sentence,
    verdict_sentence,
)
from sklearn_pgnn.inspection.yardstick import shown_models, together


def report_content(diagnosis, provenance: Provenance, detectability=None) -> dict:
    """Return the content of the report: plain text and pictures by the template's variable."""
    formula = None if diagnosis.discrepancy_ is None else FoundFormula(diagnosis)
    return {
        **_top(diagnosis),
        **_source(diagnosis, provenance),
        **_story(diagnosis, formula),
        **_appendix(diagnosis),
        "smallest": smallest_rows(detectability),
        "power": "" if detectability is None else f"{100 * detectability.power:.0f}",
    }


def _top(diagnosis) -> dict:
    tiles = make_tiles(diagnosis)
    return {
        "title": title(diagnosis),
        "state": worst(tiles),
        "verdict": diagnosis.verdict_,
        "verdict_title": verdict_line(diagnosis),
        "sentence": verdict_sentence(diagnosis),
        "remaining": remaining_sentence(diagnosis),
        "tiles": tiles,
        "bar": segments_of_bar(diagnosis),
        "next_step": next_step(diagnosis),
        "data_quality": diagnosis.data_quality_,
    }


def _source(diagnosis, provenance: Provenance) -> dict:
    return {
        "provenance": provenance,
        "records": _records(diagnosis),
        "versions": versions(),
        "date": provenance.date or date.today().isoformat(),
    }


def _story(diagnosis, formula: FoundFormula | None) -> dict:
    """Return the causes, the formula, and the pictures of both."""
    members = part("rivals", all_members, diagnosis, without={})
    drawn = part("characteristics", characteristics, diagnosis, members, without=[])
    maps = []
    if formula or leaves_more(diagnosis):
        maps = part("maps of what is left", residual_maps, diagnosis, formula, without=[])
    free, windowed, others = curve_sections(diagnosis)
    return {
        "not_compared": "" if diagnosis.complete_ else NOT_COMPARED,
        "causes": told_causes(diagnosis, members),
        "formula": None if formula is None else told_formula(formula),
        "characteristics": drawn,
        "maps": maps,
        "curve_keys": keys(diagnosis),
        "free_run": free,
        "windowed": windowed,
        "window": f"{number(diagnosis.window_, 3)} s",
        "other_records": others,
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
