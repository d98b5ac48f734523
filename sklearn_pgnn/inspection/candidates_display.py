"""Every candidate of a diagnosis, and the error that it leaves as the only cause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.panels import panels
from sklearn_pgnn.inspection.style import COLOURS, log_axis, plain, tidy
from sklearn_pgnn.inspection.yardstick import ratio, together

if TYPE_CHECKING:
    from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis


class CandidatesDisplay:
    """Dots on a logarithmic axis: the error that remains with each candidate alone.

    Parameters
    ----------
    names : sequence of str
        The candidates in words, the best first.
    left : sequence of float
        Share of the re-tuned prior's error power that remains with each.
    named : sequence of bool
        Whether each was named as a cause.
    noise : float, default=0
        Share that white noise alone would leave.
    ends : sequence of (float, float), optional
        Ends of the shares' 95 % intervals.

    Attributes
    ----------
    ax_ : matplotlib.axes.Axes
        The axes, once drawn.
    figure_ : matplotlib.figure.Figure
        Their figure.

    Examples
    --------
    >>> shown = CandidatesDisplay(["friction", "cogging"], left=[0.01, 0.8], named=[True, False])
    >>> [name for name, named in zip(shown.names, shown.named, strict=True) if named]
    ['friction']
    """

    def __init__(
        self,
        names: Sequence[str],
        left: Sequence[float],
        named: Sequence[bool],
        *,
        noise: float = 0.0,
        ends: Sequence[tuple[float, float]] | None = None,
    ):
        self.names, self.left, self.named = list(names), list(left), list(named)
        self.noise, self.ends = float(noise), None if ends is None else list(ends)

    @classmethod
    def from_estimator(cls, diagnosis: ModelDiagnosis, *, most: int = 20, ax: Any = None) -> Self:
        """Plot the candidates of a diagnosis.

        Parameters
        ----------
        diagnosis : ModelDiagnosis
            The fitted diagnosis.
        most : int, default=20
            Number of candidates drawn; every named cause is among them.
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        CandidatesDisplay
            The plotted display.
        """
        check_is_fitted(diagnosis)
        causes = {(cause.effect, cause.target) for cause in diagnosis.causes_}
        tried = [c for c in diagnosis.candidates_ if np.isfinite(c.left)]
        shown = [c for i, c in enumerate(tried) if i < most or (c.effect, c.target) in causes]
        return cls(
            [cause_name(c.effect, c.target) for c in shown],
            [c.left for c in shown],
            [(c.effect, c.target) in causes for c in shown],
            noise=ratio(1.0, together(diagnosis).refitted ** 2),
            ends=[(c.low, c.high) for c in shown],
        ).plot(ax=ax)

    def plot(self, *, ax: Any = None) -> Self:
        """Draw the plot.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        CandidatesDisplay
            This display, with `ax_` and `figure_`.
        """
        (self.ax_,) = panels(ax, 1, 8.0, 1.0 + 0.24 * len(self.names))
        self.figure_, places = self.ax_.figure, np.arange(len(self.names))
        percent = 100 * np.maximum(self.left, 1e-12)
        named = np.array(self.named, dtype=bool)
        if self.ends is not None:
            low, high = 100 * np.maximum(np.transpose(self.ends), 1e-12)
            self.ax_.hlines(places, low, high, color=COLOURS["medians"], linewidth=1.5)
        for chosen, colour, text in (
            (~named, COLOURS["points"], "candidate, alone"),
            (named, COLOURS["extended"], "named as a cause"),
        ):
            if chosen.any():
                self.ax_.plot(percent[chosen], places[chosen], "o", color=colour, label=text)
        self.ax_.axvline(100.0, color=COLOURS["prior"], linewidth=1, label="re-tuned only")
        if self.noise > 0:
            end = 100 * self.noise
            self.ax_.axvline(end, color=COLOURS["medians"], linestyle=":", label="white noise")
        log_axis(self.ax_)
        self.ax_.set_yticks(places, [plain(name) for name in self.names])
        self.ax_.set_ylim(len(self.names) - 0.5, -0.5)
        self.ax_.set_xlabel("error power left [% of the re-tuned model's]")
        self.ax_.legend(fontsize=8)
        tidy(self.ax_)
        return self
