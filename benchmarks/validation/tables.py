"""The validation as tables of the documentation, with binomial intervals."""

import datetime
from collections import Counter
from pathlib import Path

import numpy as np
from calibration import binomial_interval, bins_of, draw, mean_error
from outcome import OUTCOMES

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


NBSP = ".. |nbsp| unicode:: 0xA0"
#: kinds in which what is hidden has a name in the catalogue, or is nothing
WITH_NAMES = ("single", "pair", "triple", "nothing")


def write(outcomes, drawn) -> None:
    """Write the counts, the probabilities, and every case that was missed, wrong or failed."""
    date = datetime.date.today().isoformat()
    first = (
        f"Written on {date} by sklearn-pgnn {sklearn_pgnn.__version__}: {len(outcomes)} of {drawn} "
        f"cases; the median diagnosis took {np.median([o.seconds for o in outcomes]):.1f} s on one "
        f"core."
    )
    _lines("validation.rst", [first, "", NBSP, "", *_table(_HEAD, list(_rows(outcomes)))])
    _lines("validation_effects.rst", _effects([o for o in outcomes if o.kind == "single"]))
    bins = bins_of([o for o in outcomes if o.kind in WITH_NAMES])
    _lines("validation_chances.rst", _chances(bins))
    draw(bins)
    bad = [o for o in outcomes if o.outcome in ("missed", "wrong", "failed")]
    rows = [[o.kind, o.machine, o.hidden or o.detail, o.outcome, o.said] for o in bad]
    head = ["kind", "machine", "hidden, or sensor", "", "said"]
    _lines("validation_missed.rst", _table(head, sorted(rows)))


_HEAD = [
    "hidden",
    "cases",
    *OUTCOMES,
    "right, 95 % interval",
    "intervals with the truth inside",
    "of these, where all that is hidden is named alone",
]


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
    return [
        title,
        str(len(of)),
        *(str(counts[outcome]) for outcome in OUTCOMES),
        _share(right, told),
        _coverage(of),
        _coverage([o for o in of if o.outcome == "named"]),
    ]


def _coverage(of) -> str:
    """Count the intervals with the truth inside."""
    return _share(sum(o.covered for o in of), sum(o.intervals for o in of))


def _effects(outcomes) -> list[str]:
    """Count what was named, absorbed, missed and wrong by effect and machine."""
    machines = sorted({o.machine for o in outcomes})
    rows = [["all effects", *(_counts(outcomes, machine) for machine in (*machines, None))]]
    for effect in sorted({o.detail for o in outcomes}):
        of = [o for o in outcomes if o.detail == effect]
        rows.append([effect, *(_counts(of, machine) for machine in (*machines, None))])
    return _table(["hidden", *machines, "all"], rows)


def _counts(outcomes, machine) -> str:
    counts = Counter(o.outcome for o in outcomes if machine in (o.machine, None))
    bad = counts["wrong"] + counts["failed"]
    found = [counts["named"] + counts["group"], counts["absorbed"], counts["missed"], bad]
    return " / ".join(map(str, found)) if sum(found) else ""


def _chances(bins) -> list[str]:
    """Compare probabilities with how often what has them is right."""
    rows = [
        [f"{b.low} to {b.high}", str(b.count), f"{100 * b.mean:.1f}", _share(b.right, b.count)]
        for b in bins
    ]
    head = ["probability", "causes and rivals", "mean of it [%]", "right, 95 % interval"]
    error = 100 * mean_error(bins)
    return [f"Mean calibration error: {error:.1f} points.", "", *_table(head, rows)]


def _share(count, total) -> str:
    """Write a share in percent with its interval."""
    if not total:
        return ""
    low, high = binomial_interval(count, total)
    return f"{100 * count / total:.0f} ({100 * low:.0f} to {100 * high:.0f}) %"


def _table(head, rows) -> list[str]:
    if not rows:
        return ["There was no such case."]
    lines = [".. list-table::", "   :header-rows: 1", ""]
    for row in [head, *rows]:
        cells = [f"- {cell}".rstrip() for cell in row]
        lines += [f"   * {cells[0]}", *(f"     {cell}" for cell in cells[1:])]
    return lines


def _lines(name, lines) -> None:
    TABLES.mkdir(exist_ok=True)
    (TABLES / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
