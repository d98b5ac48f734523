"""Pictures of what a diagnosis has found: candidates, causes, parameters, detectable sizes."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis
from sklearn_pgnn.experiment_design.detectability import Detectability
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.display import draw_evidence
from sklearn_pgnn.inspection.evidence import find_evidence, missing_evidence
from sklearn_pgnn.inspection.numbers import least_size, measured, typeset_unit
from sklearn_pgnn.inspection.style import (
    COLOURS,
    AxesDisplay,
    log_axis,
    name_rows,
    plain,
    shown_figure,
    tidy,
)
from sklearn_pgnn.inspection.yardstick import ratio, together
from sklearn_pgnn.physics.model import PhysicsModel


class CandidatesDisplay(AxesDisplay):
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

    def _height(self) -> float:
        return 1.0 + 0.24 * len(self.names)

    def _draw(self, ax) -> None:
        places = np.arange(len(self.names))
        percent = 100 * np.maximum(self.left, 1e-12)
        named = np.array(self.named, dtype=bool)
        if self.ends is not None:
            low, high = 100 * np.maximum(np.transpose(self.ends), 1e-12)
            ax.hlines(places, low, high, color=COLOURS["medians"], linewidth=1.5)
        for chosen, colour, text in (
            (~named, COLOURS["points"], "candidate, alone"),
            (named, COLOURS["extended"], "named as a cause"),
        ):
            if chosen.any():
                ax.plot(percent[chosen], places[chosen], "o", color=colour, label=text)
        ax.axvline(100.0, color=COLOURS["prior"], linewidth=1, label="re-tuned only")
        if self.noise > 0:
            end = 100 * self.noise
            ax.axvline(end, color=COLOURS["medians"], linestyle=":", label="white noise")
        log_axis(ax)
        name_rows(ax, self.names)
        ax.set_xlabel("error power left [% of the re-tuned model's]")
        ax.legend(fontsize=8)
        tidy(ax)


class CharacteristicDisplay(AxesDisplay):
    """Points of the records, and the law that was found: for example a force over a speed.

    Parameters
    ----------
    evidence : Evidence
        The points and curves to draw.

    Attributes
    ----------
    ax_ : matplotlib.axes.Axes
        The axes, once drawn.
    figure_ : matplotlib.figure.Figure
        Their figure.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_pgnn.inspection.evidence import Evidence, Line
    >>> v = np.linspace(-1, 1, 51)
    >>> law = Line(v, np.sign(v), "extended", "Coulomb friction")
    >>> evidence = Evidence("missing force", "v [m/s]", "force [N]", (v, np.sign(v)), (law,), "")
    >>> CharacteristicDisplay(evidence).plot().ax_.get_xlabel()
    'v [m/s]'
    """

    def __init__(self, evidence: Any):
        self.evidence = evidence

    @classmethod
    def from_estimator(cls, diagnosis: ModelDiagnosis, cause: Any = 0, *, ax: Any = None) -> Self:
        """Plot the characteristic of a cause of a diagnosis.

        Parameters
        ----------
        diagnosis : ModelDiagnosis
            The fitted diagnosis.
        cause : int, default=0
            Number of the cause; where none was named, the missing part is drawn.
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        CharacteristicDisplay
            The plotted display.

        Raises
        ------
        ValueError
            If there is no such cause, and no missing part was found.
        """
        check_is_fitted(diagnosis)
        causes = diagnosis.causes_
        if 0 <= cause < len(causes):
            return cls(find_evidence(diagnosis, causes[cause])).plot(ax=ax)
        if causes or diagnosis.discrepancy_ is None:
            raise ValueError(
                f"cause: expected a number below {len(causes)}, the number of causes, got "
                f"{cause!r}."
            )
        return cls(missing_evidence(diagnosis)).plot(ax=ax)

    def _draw(self, ax) -> None:
        draw_evidence(ax, self.evidence)


class ParametersDisplay(AxesDisplay):
    """Dots with 95 % intervals: how far each parameter is from its prior value.

    For a parameter whose prior is 0, which has no change in percent, only the text is shown.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    estimates : mapping of str to Estimate
        Values with intervals by parameter name.

    Attributes
    ----------
    ax_ : matplotlib.axes.Axes
        The axes, once drawn. A pale bar is the parameter's spread, within which it counts as
        calibrated.
    figure_ : matplotlib.figure.Figure
        Their figure.

    Examples
    --------
    >>> from sklearn_pgnn import systems
    >>> from sklearn_pgnn.simulation import Estimate
    >>> mass = Estimate(2.1, 2.05, 2.15, "kg")
    >>> shown = ParametersDisplay(systems.cart_on_spring(), {"m": mass}).plot()
    >>> [label.get_text() for label in shown.ax_.get_yticklabels()]
    ['m = 2.10 (2.05 to 2.15) kg']
    """

    def __init__(self, model: PhysicsModel, estimates: Mapping[str, Any]):
        self.model, self.estimates = model, dict(estimates)

    @classmethod
    def from_estimator(cls, estimator: Any, *, ax: Any = None) -> Self:
        """Plot the parameters of a fitted estimator.

        Parameters
        ----------
        estimator : ModelDiagnosis or PhysicsModelRegressor
            The fitted estimator.
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        ParametersDisplay
            The plotted display.
        """
        check_is_fitted(estimator)
        return cls(estimator.model, estimator.parameters_).plot(ax=ax)

    def _height(self) -> float:
        return 1.0 + 0.32 * len(self.estimates)

    def _draw(self, ax) -> None:
        names = []
        for place, (name, found) in enumerate(self.estimates.items()):
            self._draw_row(place, self.model.parameters[name], found)
            value = measured(found.value, found.low, found.high, typeset_unit(found.unit))
            names.append(f"{name} = {value}")
        ax.axvline(0.0, color=COLOURS["prior"], linewidth=1)
        name_rows(ax, names)
        ax.set_xlabel("change against the prior [%]; pale: the prior's spread")
        tidy(ax)

    def _draw_row(self, place: int, prior, found) -> None:
        """Draw one parameter; an interval that is open at one end extends to the edge."""
        if not prior.value:
            return
        low, value, high = (
            100 * (x / prior.value - 1) for x in (found.low, found.value, found.high)
        )
        if np.isfinite(prior.spread):
            reach = 100 * prior.spread
            self.ax_.barh(
                place, 2 * reach, left=-reach, height=0.6, color=COLOURS["measured"], alpha=0.35
            )
        ends = [x for x in sorted((low, high)) if np.isfinite(x)]
        if len(ends) == 2:
            self.ax_.plot(ends, [place, place], color=COLOURS["extended"], linewidth=2)
        self.ax_.plot(value, place, "o", color=COLOURS["extended"], markersize=6)


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

    def __init__(self, detectability: Detectability):
        self.detectability = detectability

    def plot(self, *, figure: Any = None) -> Self:
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
        name_rows(axes, [cause_name(row.effect, row.target) for row in rows])
        log_axis(axes)
        share = f"{100 * self.detectability.power:.0f} %"
        axes.set_xlabel(f"size, 1 = as large as the motion itself (found in {share})")
        tidy(axes)
        return self


def _draw_row(axes, place, row) -> None:
    from matplotlib.colors import to_rgba

    sizes, powers = np.array(row.curve[1:]).T
    shares = np.abs(sizes - row.curve[0][0]) / max(abs(sizes[-1] - row.curve[0][0]), 1e-300)
    colours = [to_rgba(COLOURS["extended"], 0.15 + 0.85 * power) for power in powers]
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


def plot_detectability(detectability: Detectability, **options: Any) -> DetectabilityDisplay:
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
