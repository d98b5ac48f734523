"""Simulations and residuals beside the records, as MATLAB's ``compare`` and ``resid`` draw them."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from scipy.stats import binom, norm

from sklearn_pgnn.annotations import ArrayLike, Table
from sklearn_pgnn.inspection.absorbed_noise import expected_autocorrelation
from sklearn_pgnn.inspection.runs import fit_percentage, run_estimators
from sklearn_pgnn.inspection.style import COLOURS, LABELS, AxesDisplay, label, panels, plain, tidy

#: colours of models that have none of their own
CYCLE = ("#1766ad", "#d1600b", "#5b8c3a", "#8a4fa3", "#a3341f", "#3f8f8f")
_OWN = {LABELS[which]: colour for which, colour in COLOURS.items() if which in LABELS}
#: probability with which a value of white residuals lies inside the band
INSIDE = 0.99


class SimulationDisplay(AxesDisplay):
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

    def _draw(self, ax) -> None:
        ax.plot(self.t, self.measured, color=COLOURS["measured"], linewidth=3.5, label="measured")
        free = iter(CYCLE * (1 + len(self.simulated) // len(CYCLE)))
        for name, curve in self.simulated.items():
            colour = _OWN.get(name) or next(free)
            text = f"{plain(name)}: fit {self.fits_[name]:.1f} %"
            ax.plot(self.t, curve, color=colour, linewidth=1.2, label=text)
        self._limit()
        ax.set_xlabel("t [s]")
        ax.set_ylabel(label(self.output, self.unit))
        title = f"record {self.record}, free run" if self.record else "free run"
        ax.set_title(plain(title), fontsize=9, loc="left")
        ax.legend(fontsize=8)
        tidy(ax)

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


def correlation(one: Sequence, other: Sequence, lags) -> np.ndarray:
    r"""Return the correlation of two signals over records, at several lags.

    .. math:: r(k) = \frac{\sum_t a_t b_{t+k}}{\sqrt{\sum_t a_t^2 \sum_t b_t^2}}

    Means over all records are subtracted; missing samples count as the mean.

    `lags` are numbers of samples by which `other` lags. The correlation lies between -1 and 1, and
    is zero where a signal never changes.
    """
    one, other = _centred(one), _centred(other)
    power = np.sqrt(sum(a @ a for a in one) * sum(b @ b for b in other))
    sums = [sum(_product(a, b, k) for a, b in zip(one, other, strict=True)) for k in lags]
    return np.array(sums) / power if power > 0 else np.zeros(len(sums))


def _centred(signals) -> list[np.ndarray]:
    mean = np.nanmean(np.concatenate(signals))
    return [np.nan_to_num(signal - mean) for signal in signals]


def _product(a, b, lag: int) -> float:
    if abs(lag) >= a.size:
        return 0.0
    return float(a[: a.size - lag] @ b[lag:] if lag >= 0 else a[-lag:] @ b[:lag])


class ResidualDisplay:
    """Autocorrelation of the residuals of an output, and their correlation with every input.

    Parameters
    ----------
    residuals : sequence of ndarray of shape (n_samples,)
        Measured minus simulated, record by record [unit of the output].
    inputs : mapping of str to sequence of ndarray of shape (n_samples,)
        The inputs, record by record.
    output : str, default=""
        The output.
    n_lags : int, default=25
        Largest lag [samples].
    expected : array-like of shape (n_lags,), optional
        Autocorrelation of white residuals from a lag of 1 on; by default zero. It is below zero
        where a fit has absorbed a part of the noise.

    Attributes
    ----------
    lags_ : ndarray of shape (2 * n_lags + 1,)
        Lags [samples]; at positive lags the residual comes later.
    autocorrelation_ : ndarray of shape (2 * n_lags + 1,)
        Autocorrelation of the residuals.
    cross_correlation_ : dict of str to ndarray of shape (2 * n_lags + 1,)
        Correlation of every input with the residuals. At positive lags it indicates dynamics that
        the model lacks, at negative lags feedback.
    expected_ : ndarray of shape (2 * n_lags + 1,)
        Autocorrelation of white residuals.
    band_ : float
        Half-width of the band about `expected_`, or about zero for an input, within which white
        residuals lie with a probability of 99 %.
    axes_ : ndarray of matplotlib.axes.Axes
        Axes of the autocorrelation, then one per input; once drawn.
    figure_ : matplotlib.figure.Figure
        Their figure.

    Examples
    --------
    >>> noise = np.random.default_rng(0).normal(size=2000)
    >>> display = ResidualDisplay([noise], {}, n_lags=20)
    >>> bool(display.is_white())
    True
    """

    def __init__(
        self,
        residuals: Sequence[ArrayLike],
        inputs: Mapping,
        *,
        output: str = "",
        n_lags: int = 25,
        expected: ArrayLike | None = None,
    ):
        self.residuals, self.inputs = list(residuals), dict(inputs)
        self.output, self.n_lags = output, int(n_lags)
        self.lags_ = np.arange(-self.n_lags, self.n_lags + 1)
        self.autocorrelation_ = correlation(self.residuals, self.residuals, self.lags_)
        later = np.zeros(self.n_lags) if expected is None else np.asarray(expected, dtype=float)
        self.expected_ = np.concatenate([later[::-1], [1.0], later])
        self.cross_correlation_ = {
            name: correlation(signal, self.residuals, self.lags_)
            for name, signal in self.inputs.items()
        }
        count = sum(np.isfinite(r).sum() for r in self.residuals)
        self.band_ = float(norm.ppf((1 + INSIDE) / 2) / np.sqrt(max(count, 1)))

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: Table = None,
        y: Table = None,
        *,
        output: str | None = None,
        n_lags: int = 25,
        ax: Any = None,
    ) -> Self:
        """Plot the residuals of an estimator or a model.

        For a `ModelDiagnosis` without X, these are the residuals of its extended model over the
        windows on which it was judged; otherwise they are the errors of the free run.

        Parameters
        ----------
        estimator : fitted estimator or PhysicsModel
            A fitted regressor whose parameter is a `PhysicsModel`, or the model itself.
        X, y : DataFrame or array, optional
            The records.
        output : str, optional
            Which output; by default the first.
        n_lags : int, default=25
            Largest lag [samples].
        ax : array-like of matplotlib.axes.Axes, optional
            Where to draw: one for the autocorrelation, and one per input.

        Returns
        -------
        ResidualDisplay
            The plotted display.

        Raises
        ------
        ValueError
            If the output is unknown, the records are missing, or the number of axes is wrong.
        """
        runs = run_estimators(estimator, X, y)
        column = output_column(runs.model, output)
        if X is None:
            found = estimator.records_
            left = found.fits[found.best].residual[:, column]
            residuals = np.split(left, found.windows.bounds[1:-1])
            expected = expected_autocorrelation(found, found.fits[found.best], n_lags)[:, column]
        else:
            (simulated,) = runs.simulated.values()
            pairs = zip(runs.measured, simulated, strict=True)
            residuals, expected = [(y - yhat)[:, column] for y, yhat in pairs], None
        inputs = {name: [u[:, i] for u in runs.u] for i, name in enumerate(runs.model.inputs)}
        about: dict[str, Any] = {"output": list(runs.model.outputs)[column], "n_lags": n_lags}
        return cls(residuals, inputs, expected=expected, **about).plot(ax=ax)

    def is_white(self) -> bool:
        """Return whether the number of autocorrelations outside the band is that of white noise.

        Returns
        -------
        bool
            Whether no more lie outside than in 99 of 100 cases of white residuals.
        """
        off = (self.autocorrelation_ - self.expected_)[self.n_lags + 1 :]
        most = binom.ppf(INSIDE, off.size, 1 - INSIDE)
        return bool((np.abs(off) > self.band_).sum() <= most)

    def plot(self, *, ax: Any = None) -> Self:
        """Draw the plot.

        Parameters
        ----------
        ax : array-like of matplotlib.axes.Axes, optional
            Where to draw: one for the autocorrelation, and one an input.

        Returns
        -------
        ResidualDisplay
            This display, with `axes_` and `figure_`.
        """
        self.axes_ = panels(ax, 1 + len(self.inputs), 8.0, 2.4)
        self.figure_ = self.axes_[0].figure
        about = plain(self.output or "the output")
        title = f"residuals of {about}: autocorrelation"
        self._stems(self.axes_[0], self.autocorrelation_, title, self.expected_)
        for axes, (name, values) in zip(
            self.axes_[1:], self.cross_correlation_.items(), strict=True
        ):
            self._stems(axes, values, f"from {plain(name)} to the residuals of {about}")
        self.axes_[-1].set_xlabel("lag [samples]")
        return self

    def _stems(self, axes, values, title: str, about=0.0) -> None:
        low, high = (np.broadcast_to(about + b, values.shape) for b in (-self.band_, self.band_))
        axes.fill_between(self.lags_, low, high, color=COLOURS["measured"], alpha=0.35, linewidth=0)
        axes.vlines(self.lags_, 0.0, values, color=COLOURS["extended"], linewidth=1.2)
        axes.plot(self.lags_, values, "o", color=COLOURS["extended"], markersize=3)
        axes.axhline(0.0, color=COLOURS["medians"], linewidth=0.6)
        axes.set_title(f"{title} (band: {INSIDE:.0%} of white ones)", fontsize=9, loc="left")
        axes.set_ylabel("correlation")
        tidy(axes)


def resid(estimator: Any, X: Table = None, y: Table = None, **options: Any) -> ResidualDisplay:
    """Plot whiteness and cross-correlation of residuals, under the name used by MATLAB.

    Parameters
    ----------
    estimator : fitted estimator or PhysicsModel
        The estimator or model that leaves the residuals.
    X, y : DataFrame or array, optional
        The records.
    **options
        See `ResidualDisplay.from_estimator`.

    Returns
    -------
    ResidualDisplay
        The plotted display.

    Examples
    --------
    >>> from sklearn_pgnn import datasets, systems
    >>> hidden = datasets.make_cart(1, duration=5.0, random_state=0)
    >>> display = resid(systems.cart_on_spring(), hidden.X, hidden.y)
    >>> len(display.lags_) == len(display.cross_correlation_["force"])
    True
    """
    return ResidualDisplay.from_estimator(estimator, X, y, **options)
