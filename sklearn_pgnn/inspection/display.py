"""Plot of a diagnosis: measured outputs, prior and extended model, and the evidence."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import Table
from sklearn_pgnn.diagnosis.free_run import free_runs
from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis
from sklearn_pgnn.inspection.case import model_with_all
from sklearn_pgnn.inspection.evidence import Evidence, find_evidence
from sklearn_pgnn.inspection.numbers import number
from sklearn_pgnn.inspection.style import COLOURS, LABELS, label, plain, shown_figure, tidy
from sklearn_pgnn.simulation.simulate import simulate_records
from sklearn_pgnn.trajectories import read_records

#: points drawn of a cloud, and bins of its median
CLOUD, BINS = 4000, 45


@dataclass(frozen=True)
class Comparison:
    """A record and its simulations by the models, the best last; times [s], units by output."""

    title: str
    t: np.ndarray
    outputs: dict[str, str]
    measured: np.ndarray | None
    simulated: dict[str, np.ndarray]


class DiagnosisDisplay:
    """Plot of a diagnosis: measured outputs, prior and extended model, and the evidence.

    Use `from_estimator` to create one.

    Parameters
    ----------
    comparison : Comparison
        A record and its simulations by the models.
    evidence : sequence of Evidence, default=()
        The evidence for every named cause.

    Attributes
    ----------
    figure_ : matplotlib.figure.Figure
        The figure, once drawn.
    axes_ : ndarray of matplotlib.axes.Axes
        Axes of the curves and of the errors of every output, then of the evidence.

    Examples
    --------
    >>> t = np.linspace(0, 10, 101)
    >>> runs = {"prior": 0.8 * np.sin(t)[:, None], "extended": np.sin(t)[:, None]}
    >>> seen = Comparison("record 1, free run", t, {"v": "m/s"}, np.sin(t)[:, None], runs)
    >>> len(DiagnosisDisplay(seen).plot().axes_)  # curves, and errors below
    2
    """

    def __init__(self, comparison: Comparison, evidence: Any = ()):
        self.comparison = comparison
        self.evidence = tuple(evidence)

    @classmethod
    def from_estimator(
        cls,
        diagnosis: ModelDiagnosis,
        X: Table = None,
        y: Table = None,
        *,
        kind: str = "free_run",
        record: int | None = None,
        figure: Any = None,
    ) -> Self:
        """Plot a fitted diagnosis.

        Parameters
        ----------
        diagnosis : ModelDiagnosis
            The fitted diagnosis.
        X, y : DataFrame or array, optional
            Records to simulate; by default those it was fitted on.
        kind : {"free_run", "windows"}, default="free_run"
            Whether a model simulates the whole record from its initial state only, or restarts
            from the record in every window of the diagnosis.
        record : int, optional
            Number of the record; by default one with a typical error.
        figure : matplotlib.figure.Figure, optional
            Where to draw; by default a new figure of pyplot, which ``plt.show()`` shows.

        Returns
        -------
        DiagnosisDisplay
            The plotted display.
        """
        check_is_fitted(diagnosis)
        evidence = [find_evidence(diagnosis, cause) for cause in diagnosis.causes_]
        return cls(compare(diagnosis, X, y, kind=kind, record=record), evidence).plot(figure=figure)

    def plot(self, *, figure: Any = None) -> Self:
        """Draw the plot.

        Parameters
        ----------
        figure : matplotlib.figure.Figure, optional
            Where to draw; by default a new figure of pyplot, which ``plt.show()`` shows.

        Returns
        -------
        DiagnosisDisplay
            This display, with `figure_` and `axes_`.
        """
        n_outputs, shown = len(self.comparison.outputs), len(self.evidence)
        rows = 2 * n_outputs + shown
        height = 3.6 * n_outputs + 3.2 * shown
        self.figure_ = shown_figure(8.0, height) if figure is None else figure
        heights = [2.2, 1.3] * n_outputs + [3.2] * shown
        self.axes_ = self.figure_.subplots(rows, height_ratios=heights, squeeze=False)[:, 0]
        draw_comparison(self.axes_[: 2 * n_outputs], self.comparison)
        for axes, evidence in zip(self.axes_[2 * n_outputs :], self.evidence, strict=True):
            draw_evidence(axes, evidence)
        return self


def plot_diagnosis(diagnosis: ModelDiagnosis) -> DiagnosisDisplay:
    """Plot a fitted diagnosis on the records it was fitted on.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        The fitted diagnosis.

    Returns
    -------
    DiagnosisDisplay
        The plotted display.

    Examples
    --------
    >>> from sklearn_pgnn import ModelDiagnosis, datasets, effects
    >>> friction = effects.CoulombFriction("v", level=1.0)
    >>> hidden = datasets.make_cart(3, effect=friction, sample_rate=50)
    >>> diagnosis = ModelDiagnosis(hidden.prior, catalogue=["coulomb_friction"], window_length=0.5)
    >>> _ = diagnosis.fit(hidden.X, hidden.y)
    >>> plot_diagnosis(diagnosis).axes_[-1].get_xlabel()
    'v [m/s]'
    """
    return DiagnosisDisplay.from_estimator(diagnosis)


# -- what is compared ------------------------------------------------------------------------------


def compare(diagnosis, X=None, y=None, *, kind="free_run", record=None) -> Comparison:
    """Return one record with its simulations by the prior and by the model with all found.

    By default the records are those of the fit, and the one is one with a typical error; `kind` is
    ``"free_run"`` or ``"windows"``.
    """
    if kind not in ("free_run", "windows"):
        raise ValueError(f"kind: expected 'free_run' or 'windows', got {kind!r}.")
    if X is not None and kind == "windows":
        raise ValueError("kind: 'windows' shows the records of the fit; leave X out.")
    return _of_fit(diagnosis, kind, record) if X is None else _of_new(diagnosis, X, y, record)


def _of_fit(diagnosis, kind, record) -> Comparison:
    records = diagnosis.records_
    windows = records.windows
    record = typical(records) if record is None else _checked(record, len(records.names))
    rows = slice(windows.bounds[record], windows.bounds[record + 1])
    models = ("prior", records.best)
    if kind == "windows":
        simulated = {which: (windows.y - records.fits[which].residual)[rows] for which in models}
        how = f"restarted from the record every {number(diagnosis.window_, 3)} s"
    else:
        simulated = {which: free_runs(records, which)[record].y for which in models}
        how = "free run"
    title = f"{called(records.names[record], record, len(records.names))}, {how}"
    return Comparison(title, windows.t[rows], _outputs(diagnosis), windows.y[rows], simulated)


def _of_new(diagnosis, X, y, record) -> Comparison:
    records = read_records(diagnosis.model, X, y, time_column=diagnosis.time_column)
    record = _checked(record or 0, len(records))
    chosen = records[record]
    best = diagnosis.records_.best
    models = {"prior": diagnosis.model, best: model_with_all(diagnosis)}
    simulated = {
        which: simulate_records(model, (chosen,), **diagnosis.extended_model_.simulation)
        for which, model in models.items()
    }
    title = f"{called(chosen.name, record, len(records))}, free run"
    return Comparison(title, chosen.t, _outputs(diagnosis), chosen.y, simulated)


def called(name: str, record: int, count: int) -> str:
    """Return the name of a record; one with only a number gets its position.

    >>> called("3", 3, 6), called("monday", 0, 2)
    ('record 4 of 6', "record 'monday' (1 of 2)")
    """
    place = f"{record + 1} of {count}"
    return f"record {place}" if str(name).isdigit() else f"record {name!r} ({place})"


def typical(records) -> int:
    """Return the record whose error under the prior is the median."""
    bounds, squares = records.windows.bounds, (records.fits["prior"].residual) ** 2
    scaled = squares / records.windows.scale**2
    errors = [np.nanmean(scaled[a:b]) for a, b in pairwise(bounds)]
    return int(np.argsort(errors)[len(errors) // 2])


def _checked(record: int, count: int) -> int:
    if not 0 <= record < count:
        raise ValueError(f"record: expected a number from 0 to {count - 1}, got {record!r}.")
    return int(record)


def _outputs(diagnosis) -> dict[str, str]:
    return {name: diagnosis.model.unit(name) for name in diagnosis.model.outputs}


# -- drawing ---------------------------------------------------------------------------------------


def draw_comparison(axes, comparison: Comparison) -> None:
    """Draw every output's curves, and its errors below them."""
    t, known = comparison.t, comparison.measured
    for i, (name, unit) in enumerate(comparison.outputs.items()):
        curves, errors = axes[2 * i], axes[2 * i + 1]
        if known is not None:
            _curve(curves, t, known[:, i], "measured", 3.5)
        for which, simulated in comparison.simulated.items():
            _curve(curves, t, simulated[:, i], which, 1.2)
            if known is not None:
                _curve(errors, t, known[:, i] - simulated[:, i], which, 0.9)
        curves.set_ylim(*_in_sight(comparison, i))
        for panel, title in ((curves, name), (errors, "error")):
            panel.set_ylabel(label(title, unit))
            tidy(panel)
        errors.sharex(curves)
        curves.tick_params(labelbottom=False)
    axes[0].set_title(plain(comparison.title), fontsize=9, loc="left")
    axes[0].legend(fontsize=8, ncols=3, loc="upper right", framealpha=0.9)
    axes[-1].set_xlabel("t [s]")


