"""The power of a diagnosis: how often its criterion names an effect added to a fitted model."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times, white_power
from sklearn_pgnn.estimation.budgets import COARSER, FORGOTTEN, STEPS, TOLERANCE
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords
from sklearn_pgnn.estimation.held_out import make_folds, record_of, segments, stretches
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.led_states import initial_states, start_values
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import Evaluation, ShootingWindows, evaluate


@dataclass(frozen=True)
class Noise:
    """Noise of the outputs: variance, counts and times as of `Residuals`, (n_outputs,)."""

    power: np.ndarray
    counts: np.ndarray
    times: np.ndarray

    @classmethod
    def of(
        cls, residual: np.ndarray, segment: np.ndarray, resolution: np.ndarray, white: bool
    ) -> "Noise":
        """Return the noise with the power, not below the resolution, and the times of residuals."""
        counts = np.isfinite(residual).sum(axis=0).astype(float)
        power = np.nansum(residual**2, axis=0) / np.maximum(counts, 1.0) + resolution**2
        ones = np.ones(counts.size)
        return cls(power, counts, ones if white else autocorrelation_times(residual, segment))

    def draws(
        self,
        size: np.ndarray,
        times: np.ndarray,
        along: np.ndarray,
        rng: np.random.Generator,
        count: int,
    ) -> list[tuple[Residuals, Residuals]]:
        r"""Draw the noise on top of a signal.

        The squares of a signal of norm :math:`s` in noise of variance :math:`\sigma^2` on :math:`n`
        samples are those of the noise orthogonal to the signal, :math:`\sigma^2 \chi^2_{n-1}`, and
        those along it, :math:`(s + e)^2` with a normal error :math:`e` of the variance that the
        noise has in this direction. The autocovariances of signal and noise add up, and so do their
        autocorrelation times, weighted by their squares.
        """
        before, after = self._draw_squares(size, along, rng, count)
        both = self._times_with(size, times)
        return [
            (Residuals(b, self.counts, both), Residuals(a, self.counts, self.times))
            for b, a in zip(before, after, strict=True)
        ]

    def likelihood_ratios(
        self,
        size: np.ndarray,
        times: np.ndarray,
        along: np.ndarray,
        rng: np.random.Generator,
        count: int,
    ) -> np.ndarray:
        """Return the `log_likelihood_ratio` of models without and with a signal, for every draw."""
        before, after = self._draw_squares(size, along, rng, count)
        counted = self.counts / (2.0 * np.maximum(self._times_with(size, times), self.times))
        measured = (self.counts > 0) & (self.power > 0)
        return np.log(before[:, measured] / after[:, measured]) @ counted[measured]

    def _draw_squares(
        self, size: np.ndarray, along: np.ndarray, rng: np.random.Generator, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the squares without a model of the signal, and with it, by draw and output."""
        shape = (count, size.size)
        across = self.power * rng.chisquare(np.maximum(self.counts - 1.0, 1.0), shape)
        error = np.sqrt(along) * rng.standard_normal(shape)
        return across + (size + error) ** 2, across + error**2

    def _times_with(self, size: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the autocorrelation times of the noise with a signal."""
        squares = self.counts * self.power
        whole = np.maximum(squares + size**2, np.finfo(float).tiny)
        return (squares * self.times + size**2 * times) / whole


@dataclass(frozen=True)
class _Seen:
    """A signal over windows or in free run, and the noise in which it is to be detected."""

    noise: Noise
    residual: np.ndarray
    signal: np.ndarray
    segment: np.ndarray

    @property
    def measured(self) -> np.ndarray:
        return np.where(np.isfinite(self.residual), self.signal, 0.0)

    @property
    def along(self) -> np.ndarray:
        """The variance of the noise along the signal, by output."""
        noise = self.noise
        columns = zip(self.residual.T, self.measured.T, noise.times, noise.power, strict=True)
        return np.array(
            [strength_along(r, s, time) if time > 1.0 else power for r, s, time, power in columns]
        )

    def draws(self, rng: np.random.Generator, count: int) -> list[tuple[Residuals, Residuals]]:
        known = np.where(np.isfinite(self.residual), self.signal, np.nan)
        size, times = (
            np.linalg.norm(self.measured, axis=0),
            autocorrelation_times(known, self.segment),
        )
        return self.noise.draws(size, times, self.along, rng, count)

    @property
    def overdispersion(self) -> float:
        """Overdispersion along the signal beyond the autocorrelation times, at least 1."""
        weight = (self.measured**2).sum(axis=0)
        counted = self.noise.power * self.noise.times
        total = float(weight.sum())
        return max(1.0, float(weight @ (self.along / counted)) / total) if total > 0.0 else 1.0


def strength_along(noise: np.ndarray, signal: np.ndarray, time: float) -> float:
    r"""Return the variance of coloured noise along a signal, :math:`s^T\Sigma s/s^T s`.

    With the autocovariance :math:`c` of the noise and the autocorrelation :math:`\rho` of the
    signal it is :math:`\sum_k c(k)\,\rho(k)`, tapered over the correlation length of the noise.
    """
    known, noise = int(np.count_nonzero(np.isfinite(noise))), np.nan_to_num(noise)
    power = float(signal @ signal)
    if not (known and power > 0.0):
        return float(noise @ noise) / max(known, 1)
    lags = min(int(np.ceil(FORGOTTEN * time)), noise.size - 1)
    total = 0.0
    for lag in range(lags + 1):
        rest = noise.size - lag
        covariance = float(noise[lag:] @ noise[:rest]) / known
        alike = float(signal[lag:] @ signal[:rest]) / power
        total += (2.0 if lag else 1.0) * (1.0 - lag / (lags + 1)) * covariance * alike
    return max(total, 0.0)


@dataclass(frozen=True)
class PowerAnalysis:
    """The fitted model on the records, and the noise, drawn alike for every size of an effect."""

    records: DiagnosisRecords
    white: bool
    criterion: SelectionCriterion
    n_repeats: int
    seed: int

    def __sizeof__(self) -> int:
        """Return the bytes with those of its arrays, by which joblib sends it to a cluster once."""
        records, windows = self.records, self.records.windows
        arrays = [windows.t, windows.u, windows.y, records.states]
        arrays += [fit.residual for fit in records.fits.values()]
        return object.__sizeof__(self) + sum(array.nbytes for array in arrays)

    @property
    def model(self) -> PhysicsModel:
        """The fitted model, extended by the causes found."""
        return self.records.fits["extended"].model

    @property
    def windows(self) -> ShootingWindows:
        """The windows of the diagnosis."""
        return self.records.windows

    def start(self, model: PhysicsModel) -> np.ndarray:
        """Return the windows' initial states of an extension of the fitted model."""
        fitted = self.records.fits["extended"]
        x0 = start_values(model, self.windows, self.records.problem.states.values(model))
        for i, name in enumerate(fitted.model.states):
            x0[:, list(model.states).index(name)] = fitted.x0[:, i]
        return x0

    # -- what an effect shows ------------------------------------------------------------------

    def windows_with(self, effect: Effect, bare: Effect | None) -> ShootingWindows | None:
        """Return the windows with the outputs that an effect of some size causes, without noise."""
        shown = [self._evaluate(each) for each in (None, effect, bare)]
        if not all(np.isfinite(each.squares).all() for each in shown):
            return None
        alone, whole, least = (self.windows.y - each.residual for each in shown)
        return replace(self.windows, y=alone + whole - least)

    def _evaluate(self, effect: Effect | None) -> Evaluation:
        model = self.model if effect is None else effect.apply(self.model)
        return evaluate(model, self.windows, self.start(model), ())

    def retune(self, windows: ShootingWindows) -> WindowFit:
        """Re-tune the fitted model to other outputs of the same windows."""
        fitted = self.records.fits["extended"]
        values = {f.name: fitted.model.parameters[f.name].value for f in fitted.freedoms}
        freedoms = tuple(replace(f, centre=values[f.name]) for f in fitted.freedoms)
        return fit_windows(
            fitted.model,
            windows,
            freedoms,
            fitted.x0,
            self.records.problem.states.estimate(fitted.model).spread,
            max_steps=2 * STEPS,
            tolerance=COARSER**2 * TOLERANCE,
        )

    def moves_outputs(self, windows: ShootingWindows) -> bool:
        """Return whether other outputs of the windows differ by more than the noise hides."""
        residual, noise = self._residual(windows, self.model, self.start(self.model)), self._noise
        changed = np.nansum(residual**2, axis=0)
        return bool((changed >= self.criterion.smallest_share * noise.counts * noise.power).any())

    # -- the power -----------------------------------------------------------------------------

    def power(self, effect: Effect, bare: Effect | None = None, retuned: bool = True) -> float:
        """Return the probability that the criterion names an effect."""
        windows = self.windows_with(effect, bare)
        if windows is None:
            return np.nan
        model, x0 = self.model, self.start(self.model)
        if retuned:
            fit = self.retune(windows)
            if not fit.usable:
                return np.nan
            model, x0 = fit.model, fit.x0
        over_windows = self._residual(windows, model, x0)
        with np.errstate(invalid="ignore"):
            shown = self._own_run + self._free_run(effect) - self._free_run(bare)
            in_free_run = (shown - self._runs(model, x0)) / self.windows.scale
        in_free_run = np.where(self._tells, in_free_run, over_windows)
        if self._tells.any() and not np.isfinite(in_free_run[self._inside]).all():
            return np.nan
        n_added = len(effect.apply(self.model).states) - len(self.model.states)
        return float(np.mean(list(self._named(over_windows, in_free_run, n_added))))

    def _named(
        self, over_windows: np.ndarray, in_free_run: np.ndarray, n_added: int
    ) -> Iterator[bool]:
        """Yield for every draw of the noise whether the criterion names the cause of a signal."""
        rng = np.random.default_rng(self.seed)
        seen = _Seen(self._noise, self._left, over_windows, segments(self.windows))
        pairs = seen.draws(rng, self.n_repeats)
        runs = pairs
        if self._tells.any():
            record = record_of(self.windows)
            of_runs = _Seen(self._free_noise, self._left_of_runs, in_free_run, record)
            runs = of_runs.draws(rng, self.n_repeats)
        less = seen.overdispersion
        for (left, noise), (left_of_run, noise_of_run) in zip(pairs, runs, strict=True):
            none, tells = np.empty(0), self._tells
            without = HeldOut(left, left_of_run, 0.0, none, tells_in_free_run=tells)
            with_ = HeldOut(noise, noise_of_run, 0.0, none, n_added, tells_in_free_run=tells)
            yield self._is_sought(left, noise, rng) and self.criterion.names(
                without, with_, 1, less
            )

    def _is_sought(self, left: Residuals, noise: Residuals, rng: np.random.Generator) -> bool:
        r"""Return whether more than white noise is seen, the condition for a search for causes.

        The white part is estimated from the differences of neighbours: for white noise of variance
        :math:`\sigma^2` on :math:`n` samples its error is :math:`\sigma^2\sqrt{n}`.
        """
        error = self._noise.power * np.sqrt(noise.counts) * rng.standard_normal(noise.counts.size)
        white = self._white_part * (noise.squares + error)
        return bool((left.squares - white > self.criterion.smallest_share * left.squares).any())

    # -- simulations ---------------------------------------------------------------------------

    @cached_property
    def _inside(self) -> np.ndarray:
        """The samples that lie in a window."""
        return segments(self.windows) >= 0

    def _residual(
        self, windows: ShootingWindows, model: PhysicsModel, x0: np.ndarray
    ) -> np.ndarray:
        """Return the residuals of a model over windows, in units of the noise."""
        return evaluate(model, windows, x0, ()).residual / windows.scale

    @cached_property
    def _own_run(self) -> np.ndarray:
        return self._runs(self.model, self.start(self.model))

    def _free_run(self, effect: Effect | None) -> np.ndarray:
        if effect is None:
            return self._own_run
        model = effect.apply(self.model)
        return self._runs(model, self.start(model))

    def _runs(self, model: PhysicsModel, x0: np.ndarray) -> np.ndarray:
        """Return the outputs in free run, over the stretches that the diagnosis holds out."""
        y, folds = np.full_like(self.windows.y, np.nan), make_folds(self.records.problem)
        begun = initial_states(model, self.windows, x0)
        for fold in np.unique(folds):
            for a, b, first in stretches(self.windows, folds == fold):
                y[a:b] = free_run(model, self.windows, a, b, begun[first]).y
        return y

    # -- noise ---------------------------------------------------------------------------------

    @cached_property
    def _left(self) -> np.ndarray:
        """Residuals of the fitted model over windows, in units of the noise."""
        residual = self.records.fits["extended"].residual / self.windows.scale
        return np.where(self._inside[:, None], residual, np.nan)

    @cached_property
    def _left_of_runs(self) -> np.ndarray:
        """Residuals in free run, or over windows where it is not informative, in units of noise."""
        return np.where(self._tells, self._every_left_of_runs, self._left)

    @cached_property
    def _every_left_of_runs(self) -> np.ndarray:
        """Residuals of the fitted model in free run, in units of the noise."""
        simulated = np.nan_to_num(self._own_run, nan=np.inf)
        residual = (self.windows.y - simulated) / self.windows.scale
        return np.where(self._inside[:, None], residual, np.nan)

    @cached_property
    def _white_part(self) -> np.ndarray:
        """The share of the noise's power that is white, by output."""
        if self.white:
            return np.ones(self._noise.power.size)
        white = white_power(self._left, self.windows.starts)
        return np.minimum(white / self._noise.power, 1.0)

    @cached_property
    def _noise(self) -> Noise:
        resolution = self.records.problem.resolution
        return Noise.of(self._left, segments(self.windows), resolution, self.white)

    @cached_property
    def _free_noise(self) -> Noise:
        resolution = self.records.problem.resolution
        return Noise.of(self._left_of_runs, record_of(self.windows), resolution, self.white)

    @cached_property
    def _tells(self) -> np.ndarray:
        """Whether the free run of an output is nearer to the records than their mean."""
        problem = self.records.problem
        typical = problem.typical_outputs
        with np.errstate(over="ignore"):
            left = np.nanmean(self._every_left_of_runs**2, axis=0) + problem.resolution**2
        return left < (typical / self.windows.scale) ** 2
