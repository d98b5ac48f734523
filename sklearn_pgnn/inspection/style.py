"""Style of the pictures: colours, labels, figures, axes."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from sklearn_pgnn.inspection.numbers import typeset_unit

#: colour of the record, of every model and of the evidence
COLOURS = {
    "measured": "#b4b4b4",
    "prior": "#d1600b",
    "refitted": "#8a8a8a",
    "extended": "#1766ad",
    "formula": "#22783f",
    "points": "#8a8a8a",
    "medians": "#222222",
}
#: legend of the models
LABELS = {
    "measured": "measured",
    "prior": "model as given",
    "refitted": "model re-tuned",
    "extended": "model extended",
    "formula": "model with formula",
}


def shown_figure(width: float, height: float):
    """Return an empty figure of some size [inch] that ``plt.show()`` and notebooks show."""
    import matplotlib.pyplot as plt

    return plt.figure(figsize=(width, height), layout="constrained")


def tidy(axes) -> None:
    """Remove the upper and right spines, and draw a light grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, linewidth=0.4, alpha=0.5)
    axes.tick_params(labelsize=8)


def label(quantity: str, unit: str) -> str:
    """Name an axis with its unit.

    >>> label("alpha", "rad/s^2"), label("x", "")
    ('alpha [rad/s²]', 'x [-]')
    """
    return f"{plain(quantity)} [{plain(typeset_unit(unit)) or '-'}]"


def plain(text: str) -> str:
    r"""Return a name with its dollar signs escaped for matplotlib.

    >>> print(plain("price in $"))
    price in \$
    """
    return str(text).replace("$", r"\$")


def name_rows(axes, names: Sequence[str]) -> None:
    """Name the rows of a picture, the first on top."""
    axes.set_yticks(range(len(names)), [plain(name) for name in names])
    axes.set_ylim(len(names) - 0.5, -0.5)


def log_axis(ax) -> None:
    """Make the horizontal axis logarithmic, its ticks plain numbers."""
    from matplotlib.ticker import LogFormatter

    ax.set_xscale("log")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False, minor_thresholds=(2, 0.5)))


def panels(ax, count: int, width: float, height: float) -> np.ndarray:
    """Return the axes to draw on, by default those of a new figure; sizes [inch] are a panel's."""
    if ax is None:
        return shown_figure(width, height * count).subplots(count, squeeze=False)[:, 0]
    given = np.atleast_1d(np.array(ax, dtype=object)).ravel()
    if given.size != count:
        raise ValueError(f"ax: expected {count} axes, got {given.size}.")
    return given


class AxesDisplay:
    """A picture on one axes: `_draw` says what is drawn, and `_height` [inch] how high it is."""

    ax_: Any
    figure_: Any

    def _height(self) -> float:
        return 3.6

    def _draw(self, ax) -> None:
        raise NotImplementedError

    def plot(self, *, ax: Any = None) -> Self:
        """Draw the plot.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        Self
            This display, with `ax_` and `figure_`.
        """
        (self.ax_,) = panels(ax, 1, 8.0, self._height())
        self.figure_ = self.ax_.figure
        self._draw(self.ax_)
        return self
