"""The report of a comparison: one HTML file that loads nothing else."""

import math
from html import escape

import numpy as np

from sklearn_pgnn.inspection.diagnosis_comparison import DiagnosisComparison, Table
from sklearn_pgnn.inspection.numbers import number
from sklearn_pgnn.inspection.svg import Scale, dot, scale_text, strip, whisker

_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; }
th, td { text-align: left; padding: 0.25rem 1rem 0.25rem 0; border-bottom: 1px solid #8885;
         vertical-align: top; overflow-wrap: anywhere; min-width: 5rem; }
.differs td { font-weight: 600; }
.wide, .strip { width: 100%; }
.strip { height: 1.6rem; overflow: visible; }
.one { color: #8a8a8a; fill: #8a8a8a; stroke: #8a8a8a; }
.other { color: #2f7fc7; fill: #2f7fc7; stroke: #2f7fc7; }
line { stroke-width: 3; }
.below { font-size: 0.8rem; text-anchor: middle; fill: currentColor; }
@media print { body { margin: 0; max-width: none; } }
"""


def render_comparison(comparison: DiagnosisComparison) -> str:
    """Return a comparison as HTML."""
    one, other = map(escape, comparison.names)
    items = "".join(f"<li>{escape(text)}</li>" for text in comparison.differences)
    tables = "".join(map(_table, comparison.tables))
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{one} and {other}</title><style>{_STYLE}</style></head><body><main>"
        f"<h1>{escape(comparison.summary)}</h1>{f'<ul>{items}</ul>' if items else ''}"
        f"{_picture(comparison)}{tables}</main></body></html>\n"
    )


def _table(table: Table) -> str:
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in table.headers)
    rows = "".join(
        f"<tr{' class=differs' if row[-1] == 'differs' else ''}>"
        f'<th scope="row">{escape(row[0])}</th>'
        f"{''.join(f'<td>{escape(text)}</td>' for text in row[1:])}</tr>"
        for row in table.rows
    )
    return (
        f'<h2>{escape(table.title)}</h2><div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _picture(comparison: DiagnosisComparison) -> str:
    """Return a picture of what both have found; nothing where that is nothing."""
    shared = [
        (q.name, 100 * np.array([q.one, q.other]) / q.one[0])
        for q in comparison.quantities
        if q.one and q.other and q.one[0]
    ]
    if not shared:
        return ""
    scale = Scale.over(*(shares for _, shares in shared))
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th>'
        f"<td>{_strip(scale, name, shares, comparison.names)}</td></tr>"
        for name, shares in shared
    )
    one, other = map(escape, comparison.names)
    return (
        f'<h2>Found by both, in percent of the value in {one}</h2><p class="key">'
        f'<span class="one">●</span> {one} <span class="other">●</span> {other}, with 95 % '
        f'intervals</p><table class="wide"><tbody>{rows}<tr><td></td><td>{scale_text(scale)}</td>'
        f"</tr></tbody></table>"
    )


def _strip(scale: Scale, about: str, both: np.ndarray, names) -> str:
    """Return a strip with the value of each, and its interval."""
    shapes = []
    for css, shares, name in zip(("one", "other"), both, names, strict=True):
        value, low, high = scale.place(shares).tolist()
        text = f"{name}: {number(shares[0])} %"
        if math.isfinite(high - low):
            shapes.append(whisker(min(low, high), max(low, high), css, text))
        shapes.append(dot(value, css, text))
    return str(strip(about, shapes))