def _in_sight(comparison, i):
    """Limit the axis so that a diverging model does not hide the rest, with room for a legend."""
    *_, best = comparison.simulated.values()
    known = best if comparison.measured is None else comparison.measured
    low, high = np.nanmin(known[:, i]), np.nanmax(known[:, i])
    reach = (high - low) or 1.0
    curves = np.concatenate([known[:, i], *(y[:, i] for y in comparison.simulated.values())])
    curves = np.clip(curves[np.isfinite(curves)], low - reach, high + reach)
    low, high = curves.min(), curves.max()
    return low - 0.05 * reach, high + 0.25 * reach


def _curve(axes, x, y, which, width):
    axes.plot(x, y, color=COLOURS[which], linewidth=width, label=LABELS[which])


def draw_evidence(axes, evidence: Evidence) -> None:
    """Draw the evidence for a cause: points of the records, their median, the cause's law."""
    if evidence.points is not None:
        draw_points(axes, *evidence.points)
    for line in evidence.lines:
        colour = COLOURS[line.whose]
        axes.plot(line.x, line.y, color=colour, linewidth=1.8, label=plain(line.label))
    if evidence.points is not None:
        axes.set_ylim(*limits(evidence.points[1], evidence.lines))
    axes.set_xlabel(plain(evidence.x_label))
    axes.set_ylabel(plain(evidence.y_label))
    axes.set_title(plain(evidence.title), fontsize=9, loc="left")
    axes.legend(fontsize=8, markerscale=2)
    tidy(axes)


