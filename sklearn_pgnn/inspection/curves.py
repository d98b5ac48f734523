"""The parts of a piece of evidence: points of the records, and curves of the models."""

from dataclasses import dataclass

import numpy as np

GRID = 801


@dataclass(frozen=True)
class Line:
    """A curve of the evidence: its points, and the model it belongs to."""

    x: np.ndarray
    y: np.ndarray
    whose: str
    label: str


@dataclass(frozen=True)
class Evidence:
    """The evidence for a cause.

    `points` are abscissa and ordinate of the records' points, `lines` curves of the models; the
    note is one sentence: what to look at.
    """

    title: str
    x_label: str
    y_label: str
    points: tuple[np.ndarray, np.ndarray] | None
    lines: tuple[Line, ...]
    note: str


def even_grid(x) -> np.ndarray:
    """Return evenly spaced values over the range of some points."""
    low, high = np.nanmin(x), np.nanmax(x)
    return np.linspace(low, high, GRID)
