"""Measured and simulated curves with their fit in percent, as MATLAB's ``compare`` draws them."""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np

from sklearn_pgnn.annotations import ArrayLike, Table
from sklearn_pgnn.inspection.estimator_runs import run_estimators
from sklearn_pgnn.inspection.fit_percentage import fit_percentage
from sklearn_pgnn.inspection.panels import panels
from sklearn_pgnn.inspection.style import COLOURS, LABELS, label, plain, tidy

#: colours of models that have none of their own
CYCLE = ("#1766ad", "#d1600b", "#5b8c3a", "#8a4fa3", "#a3341f", "#3f8f8f")
_OWN = {LABELS[which]: colour for which, colour in COLOURS.items() if which in LABELS}


class SimulationDisplay:
    """Curves of one output over one record: measured, and simulated by one or several models.

    Parameters
    ----------
    t : ndarray of shape (n_samples,)
        Time [s].
    measured : ndarray of shape (n_samples,)
        Measured output [unit of the output].
    simulated : mapping of str to ndarray of shape (n_samples,)
        Free-run output of each model.
    output, unit, record : str, default=""
        The output, its unit, and the record's name.

    Attributes
    ----------
    ax_ : matplotlib.axes.Axes
        The axes, once drawn.
    figure_ : matplotlib.figure.Figure
        Their figure.
    fits_ : dict of str to float
        The fit of every model [%], see `fit_percentage`.

    Examples
    --------
    >>> t = np.linspace(0, 10, 101)
    >>> display = SimulationDisplay(t, np.sin(t), {"a model": 0.9 * np.sin(t)})
    >>> round(display.fits_["a model"], 1)
    89.6
    """

    def __init__(
        self,
        t: ArrayLike,
        measured: ArrayLike,
        simulated: Mapping,
        *,
        output: str = "",
        unit: str = "",
        record: str = "",
    ):
        self.t, self.measured, self.simulated = t, measured, dict(simulated)
        self.output, self.unit, self.record = output, unit, record
        self.fits_ = {
            name: float(fit_percentage(measured, curve)[0])
            for name, curve in self.simulated.items()
        }

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: Table = None,
        y: Table = None,
        *,
        output: str | None = None,
        record: int = 0,
        ax: Any = None,
    ) -> Self:
        """Plot the simulations of an estimator, a model, or several of them on a record.

        Parameters
        ----------
        estimator : fitted estimator, PhysicsModel, or mapping of str to them
            A fitted regressor whose parameter is a `PhysicsModel`, the model itself, or several
            by name. A `ModelDiagnosis` without X shows its three models on its own records.
        X, y : DataFrame or array, optional
            The records.
        output : str, optional
            Which output; by default the first.
        record : int, default=0
            Number of the record.
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        SimulationDisplay
            The plotted display.

        Raises
        ------
        ValueError
            If the output or the record is unknown, or the records are missing.
        """
        runs = run_estimators(estimator, X, y)
        column = output_column(runs.model, output)
        if not 0 <= record < len(runs.names):
            raise ValueError(
                f"record: expected a number from 0 to {len(runs.names) - 1}, got {record!r}."
            )
        name = list(runs.model.outputs)[column]
        display = cls(
            runs.t[record],
            runs.measured[record][:, column],
            {which: curves[record][:, column] for which, curves in runs.simulated.items()},
            output=name,
            unit=runs.model.unit(name),
            record=f"{runs.names[record]!r} ({record + 1} of {len(runs.names)})",
        )
        return display.plot(ax=ax)

    def plot(self, *, ax: Any = None) -> Self:
        """Draw the plot.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        SimulationDisplay
            This display, with `ax_` and `figure_`.
        """
        (self.ax_,) = panels(ax, 1, 8.0, 3.6)
        self.figure_ = self.ax_.figure
        self.ax_.plot(
            self.t, self.measured, color=COLOURS["measured"], linewidth=3.5, label="measured"
        )
        free = iter(CYCLE * (1 + len(self.simulated) // len(CYCLE)))
        for name, curve in self.simulated.items():
            colour = _OWN.get(name) or next(free)
            text = f"{plain(name)}: fit {self.fits_[name]:.1f} %"
            self.ax_.plot(self.t, curve, color=colour, linewidth=1.2, label=text)
        self._limit()
        self.ax_.set_xlabel("t [s]")
        self.ax_.set_ylabel(label(self.output, self.unit))
        title = f"record {self.record}, free run" if self.record else "free run"
        self.ax_.set_title(plain(title), fontsize=9, loc="left")
        self.ax_.legend(fontsize=8)
        tidy(self.ax_)
        return self

    def _limit(self) -> None:
        """Limit the axis so that a diverging run does not hide the rest."""
        low, high = np.nanmin(self.measured), np.nanmax(self.measured)
        reach = (high - low) or 1.0
        bottom, top = self.ax_.get_ylim()
        self.ax_.set_ylim(max(bottom, low - reach), min(top, high + reach))


def output_column(model, output: str | None) -> int:
    """Return the column of an output, by default of the first."""
    names = list(model.outputs)
    if output is None:
        return 0
    if output not in names:
        raise ValueError(f"output: expected one of {', '.join(names)}, got {output!r}.")
    return names.index(output)
