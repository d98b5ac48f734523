"""Correlations of the parameters' errors: a matrix, and the pairs that hide each other."""

import math
from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.simulation.uncertainty import correlations
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows

#: correlation from which on two parameters are named, and shades of a colour
TIGHT, SHADES = 0.9, 5


@dataclass(frozen=True)
class Cell:
    """A correlation as it is shown.

    The text is empty above the diagonal's place.
    """

    text: str
    css: str


@dataclass(frozen=True)
class Correlation:
    """The correlations of the parameters.

    `rows` are the lower triangle, and `tight` the pairs that hide each other, in words.
    """

    names: list[str]
    rows: list[tuple[str, list[Cell]]]
    tight: list[str]


def correlation(diagnosis) -> Correlation | None:
    """Return the correlations of the parameters, a formula's coefficients among them.

    None where there are less than two.
    """
    fit = fitted_again(diagnosis)
    names = [freedom.name for freedom in fit.freedoms]
    if len(names) < 2:
        return None
    records = diagnosis.records_
    expected = records.problem.states.expected_starts(fit.model, records.windows)
    found = correlations(fit, *expected)
    rows = [(names[i], [_cell(found[i, j]) for j in range(i)]) for i in range(1, len(names))]
    tight = [
        f"{names[j]} and {names[i]} ({_signed(found[i, j])})"
        for i in range(len(names))
        for j in range(i)
        if abs(found[i, j]) > TIGHT
    ]
    return Correlation(names[:-1], rows, tight)


def fitted_again(diagnosis) -> WindowFit:
    """Return the model with all that was found, with its evaluation where it stands."""
    records = diagnosis.records_
    best = records.fits[records.best]
    expected = records.problem.states.expected_starts(best.model, records.windows)
    options = {"x0_start": best.x0, "max_steps": 0}
    return fit_windows(best.model, records.windows, best.freedoms, *expected, **options)


def _cell(value: float) -> Cell:
    if not math.isfinite(value):
        return Cell("-", "")
    shade = min(int(SHADES * abs(value)), SHADES - 1)
    sign = "with" if value > 0 else "against"
    return Cell(_signed(value), f"{sign} shade-{shade}" if shade else "")


def _signed(value: float) -> str:
    """Return a correlation with two digits and a minus sign.

    Examples
    --------
    >>> _signed(-0.954), _signed(0.999), _signed(0.001)
    ('−0.95', '1.00', '0')
    """
    text = f"{np.clip(value, -1.0, 1.0):.2f}".replace("-", "−")
    return "0" if float(text.replace("−", "-")) == 0 else text
