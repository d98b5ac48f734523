"""Tables of counts as heat maps: totals first, and a colour for what each cell mostly says.

Cells such as ``3 / 0 / 1 / 0`` count what was named, absorbed, missed and wrong.
"""

import re

from docutils import nodes

COUNTS = re.compile(r"\d+( / \d+){3}")
KINDS = ("named", "absorbed", "missed", "wrong")
#: a share up to which a kind does not colour a cell
SELDOM = 0.05
#: beginning of the row that sums the others up
TOTAL = "all effects"


def colour(_app, doctree) -> None:
    """Colour all tables of counts in a document, and put their totals first."""
    for table in doctree.findall(nodes.table):
        if not any(COUNTS.fullmatch(cell.astext()) for cell in table.findall(nodes.entry)):
            continue
        table["classes"].append("heat")
        for body in table.findall(nodes.tbody):
            body.children.sort(key=lambda row: not row[0].astext().startswith(TOTAL))
            for row in body:
                _colour_row(row)


def _colour_row(row) -> None:
    if row[0].astext().startswith(TOTAL):
        row["classes"].append("total")
    for cell in row:
        if COUNTS.fullmatch(cell.astext()):
            _colour(cell)


def _colour(cell) -> None:
    """Give a cell the class of the worst that it counts, and say what it counts in words."""
    counts = [int(part) for part in cell.astext().split(" / ")]
    said = [(count, kind) for count, kind in zip(counts, KINDS, strict=True) if count]
    if not said:
        return
    telling = [kind for count, kind in said if count > SELDOM * sum(counts)]
    cell["classes"].append(f"heat-{telling[-1]}")
    words = [kind if sum(counts) == 1 else f"{count} {kind}" for count, kind in said]
    cell.children = [nodes.paragraph("", word) for word in words]


def setup(app) -> dict:
    """Connect to Sphinx."""
    app.connect("doctree-read", colour)
    return {"version": "1", "parallel_read_safe": True}