def known_points(x, y) -> tuple[np.ndarray, np.ndarray]:
    """Return the points whose two coordinates are finite."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    good = np.isfinite(x) & np.isfinite(y)
    return x[good], y[good]


def draw_points(axes, x, y) -> None:
    """Draw a thinned scatter of points, and its medians over bins."""
    x, y = known_points(x, y)
    few = slice(None, None, max(1, x.size // CLOUD))
    size, alpha = (2, 0.35) if x.size > 500 else (4, 0.8)
    style = {"color": COLOURS["points"], "markersize": size, "alpha": alpha}
    axes.plot(x[few], y[few], ".", **style, label="records")
    if np.all(np.diff(x) > 0):
        return
    centres, medians = binned_median(x, y)
    axes.plot(centres, medians, "o", color=COLOURS["medians"], markersize=3, label="their median")


def binned_median(x, y, bins: int = BINS) -> tuple[np.ndarray, np.ndarray]:
    """Return the median of `y` over equal bins of `x` that hold enough points.

    >>> x = np.linspace(0, 1, 1001)
    >>> centres, medians = binned_median(x, 3 * x, bins=10)
    >>> bool(np.allclose(medians, 3 * centres, atol=0.01))
    True
    """
    edges = np.linspace(x.min(), x.max(), bins + 1)
    which = np.clip(np.digitize(x, edges) - 1, 0, bins - 1)
    enough = max(5, 0.002 * x.size)
    full = [b for b in range(bins) if np.count_nonzero(which == b) >= enough]
    centres = np.array([np.median(x[which == b]) for b in full])
    return centres, np.array([np.median(y[which == b]) for b in full])


def limits(y, lines):
    """Return axis limits that may cut off the farthest points, but never a line."""
    parts = [np.nanpercentile(y, [1.0, 99.0]), *(line.y for line in lines)]
    everything = np.concatenate(parts)
    low, high = np.nanmin(everything), np.nanmax(everything)
    reach = 0.12 * (high - low) or 1.0
    return low - reach, high + reach
