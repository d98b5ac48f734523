"""What goes into the documentation: tables and pictures."""

from pathlib import Path

import numpy as np
import sklearn
import skopt
import torch
from matplotlib.figure import Figure

import sklearn_pgnn

DOCS = Path(__file__).parents[2] / "docs"
MODULES = (sklearn_pgnn, sklearn, skopt, torch, np)
#: colour of every line that is drawn
COLOURS = {
    "measured": "#b4b4b4",
    "physical model": "#d1600b",
    "plain network": "#8a4fa3",
    "SINDYc, paper's library": "#3f8f4f",
    "SINDYc, prior's terms": "#9bbf3a",
    "PGNN": "#6aa5d8",
    "PGNN-L": "#1766ad",
    "extended model": "#3f8f4f",
    "PGNN-L on the extended model": "#8a4fa3",
}


def spread(values):
    """Write a median and a range."""
    values = np.asarray(values, dtype=float)
    middle, low, high = np.median(values), values.min(), values.max()
    if f"{low:.3g}" == f"{high:.3g}":
        return f"{middle:.3g}"
    return f"{middle:.3g} ({low:.3g} to {high:.3g})"


def write_table(name, title, head, lines, dates, seeds):
    """Write a table into the documentation, with where it comes from."""
    versions = ", ".join(f"{module.__name__} {module.__version__}" for module in MODULES)
    drawn = f"; seeds 0 to {seeds - 1}: median and range" if seeds > 1 else "; seed 0"
    text = (
        f".. list-table:: {title} Written by ``python benchmarks/paper`` on {dates} with "
        f"{versions}{drawn}.\n   :header-rows: 1\n\n"
    )
    for line in [head, *lines]:
        text += "   * - " + "\n     - ".join(line) + "\n"
    path = DOCS / "tables" / f"paper_{name}.rst"
    path.write_text(text, encoding="utf-8")


def new_picture(rows, columns, width=8.0, height=2.6, **options):
    """Return a figure and an array of tidy axes."""
    figure = Figure(figsize=(width, height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for each in axes.flat:
        each.spines[["top", "right"]].set_visible(False)
        each.grid(True, linewidth=0.4, alpha=0.5)
        each.tick_params(labelsize=8)
    return figure, axes


def save(figure, name):
    """Write a picture into the documentation."""
    path = DOCS / "_static" / f"paper_{name}.png"
    figure.savefig(path, dpi=100, metadata={"Software": None})
