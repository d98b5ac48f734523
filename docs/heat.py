"""Tables of counts as heat maps: totals first, and a colour for what each cell mostly says.

Cells such as ``3 / 0 / 1 / 0`` count what was named, absorbed, missed and wrong.
"""

import re

from docutils import nodes

COUNTS = re.compile(r"\d+( / (\d+|-)){2,}")
KINDS = ("named", "absorbed", "missed", "wrong")
#: the same where nothing is hidden
OF_NOTHING = ("quiet", "-", "-", "false alarm")
#: a share up to which a kind does not colour a cell
SELDOM = 0.05
#: beginnings of the rows that sum the others up
TOTALS = ("all effects", "nothing", "intervals")


def colour(_app, doctree) -> None:
    """Colour all tables of counts in a document, and put their totals first."""
    for table in doctree.findall(nodes.table):
        if not any(COUNTS.fullmatch(cell.astext()) for cell in table.findall(nodes.entry)):
            continue
        table["classes"].append("heat")
        for body in table.findall(nodes.tbody):
            body.children.sort(key=lambda row: not row[0].astext().startswith(TOTALS))
            for row in body:
                _colour_row(row)


def _colour_row(row) -> None:
    name = row[0].astext()
    if name.startswith(TOTALS):
        row["classes"].append("total")
    for cell in row:
        if COUNTS.fullmatch(cell.astext()):
            _colour(cell, OF_NOTHING if name.startswith("nothing (") else KINDS)
    if name.startswith("nothing ("):  # its brackets said in which order the counts stand
        row[0].children = [nodes.paragraph("", "nothing")]


def _colour(cell, kinds) -> None:
    """Give a cell the class of the worst that it counts, and say what it counts in words."""
    counts = [int(part) if part != "-" else 0 for part in cell.astext().split(" / ")]
    said = [(count, kind) for count, kind in zip(counts, kinds, strict=False) if count]
    if not said:
        return
    telling = [kind for count, kind in said if count > SELDOM * sum(counts)]
    cell["classes"].append(f"heat-{telling[-1].split()[-1]}")
    words = [kind if sum(counts) == 1 else f"{count} {kind}" for count, kind in said]
    cell.children = [nodes.paragraph("", word) for word in words]


def setup(app) -> dict:
    """Connect to Sphinx."""
    app.connect("doctree-read", colour)
    return {"version": "1", "parallel_read_safe": True}
