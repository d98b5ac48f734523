"""Parameters after a fit, as a forest plot: change against the prior, with intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.inspection.numbers import measured, typeset_unit
from sklearn_pgnn.inspection.panels import panels
from sklearn_pgnn.inspection.style import COLOURS, plain, tidy

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel


class ParametersDisplay:
    """Dots with 95 % intervals: how far each parameter is from its prior value.

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

    def plot(self, *, ax: Any = None) -> Self:
        """Draw the plot.

        For a parameter whose prior is 0, which has no change in percent, only the text is shown.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        ParametersDisplay
            This display, with `ax_` and `figure_`.
        """
        (self.ax_,) = panels(ax, 1, 8.0, 1.0 + 0.32 * len(self.estimates))
        self.figure_ = self.ax_.figure
        names = []
        for place, (name, found) in enumerate(self.estimates.items()):
            self._draw(place, self.model.parameters[name], found)
            value = measured(found.value, found.low, found.high, typeset_unit(found.unit))
            names.append(plain(f"{name} = {value}"))
        self.ax_.axvline(0.0, color=COLOURS["prior"], linewidth=1)
        self.ax_.set_yticks(range(len(names)), names)
        self.ax_.set_ylim(len(names) - 0.5, -0.5)
        self.ax_.set_xlabel("change against the prior [%]; pale: the prior's spread")
        tidy(self.ax_)
        return self

    def _draw(self, place: int, prior, found) -> None:
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
