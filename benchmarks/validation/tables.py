"""The validation as tables of the documentation, with binomial intervals."""

import datetime
from collections import Counter
from pathlib import Path

import numpy as np
from outcome import OUTCOMES
from scipy.stats import binomtest

import sklearn_pgnn

TABLES = Path(__file__).parents[2] / "docs" / "tables"
ROWS = {
    "single": "one effect",
    "pair": "two effects",
    "triple": "three effects",
    "nothing": "nothing, by sensor",
    "law": "a law beyond the catalogue",
    "disturbance": "a disturbance from outside",
}


def write(outcomes) -> None:
    """Write the counts, and every case that was missed, wrong or failed."""
    date = datetime.date.today().isoformat()
    first = (
        f"Written on {date} by sklearn-pgnn {sklearn_pgnn.__version__}: {len(outcomes)} cases; "
        f"the median diagnosis took {np.median([o.seconds for o in outcomes]):.1f} s on one core."
    )
    _lines("validation.rst", [first, "", *_table(_HEAD, list(_rows(outcomes)))])
    bad = [o for o in outcomes if o.outcome in ("missed", "wrong", "failed")]
    rows = [[o.kind, o.machine, o.hidden or o.detail, o.outcome, o.said] for o in bad]
    head = ["kind", "machine", "hidden, or sensor", "", "said"]
    _lines("validation_missed.rst", _table(head, sorted(rows)))


_HEAD = ["hidden", "cases", *OUTCOMES, "right, 95 % interval", "intervals with the truth inside"]


def _rows(outcomes):
    """Yield a row for every kind, of single effects by machine, of nothing by sensor."""
    for kind, title in ROWS.items():
        of = [o for o in outcomes if o.kind == kind]
        if not of:
            continue
        yield _row(title, of)
        part = {"single": "machine", "nothing": "detail"}.get(kind)
        for name in sorted({getattr(o, part) for o in of} if part else ()):
            yield _row(f"|nbsp| |nbsp| {name}", [o for o in of if getattr(o, part) == name])


def _row(title, of):
    counts = Counter(o.outcome for o in of)
    told = len(of) - counts["absorbed"]
    right = counts["named"] + counts["group"]
    covered, intervals = sum(o.covered for o in of), sum(o.intervals for o in of)
    return [
        title,
        str(len(of)),
        *(str(counts[outcome]) for outcome in OUTCOMES),
        _share(right, told),
        _share(covered, intervals),
    ]


def _share(count, total) -> str:
    """Write a share in percent with its Clopper-Pearson interval."""
    if not total:
        return ""
    ends = binomtest(count, total).proportion_ci()
    return f"{100 * count / total:.0f} ({100 * ends.low:.0f} to {100 * ends.high:.0f}) %"


def _table(head, rows) -> list[str]:
    if not rows:
        return ["There was no such case."]
    lines = [".. |nbsp| unicode:: 0xA0", "", ".. list-table::", "   :header-rows: 1", ""]
    for row in [head, *rows]:
        cells = [f"- {cell}".rstrip() for cell in row]
        lines += [f"   * {cells[0]}", *(f"     {cell}" for cell in cells[1:])]
    return lines


def _lines(name, lines) -> None:
    TABLES.mkdir(exist_ok=True)
    (TABLES / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
