r"""Detectability: how large an effect must be before these records would show it.

An effect of some size is put into the fitted model and simulated with the records' own inputs and
initial states. The fitted model is then re-tuned to what comes out, without noise. What it leaves,
:math:`\lambda = \sum_w |r_w|^2` in units of the noise, is all that any diagnosis could see: the
noncentrality of the :math:`\chi^2` statistic of the likelihood ratio. With noise drawn on top, the
diagnosis' own rules say how often it would have named a cause.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from sklearn_pgnn.diagnosis.effect_size import has_size, main_field, nothing, sized
from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.readings import reading
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import Evaluation, ShootingWindows, evaluate

#: smallest size looked at, and halvings of the interval (on a logarithmic scale) from there to 1
SMALLEST, HALVINGS = 1e-6, 8
#: a size that cannot be simulated is followed by one so many times smaller
LESS = 10.0
#: steps of re-tuning to a model that is near, and the decrease at which they end
STEPS, TOLERANCE = 5, 1e-2
#: an effect that re-tuning lowers to this share is imitated by it
IMITATED = 0.1
#: lags over which noise is correlated, at most
LAGS = 200


@dataclass(frozen=True)
class Detectable:
    """How well one effect would be seen.

    Parameters
    ----------
    effect, target : str
        Id of the effect, and what it acts on.
    parameter, unit : str
        The quantity that measures its size, and its unit; its other quantities grow in step.
    smallest : float
        Smallest size that is found with the power asked for; NaN if none is.
    curve : tuple of (float, float)
        Sizes and the power there, from where it does nothing to a large effect.
    reason : str
        Why it is never seen; empty if it is.
    found : bool or None
        Whether the diagnosis itself found it at the smallest size, if that was tried.
    """

    effect: str
    target: str
    parameter: str
    unit: str
    smallest: float
    curve: tuple[tuple[float, float], ...]
    reason: str = ""
    found: bool | None = None


@dataclass(frozen=True)
class Detectability:
    """What a rig with its excitation and noise can show.

    Parameters
    ----------
    rows : tuple of Detectable
        One an effect, in the order of the catalogue.
    power : float
        Chance with which the smallest size is found.
    sizes : tuple of float
        Multiples of the smallest size at which `to_frame` tells the power.
    """

    rows: tuple[Detectable, ...]
    power: float
    sizes: tuple[float, ...]

    def to_frame(self) -> pd.DataFrame:
        """Give the table, a row an effect.

        Returns
        -------
        DataFrame
            Effect, target, the smallest size with its parameter and unit, the power at multiples
            of it, why an effect is never seen, and whether the diagnosis itself found it.
        """
        table = []
        for row in self.rows:
            known = ("effect", "target", "parameter", "smallest", "unit")
            line = {name: getattr(row, name) for name in known}
            line |= {f"power at {m:g}x": power for m, power in self._powers(row)}
            table.append(line | {"reason": row.reason, "found": row.found})
        return pd.DataFrame(table)

    def _powers(self, row: Detectable):
        """Interpolate the power at multiples of the smallest size, on a logarithmic scale."""
        (none, _), *seen = row.curve
        strengths = np.log([abs(size - none) for size, _ in seen if size != none])
        powers = [power for size, power in seen if size != none]
        smallest = abs(row.smallest - none)
        for multiple in self.sizes:
            power = np.nan
            if smallest > 0 and powers:
                power = np.interp(np.log(multiple * smallest), strengths, powers, left=np.nan)
            yield multiple, float(power)

    def plot(self, **options):
        """Draw the smallest sizes and the power over the size.

        Parameters
        ----------
        **options
            See `sklearn_pgnn.inspection.DetectabilityDisplay.plot`.

        Returns
        -------
        DetectabilityDisplay
            The picture, drawn.
        """
        return reading("plot_detectability")(self, **options)


@dataclass(frozen=True)
class PowerAnalysis:
    """The fitted model on the records, and the noise, ready to have effects put in.

    Parameters
    ----------
    records : DiagnosisRecords
        The records and the fits.
    white : bool
        Whether noise is taken as white.
    criterion : SelectionCriterion
        When a cause is named.
    n_repeats : int
        Draws of the noise for a power.
    seed : int
        What draws them; the same for every size.
    """

    records: DiagnosisRecords
    white: bool
    criterion: SelectionCriterion
    n_repeats: int
    seed: int

    @property
    def model(self) -> PhysicsModel:
        """The fitted model, extended by the causes found."""
        return self.records.fits["extended"].model

    @property
    def windows(self) -> ShootingWindows:
        """The windows of the diagnosis."""
        return self.records.windows

    def start(self, model: PhysicsModel) -> np.ndarray:
        """Give the windows' initial states of an extension of the fitted model."""
        fitted = self.records.fits["extended"]
        x0 = self.records.problem.states.estimate(model).x[self.windows.starts]
        for i, name in enumerate(fitted.model.states):
            x0[:, list(model.states).index(name)] = fitted.x0[:, i]
        return x0

    def show(self, effect) -> np.ndarray:
        """Return the windows' outputs with an effect in the fitted model; infinite if one diverges.

        Parameters
        ----------
        effect : Effect or None
            The effect, if any.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs)
            The outputs.
        """
        if effect is None:
            return self.windows.y - self.records.fits["extended"].residual
        model = effect.apply(self.model)
        evaluation = evaluate(model, self.windows, self.start(model), ())
        if not np.isfinite(evaluation.squares).all():
            return np.full_like(self.windows.y, np.inf)
        return self.windows.y - evaluation.residual

    def retune(self, windows: ShootingWindows) -> WindowFit:
        """Re-tune the fitted model to other outputs of the same windows."""
        fitted = self.records.fits["extended"]
        values = {f.name: fitted.model.parameters[f.name].value for f in fitted.freedoms}
        freedoms = tuple(replace(f, centre=values[f.name]) for f in fitted.freedoms)
        spread = self.records.problem.states.estimate(fitted.model).spread
        return fit_windows(
            fitted.model,
            windows,
            freedoms,
            fitted.x0,
            spread,
            max_steps=STEPS,
            tolerance=TOLERANCE,
        )

    def without(self, windows: ShootingWindows) -> Evaluation:
        """Give what the fitted model, as it is, leaves of other outputs of the same windows."""
        return evaluate(self.model, windows, self.records.fits["extended"].x0, ())

    def power(self, left: Evaluation) -> float:
        """Give the chance that the rules name a cause that would explain what is left.

        Every block of a window has white noise power and, along the signal that is left, a normal
        error of the noise's strength in that direction.
        """
        residual = self.records.fits["extended"].residual / self.windows.scale
        noise = float(np.nanmean(residual**2))
        along = (
            noise if self.white else _strength_along(residual, left.residual / self.windows.scale)
        )
        size = np.sqrt(left.block_squares.ravel())
        counts = self.windows.sum_blocks(np.isfinite(self.windows.y).astype(float)).sum(-1).ravel()
        rng = np.random.default_rng(self.seed)
        shape = (self.n_repeats, size.size)
        across = noise * rng.chisquare(np.maximum(counts - 1, 1), shape)
        error = np.sqrt(along) * rng.standard_normal(shape)
        before, after = across + (size + error) ** 2, across + error**2
        return float(np.mean(self._is_named(before.sum(axis=1), after.sum(axis=1))))

    def _is_named(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return for every draw whether the criterion names a cause."""
        count = np.isfinite(self.windows.y).sum()
        evidence = count / (2.0 * self._time) * np.log(before / after)
        worth = before - after >= self.criterion.smallest_share * before
        return worth & (evidence > self.criterion.to_name)

    @cached_property
    def _time(self) -> float:
        """The longest autocorrelation time of the outputs' noise, in samples."""
        windows, residual = self.windows, self.records.fits["extended"].residual
        starts = np.searchsorted(windows.starts, np.arange(windows.t.size), side="right")
        return 1.0 if self.white else float(autocorrelation_times(residual, starts).max())


def _strength_along(noise: np.ndarray, signal: np.ndarray) -> float:
    r"""Give the variance of coloured noise along a signal, :math:`s^T\Sigma s/s^T s`.

    With the autocovariance :math:`c` of the noise and the autocorrelation :math:`\rho` of the
    signal it is :math:`\sum_\tau c(\tau)\,\rho(\tau)`, tapered towards long lags.
    """
    noise, signal = np.nan_to_num(noise), np.nan_to_num(signal)
    lags = min(LAGS, len(noise) - 1)
    taper = 1 - np.arange(lags + 1) / (lags + 1)
    covariance = np.array([np.sum(noise[k:] * noise[: len(noise) - k]) for k in range(lags + 1)])
    alike = np.array([np.sum(signal[k:] * signal[: len(signal) - k]) for k in range(lags + 1)])
    both = covariance / np.count_nonzero(noise) * alike / max(alike[0], 1e-300) * taper
    return float(max(both[0] + 2 * both[1:].sum(), 0.01 * both[0]))


# -- one effect ------------------------------------------------------------------------------------


def detect(analysis: PowerAnalysis, cause: Effect, power: float) -> Detectable:
    """Find the smallest size of an effect that the diagnosis would name.

    Parameters
    ----------
    analysis : PowerAnalysis
        The fitted model on the records.
    cause : Effect
        The effect.
    power : float
        Wanted chance of naming it.

    Returns
    -------
    Detectable
        The smallest size and the power over the size.
    """
    of_size = sized(type(cause), cause.target, analysis.model, analysis.records.problem.scales)
    bare = _bare(analysis, cause, of_size)

    def power_of(share):
        return _power(analysis, _injected(analysis, of_size(share), bare))

    low, high = SMALLEST, 1.0
    curve = {share: power_of(share) for share in (low, high)}
    while not np.isfinite(curve[high]) and high > LESS * low:  # too much for the machine
        high /= LESS
        curve[high] = power_of(high)
    if curve[high] >= power > curve[low]:
        for _ in range(HALVINGS):
            middle = float(np.sqrt(low * high))
            curve[middle] = power_of(middle)
            low, high = (low, middle) if curve[middle] >= power else (middle, high)
    known = {share: chance for share, chance in curve.items() if np.isfinite(chance)}
    return _described(analysis, cause, of_size, bare, known, power)


def _bare(analysis: PowerAnalysis, cause: Effect, of_size) -> np.ndarray:
    """Return what the machine shows with an effect of no size.

    That is not always what it shows without: an effect with a memory is something even then, as
    play without width is a lag. Only what comes with the size is to be found.
    """
    kind, target = type(cause), cause.target
    none, least = (
        nothing(kind, target, analysis.model, analysis.records.problem.scales),
        of_size(0.0),
    )
    return analysis.show(least if getattr(least, main_field(kind)) == none else None)


def _injected(analysis: PowerAnalysis, effect, bare) -> ShootingWindows | None:
    """Return the windows with what an effect's size shows; None where a simulation diverges."""
    shown = analysis.show(effect)
    if np.isinf(shown).any() or np.isinf(bare).any():
        return None
    return replace(analysis.windows, y=analysis.show(None) + shown - bare)


def _power(analysis: PowerAnalysis, windows: ShootingWindows | None) -> float:
    """Return the power to find what windows show; NaN where the machine does not stay finite."""
    if windows is None:
        return np.nan
    left = analysis.retune(windows).evaluation
    return analysis.power(left) if np.isfinite(left.squares).all() else np.nan


def _described(analysis, cause, of_size, bare, curve, power) -> Detectable:
    kind, target = type(cause), cause.target
    field = main_field(kind)
    name = of_size(1.0).names()[field]
    unit = of_size(1.0).apply(analysis.model).unit(name)

    def size(share):
        return float(getattr(of_size(share), field))

    found = [share for share in curve if curve[share] >= power]
    none = nothing(kind, target, analysis.model, analysis.records.problem.scales)
    return Detectable(
        effect=kind.id,
        target=target,
        parameter=field,
        unit=unit,
        smallest=size(min(found)) if found else np.nan,
        curve=((none, 0.0), *((size(s), curve[s]) for s in sorted(curve))),
        reason="" if found else _why_not(analysis, of_size, bare, max(curve, default=0.0), field),
    )


def _why_not(analysis: PowerAnalysis, of_size, bare, share, field) -> str:
    """Say why even the largest size that the machine bears is not seen."""
    effect = of_size(share)
    windows = _injected(analysis, effect, bare)
    if windows is None:
        return "however small, the simulation with it leaves the finite numbers"
    before = float(analysis.without(windows).squares.sum())
    fit = analysis.retune(windows)
    unit = effect.apply(analysis.model).unit(effect.names()[field])
    largest = f"even {getattr(effect, field):.3g} {unit}".rstrip()
    noise = float(np.nansum((analysis.records.fits["extended"].residual / windows.scale) ** 2))
    if before < analysis.criterion.smallest_share * noise:
        return f"{largest} hardly moves the outputs: these inputs never bring it to act"
    if fit.squares < IMITATED * before and effect.target in analysis.model.parameters:
        return f"{largest} is within the spread that re-tuning may use"
    if fit.squares < IMITATED * before:
        return f"{largest} is imitated by re-tuning {_moved(analysis, fit)}"
    return f"{largest} stays within the noise"


def _moved(analysis, fit) -> str:
    """Name the parameters that re-tuning moved most, or else the initial states."""
    old = analysis.model.parameters
    shifts = {
        f.name: abs(fit.model.parameters[f.name].value - old[f.name].value) / max(f.scale, 1e-12)
        for f in fit.freedoms
    }
    moved = [name for name, shift in shifts.items() if shift > 0.5 * max(shifts.values())]
    return " and ".join(moved) if max(shifts.values(), default=0.0) > 0.01 else "initial states"


# -- all of them -----------------------------------------------------------------------------------


def detect_all(
    analysis: PowerAnalysis, suspects: Sequence[Effect], power: float
) -> tuple[Detectable, ...]:
    """Find the smallest size of every effect that has one and that the model does not hold yet.

    Parameters
    ----------
    analysis : PowerAnalysis
        The fitted model on the records.
    suspects : sequence of Effect
        The effects.
    power : float
        Wanted chance of naming each.

    Returns
    -------
    tuple of Detectable
        One an effect.
    """
    return tuple(
        detect(analysis, cause, power) for cause in suspects if _fits(analysis.model, cause)
    )


def _fits(model: PhysicsModel, cause: Effect) -> bool:
    if not has_size(type(cause)):
        return False
    try:
        cause.apply(model)
    except ModelError:
        return False
    return True
