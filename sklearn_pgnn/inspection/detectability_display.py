"""Plot of a detectability: the smallest size at which every effect is detected."""

import numpy as np

from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.least_size import least_size
from sklearn_pgnn.inspection.style import COLOURS, log_axis, plain, shown_figure, tidy


class DetectabilityDisplay:
    """Plot of a detectability: the power as a function of the size of every effect.

    Parameters
    ----------
    detectability : Detectability
        The result of `ModelDiagnosis.detectability`.

    Attributes
    ----------
    figure_ : matplotlib.figure.Figure
        The figure, once drawn.
    axes_ : matplotlib.axes.Axes
        One line per effect: from pale to dark as the power goes from 0 to 1, with a mark at the
        smallest size that is detected.

    Examples
    --------
    >>> from sklearn_pgnn.diagnosis import Detectability, Detectable
    >>> curve = ((0.0, 0.0), (0.02, 0.1), (0.05, 0.9), (0.5, 1.0))
    >>> seen = Detectable("coulomb_friction", "v", "level", "N", smallest=0.05, curve=curve)
    >>> shown = DetectabilityDisplay(Detectability((seen,), 0.9, (1.0, 2.0))).plot()
    >>> [label.get_text() for label in shown.axes_.get_yticklabels()]
    ['Coulomb friction on v']
    """

    def __init__(self, detectability):
        self.detectability = detectability

    def plot(self, *, figure=None):
        """Draw the plot.

        Sizes are drawn as fractions of the largest one evaluated; the text beside each line gives
        the smallest detected size in its own unit, or why there is none.

        Parameters
        ----------
        figure : matplotlib.figure.Figure, optional
            Where to draw; by default a new figure of pyplot, which ``plt.show()`` shows.

        Returns
        -------
        DetectabilityDisplay
            This display, with `figure_` and `axes_`.
        """
        rows = self.detectability.rows
        self.figure_ = shown_figure(9.0, 0.6 + 0.34 * len(rows)) if figure is None else figure
        self.axes_ = axes = self.figure_.subplots()
        for place, row in enumerate(rows):
            _draw_row(axes, place, row)
        names = [plain(cause_name(row.effect, row.target)) for row in rows]
        axes.set_yticks(range(len(rows)), names)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        log_axis(axes)
        share = f"{100 * self.detectability.power:.0f} %"
        axes.set_xlabel(f"size, 1 = as large as the motion itself (found in {share})")
        tidy(axes)
        return self


def _draw_row(axes, place, row) -> None:
    sizes, powers = np.array(row.curve[1:]).T
    shares = np.abs(sizes - row.curve[0][0]) / max(abs(sizes[-1] - row.curve[0][0]), 1e-300)
    colours = [(*_rgb(COLOURS["extended"]), 0.15 + 0.85 * power) for power in powers]
    axes.plot(shares, np.full(shares.size, place), color=COLOURS["measured"], linewidth=0.6)
    axes.scatter(shares, np.full(shares.size, place), color=colours, s=14, zorder=2)
    if row.reason:
        text = row.reason
    else:
        at = abs(row.smallest - row.curve[0][0]) / max(abs(sizes[-1] - row.curve[0][0]), 1e-300)
        axes.plot(at, place, marker="|", markersize=14, color=COLOURS["prior"], zorder=3)
        text = f"{row.parameter.replace('_', ' ')} {least_size(row, 3)}"
    axes.annotate(
        plain(text.rstrip()),
        (1.02, place),
        xycoords=axes.get_yaxis_transform(),
        fontsize=8,
        va="center",
    )


def _rgb(colour: str) -> tuple[float, ...]:
    return tuple(int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))


def plot_detectability(detectability, **options) -> DetectabilityDisplay:
    """Plot a detectability.

    Parameters
    ----------
    detectability : Detectability
        The result of `ModelDiagnosis.detectability`.
    **options
        See `DetectabilityDisplay.plot`.

    Returns
    -------
    DetectabilityDisplay
        The plotted display.

    Examples
    --------
    >>> from sklearn_pgnn.diagnosis import Detectability, Detectable
    >>> curve = ((0.0, 0.0), (0.02, 0.1), (0.05, 0.9), (0.5, 1.0))
    >>> seen = Detectable("coulomb_friction", "v", "level", "N", smallest=0.05, curve=curve)
    >>> shown = plot_detectability(Detectability((seen,), 0.9, (1.0, 2.0)))
    >>> [label.get_text() for label in shown.axes_.get_yticklabels()]
    ['Coulomb friction on v']
    """
    return DetectabilityDisplay(detectability).plot(**options)
