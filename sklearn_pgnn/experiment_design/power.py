"""The power of a diagnosis: how often its criterion would name what is put into a fitted model."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sklearn_pgnn.estimation.budgets import COARSER, STEPS, TOLERANCE
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords
from sklearn_pgnn.estimation.held_out import make_folds, record_of, segments, stretches
from sklearn_pgnn.estimation.hypothesis import count_parameters
from sklearn_pgnn.estimation.octaves import Octaves, octaves_of
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.led_states import initial_states, start_values
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import Evaluation, ShootingWindows, evaluate


@dataclass(frozen=True)
class Noise:
    """Noise of the outputs by octave of frequency, in which a signal is seen or not.

    Parameters
    ----------
    octaves : Octaves
        Its squares.
    """

    octaves: Octaves

    @classmethod
    def of(
        cls,
        residual: np.ndarray,
        segment: np.ndarray,
        resolution,
        white: bool,
        n_fitted=0.0,
    ) -> "Noise":
        """Measure noise.

        Parameters
        ----------
        residual : ndarray of shape (n_samples, n_outputs)
            The noise; NaN where nothing was measured.
        segment : ndarray of shape (n_samples,)
            See `octaves_of`.
        resolution : ndarray of shape (n_outputs,)
            What no simulation is finer than.
        white : bool
            Whether it is taken as white.
        n_fitted : float or ndarray of shape (n_outputs,), default=0
            See `octaves_of`.

        Returns
        -------
        Noise
            The noise.
        """
        found = octaves_of(residual, segment, n_fitted)
        mean = found.squares.sum(axis=0) / np.maximum(found.counts.sum(axis=0), 1.0)
        power = (mean if white else found.power) + resolution**2
        return cls(Octaves(power * found.counts, found.counts))

    @property
    def counts(self) -> np.ndarray:
        """Number of samples of every output."""
        return self.octaves.counts.sum(axis=0)

    @property
    def power(self) -> np.ndarray:
        """Variance of every output."""
        return self.octaves.squares.sum(axis=0) / np.maximum(self.counts, 1.0)

    def power_at(self, n_octaves: int) -> np.ndarray:
        """Return the power in so many octaves, below the lowest that is known as in it.

        Parameters
        ----------
        n_octaves : int
            How many.

        Returns
        -------
        ndarray of shape (n_octaves, n_outputs)
            The power.
        """
        known = self.octaves.power
        return known[np.minimum(np.arange(n_octaves), len(known) - 1)]

    def squares_of(self, signal: Octaves) -> float:
        """Return the squares of a signal, in units of the noise's power in each octave.

        Parameters
        ----------
        signal : Octaves
            The signal.

        Returns
        -------
        float
            The sum over outputs and octaves.
        """
        return float((signal.squares / self.power_at(len(signal.squares))).sum())

    def beside(self, more: Octaves, times: int) -> "Noise":
        """Return the noise of these samples and of others, which were recorded so many times.

        Parameters
        ----------
        more : Octaves
            What the others are, of which the counts are used.
        times : int
            How often.

        Returns
        -------
        Noise
            The noise of all.
        """
        size = max(len(more.counts), len(self.octaves.counts))
        counts = _longer(self.octaves.counts, size) + times * _longer(more.counts, size)
        return Noise(Octaves(self.power_at(size) * counts, counts))

    def draws(
        self, signal: np.ndarray, n_parameters: int, rng: np.random.Generator, count: int
    ) -> list[tuple[Residuals, Residuals]]:
        r"""Draw the noise on top of a signal.

        The squares of a signal of the norm :math:`s` in :math:`n` coefficients with noise of the
        variance :math:`\sigma^2` are those of the noise across the signal,
        :math:`\sigma^2 \chi^2_{n-1}`, and those along it, :math:`(s + \sigma e)^2` with a standard
        normal :math:`e`.

        Parameters
        ----------
        signal : ndarray of shape (n_octaves, n_outputs)
            Squares of the signal.
        n_parameters : int
            Parameters that a model of it takes.
        rng : Generator
            Draws.
        count : int
            How often.

        Returns
        -------
        list of (Residuals, Residuals)
            What is left without a model of the signal, and with it.
        """
        counts, power = self.octaves.counts, self.octaves.power
        shape = (count, *counts.shape)
        across = power * rng.chisquare(np.maximum(counts - 1.0, 1.0), shape) * (counts > 1.0)
        error = np.sqrt(power) * rng.standard_normal(shape)
        before, after = (across + (size + error) ** 2 for size in (np.sqrt(signal), 0.0))
        return [
            (self._left(b, 0), self._left(a, n_parameters))
            for b, a in zip(before, after, strict=True)
        ]

    def _left(self, squares: np.ndarray, n_parameters: int) -> Residuals:
        octaves, ones = Octaves(squares, self.octaves.counts), np.ones(squares.shape[1])
        total = squares.sum(axis=0)
        return Residuals(total, self.counts, ones, octaves=octaves, n_parameters=n_parameters)


def _longer(values: np.ndarray, size: int) -> np.ndarray:
    """Return octaves with empty ones below."""
    return np.pad(values, ((0, size - len(values)), (0, 0)))


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
        """Return the windows' initial states of an extension of the fitted model."""
        fitted = self.records.fits["extended"]
        x0 = start_values(model, self.windows, self.records.problem.states.values(model))
        for i, name in enumerate(fitted.model.states):
            x0[:, list(model.states).index(name)] = fitted.x0[:, i]
        return x0

    # -- what an effect shows ------------------------------------------------------------------

    def windows_with(self, effect: Effect, bare: Effect | None) -> ShootingWindows | None:
        """Return the windows with what the size of an effect shows, without noise.

        Parameters
        ----------
        effect : Effect
            The effect.
        bare : Effect or None
            The same effect without size, where that is something even then.

        Returns
        -------
        ShootingWindows or None
            The windows; None where a simulation diverges.
        """
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
        """Return whether other outputs of the windows are further off than noise hides."""
        residual, noise = self._residual(windows, self.model, self.start(self.model)), self._noise
        changed = np.nansum(residual**2, axis=0)
        return bool((changed >= self.criterion.smallest_share * noise.counts * noise.power).any())

    # -- the power -----------------------------------------------------------------------------

    def power(self, effect: Effect, bare: Effect | None = None, retuned: bool = True) -> float:
        """Return the chance that the criterion names an effect.

        Parameters
        ----------
        effect : Effect
            The effect.
        bare : Effect or None, default=None
            The same effect without size, where that is something even then.
        retuned : bool, default=True
            Whether the model is re-tuned to what the effect shows.

        Returns
        -------
        float
            The power; NaN where a simulation does not stay finite.
        """
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
        return float(np.mean(list(self._named(over_windows, in_free_run, effect))))

    def _named(self, over_windows, in_free_run, effect: Effect) -> Iterator[bool]:
        """Yield for every draw of the noise whether the criterion names the cause of a signal."""
        n_added = len(effect.apply(self.model).states) - len(self.model.states)
        sizes = count_parameters(effect)
        rng = np.random.default_rng(self.seed)
        fitted = self.records.problem.starts_by_output
        signal = _measured(over_windows, self._left, segments(self.windows), fitted)
        pairs = self._noise.draws(signal, sizes, rng, self.n_repeats)
        runs = pairs
        if self._tells.any():
            signal = _measured(in_free_run, self._left_of_runs, record_of(self.windows))
            runs = self._free_noise.draws(signal, sizes, rng, self.n_repeats)
        for (left, noise), (left_of_run, noise_of_run) in zip(pairs, runs, strict=True):
            without = HeldOut(left, left_of_run, 0.0, np.empty(0), 0, self._tells)
            with_ = HeldOut(noise, noise_of_run, 0.0, np.empty(0), n_added, self._tells)
            yield self._is_sought(left, noise, rng) and self.criterion.names(without, with_)

    def _is_sought(self, left: Residuals, noise: Residuals, rng: np.random.Generator) -> bool:
        r"""Return whether more than white noise is seen, which is when causes are sought.

        The white part is taken from the differences of neighbours: of white noise of the variance
        :math:`\sigma^2` on :math:`n` samples it is off by :math:`\sigma^2\sqrt{n}`.
        """
        error = self._noise.power * np.sqrt(noise.counts) * rng.standard_normal(noise.counts.size)
        white = self._white_part * (noise.squares + error)
        return bool((left.squares - white > self.criterion.smallest_share * left.squares).any())

    # -- simulations ---------------------------------------------------------------------------

    @cached_property
    def _inside(self) -> np.ndarray:
        """The samples that lie in a window."""
        return segments(self.windows) >= 0

    def _residual(self, windows: ShootingWindows, model, x0) -> np.ndarray:
        """Return what a model leaves of the windows, in units of the noise."""
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
        """What the fitted model leaves over windows, in units of the noise."""
        residual = self.records.fits["extended"].residual / self.windows.scale
        return np.where(self._inside[:, None], residual, np.nan)

    @cached_property
    def _left_of_runs(self) -> np.ndarray:
        """What the fitted model leaves in free run where that tells, in units of the noise."""
        return np.where(self._tells, self._every_left_of_runs, self._left)

    @cached_property
    def _every_left_of_runs(self) -> np.ndarray:
        """What the fitted model leaves in free run, in units of the noise."""
        simulated = np.nan_to_num(self._own_run, nan=np.inf)
        residual = (self.windows.y - simulated) / self.windows.scale
        return np.where(self._inside[:, None], residual, np.nan)

    @cached_property
    def _white_part(self) -> np.ndarray:
        """The share of the noise's power that is white, by output."""
        if self.white:
            return np.ones(self._noise.power.size)
        step = np.diff(self._left, axis=0)
        step[self.windows.starts[1:] - 1] = np.nan
        return np.minimum(np.nanmean(step**2, axis=0) / 2.0 / self._noise.power, 1.0)

    @cached_property
    def _noise(self) -> Noise:
        problem, segment = self.records.problem, segments(self.windows)
        fitted = problem.starts_by_output
        return Noise.of(self._left, segment, problem.resolution, self.white, fitted)

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


def _measured(signal, residual, segment: np.ndarray, n_fitted=0.0) -> np.ndarray:
    """Return the squares of a signal by octave, where there was something measured."""
    return octaves_of(np.where(np.isfinite(residual), signal, np.nan), segment, n_fitted).squares
