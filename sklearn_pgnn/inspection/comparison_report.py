"""The report of a comparison: one HTML file that loads nothing else."""

import base64
import math
from html import escape

import numpy as np

from sklearn_pgnn.inspection.comparison import DiagnosisComparison, Table
from sklearn_pgnn.inspection.style import COLOURS, new_figure, plain, tidy, to_png

_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; }
th, td { text-align: left; padding: 0.25rem 1rem 0.25rem 0; border-bottom: 1px solid #8885;
         vertical-align: top; overflow-wrap: anywhere; min-width: 5rem; }
.differs td { font-weight: 600; }
img { width: 48rem; max-width: 100%; min-width: 36rem; height: auto; background: white; }
@media print { body { margin: 0; max-width: none; } }
"""


def render_comparison(comparison: DiagnosisComparison) -> str:
    """Return a comparison as HTML.

    Parameters
    ----------
    comparison : DiagnosisComparison
        Two diagnoses.

    Returns
    -------
    str
        The HTML text; names and units are escaped.
    """
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
    shared = [q for q in comparison.quantities if q.one and q.other and q.one[0]]
    if not shared:
        return ""
    figure = new_figure(8.0, 1.1 + 0.4 * len(shared))
    draw_quantities(figure.subplots(), shared, comparison.names)
    data = base64.b64encode(to_png(figure)).decode("ascii")
    alt = escape(f"values in {comparison.names[1]} as a share of those in {comparison.names[0]}")
    return f'<div class="scroll"><img alt="{alt}" src="data:image/png;base64,{data}"></div>'


def draw_quantities(axes, quantities, names) -> None:
    """Draw what both diagnoses have found, as a share of what the first has.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Where to draw.
    quantities : sequence of Quantity
        Found by both, the first not zero.
    names : tuple of str
        What the two are called.
    """
    colours = {"one": COLOURS["points"], "other": COLOURS["extended"]}
    for k, (which, colour) in enumerate(colours.items()):
        places = np.arange(len(quantities)) + (k - 0.5) / 4
        found = [getattr(q, which) for q in quantities]
        shares = [
            [100 * x / q.one[0] if math.isfinite(x) else math.nan for x in values]
            for q, values in zip(quantities, found, strict=True)
        ]
        value, low, high = np.array(shares).T
        axes.plot(value, places, "o", color=colour, label=plain(names[k]))
        axes.hlines(places, low, high, color=colour, linewidth=2)
    axes.set_yticks(range(len(quantities)), [plain(q.name) for q in quantities])
    axes.set_ylim(len(quantities) - 0.5, -0.5)
    axes.set_xlabel(plain(f"share of the value in {names[0]} [%], with 95 % intervals"))
    axes.legend(fontsize=8)
    tidy(axes)
