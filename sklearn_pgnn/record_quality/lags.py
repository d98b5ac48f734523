r"""Outputs that come late, or early: lags that a model does not contain.

An output that is late by :math:`\tau` shows :math:`\hat y(t - \tau) \approx \hat y - \tau\dot{\hat
y}`: its lag is one more parameter of the fit, with the column :math:`-\dot{\hat y}`. What is more
than half a part of a sample is taken off, and the fit is repeated: the model is simulated at the
times of which the output then is.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import t as student

from sklearn_pgnn.estimators.parameter_search import ParameterFit
from sklearn_pgnn.record_quality.information import can_be_finer, finer, sample_steps
from sklearn_pgnn.record_quality.limits import ALPHA, STEPS
from sklearn_pgnn.record_quality.refits import leaves_noise
from sklearn_pgnn.simulation.normal_equations import normal_equations
from sklearn_pgnn.simulation.record_windows import cut, median_window_length
from sklearn_pgnn.simulation.uncertainty import NORMAL_95, correlations, invert, standard_errors
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import Evaluation, ShootingWindows, evaluate

#: how many times longer windows are, with as many blocks
LONGER = 3
#: lags that are tried first [samples]
TRIED = (-13, -8, -5, -3, -2, -1, 1, 2, 3, 5, 8, 13)
#: moves of the outputs, and most samples of one
ROUNDS, FARTHEST = 10, 10
#: parts of a sample by which outputs are moved, the finest that are not too many
PARTS = (8, 4, 2, 1)
#: standard error of a lag where outputs have corners, in these parts
FINEST = 0.1
#: correlation from which on a parameter may stand for a lag
ALIKE = 0.9
#: share by which steps of a regular clock may differ
REGULAR = 0.01


@dataclass(frozen=True)
class FoundLag:
    """An output that comes later than the model says, or earlier where `lag` is negative.

    The lag is in seconds, with a 95 % interval, and in `samples`; the `confused_with` parameters
    may stand for it.
    """

    output: str
    lag: float
    low: float
    high: float
    samples: float
    confused_with: tuple[str, ...]


def find_lags(found: ParameterFit, is_late: Callable[[], bool]) -> tuple[FoundLag, ...]:
    """Find lags of outputs that differ from zero, and with which little but noise is left.

    Without inputs, they are relative to the first output. Clocks that are uneven tell none, nor
    does a search that is late.
    """
    windows, model = found.windowed.windows, found.fit.model
    step, outputs = _clock(windows), list(model.outputs)
    which = list(range(0 if model.inputs else 1, len(outputs)))
    if step is None or not which or not found.fit.usable:
        return ()
    refit = _Refit(_in_long_windows(found), which, step, is_late)
    lags = refit.run()
    if lags is None or not refit.explains(lags):
        return ()
    n_blocks = lags.fit.evaluation.block_squares.size
    needed = student.isf(ALPHA / 2, max(n_blocks - len(lags.fit.freedoms), 1))
    reach = NORMAL_95 * lags.errors
    return tuple(
        FoundLag(
            outputs[output],
            float(lags.values[k]),
            float(lags.values[k] - reach[k]),
            float(lags.values[k] + reach[k]),
            float(lags.values[k] / step),
            refit.confused_with(lags, k),
        )
        for k, output in enumerate(which)
        if abs(lags.values[k]) > needed * lags.errors[k]
    )


def _in_long_windows(found: ParameterFit) -> ParameterFit:
    """Return a fit in windows some times as long: free starts take what a lag changes there."""
    windows, states = found.windowed.windows, found.windowed.states
    longer = cut(windows, LONGER * median_window_length(windows))
    every = max(1, round(int(longer.lengths.sum()) / int(windows.lengths.sum())))
    longer = replace(longer.select(np.arange(0, len(longer), every)), blocks=LONGER)
    expected, spread = states.expected_starts(found.fit.model, longer)
    fit = replace(found.fit, x0=expected)
    return ParameterFit(fit, expected, spread, replace(found.windowed, windows=longer))


@dataclass(frozen=True)
class _Lags:
    """A fit with lags as parameters, their values [s], and their standard errors."""

    fit: WindowFit
    values: np.ndarray
    errors: np.ndarray


class _Refit:
    """Fits to outputs that are moved in time; initial states are free, which moves with them."""

    def __init__(
        self,
        found: ParameterFit,
        which: list[int],
        step: float,
        is_late: Callable[[], bool],
    ):
        self.found, self.which, self.is_late = found, which, is_late
        self.parts = next((n for n in PARTS if can_be_finer(found.windowed.windows, n)), 1)
        self.part = step / self.parts
        self.spread = np.full(found.spread.shape, np.inf)

    def run(self) -> _Lags | None:
        """Return the lags, None where moves do not bring them near."""
        shift, fit = self._first()
        for _ in range(ROUNDS):
            fit = self.at(shift, fit)
            if not fit.usable or self.is_late():
                return None
            left = self._left(shift, fit)
            clear = np.abs(left.values) > NORMAL_95 * left.errors
            moves = np.rint(np.where(clear, left.values, 0.0) / self.part)
            if not moves.any():
                errors = np.hypot(left.errors, FINEST * self.part)
                return _Lags(left.fit, shift * self.part + left.values, errors)
            most = FARTHEST * self.parts
            shift = shift + moves.clip(-most, most)
        return None

    def _first(self) -> tuple[np.ndarray, WindowFit]:
        """Return the lag of all outputs, in whole samples, with which a fit is best."""
        given = {each.name: each.centre for each in self.found.fit.freedoms}
        begun = replace(self.found.fit, model=self.found.fit.model.with_parameters(**given))
        best = np.zeros(len(self.which)), self.at(np.zeros(len(self.which)), self.found.fit)
        for samples in TRIED:
            shift = np.full(len(self.which), float(samples * self.parts))
            fit = self.at(shift, begun)
            if _error(fit) < _error(best[1]):
                best = shift, fit
            if self.is_late():
                break
        return best

    def at(self, shift: np.ndarray, fit: WindowFit) -> WindowFit:
        """Fit to outputs that are moved to earlier times by so many parts of a sample."""
        return fit_windows(
            fit.model,
            self._moved(shift),
            self.found.fit.freedoms,
            self.found.expected,
            self.spread,
            x0_start=fit.x0,
            max_steps=STEPS,
            each_step=self.is_late,
        )

    def _left(self, shift: np.ndarray, fit: WindowFit) -> _Lags:
        """Return the lags that are left where outputs are moved."""
        more = _with_lags(fit, self._moved(shift), self.which)
        normal = normal_equations(more, self.found.expected, self.spread)
        inverse, _ = invert(normal.hessian.sum(axis=0))
        n_p = len(fit.freedoms)
        values = (inverse @ normal.gradient.sum(axis=0))[n_p:]
        errors = list(standard_errors(more, self.found.expected, self.spread).values())[n_p:]
        return _Lags(more, values, np.array(errors))

    def _moved(self, shift: np.ndarray) -> ShootingWindows:
        """Return windows of so many parts of a sample, with outputs moved to earlier ones."""
        windows = self.found.windowed.windows
        fine, every = finer(windows, self.parts), np.zeros(windows.y.shape[1], dtype=int)
        every[self.which] = shift
        y = np.full(fine.y.shape, np.nan)
        ends = zip(pairwise(windows.bounds), pairwise(fine.bounds), strict=True)
        for (a, b), (first, end) in ends:
            for i, by in enumerate(every):
                row = first + self.parts * np.arange(b - a) - by
                inside = (row >= first) & (row < end)
                y[row[inside], i] = windows.y[a:b, i][inside]
        return replace(fine, y=y)

    def explains(self, lags: _Lags) -> bool:
        """Return whether the model with lags leaves little but white noise."""
        without = self.at(np.zeros(len(self.which)), self.found.fit)
        return leaves_noise(self._moved(np.zeros(len(self.which))), lags.fit, without)

    def confused_with(self, lags: _Lags, place: int) -> tuple[str, ...]:
        """Name the parameters that may stand for a lag."""
        related = np.abs(correlations(lags.fit, self.found.expected, self.spread))
        names = [each.name for each in self.found.fit.freedoms]
        row = related[len(names) + place]
        return tuple(name for name, r in zip(names, row, strict=False) if r > ALIKE)


def _error(fit: WindowFit) -> float:
    """Return the mean square of the residuals: moved outputs are fewer."""
    count = max(int(np.isfinite(fit.evaluation.residual).sum()), 1)
    return fit.squares / count if fit.usable else np.inf


def _clock(windows: ShootingWindows) -> float | None:
    """Return the sample interval of all records [s], None where it is not the same everywhere."""
    steps = sample_steps(windows)
    usual = float(np.median(steps))
    return usual if np.mean(np.abs(steps / usual - 1.0) < REGULAR) > 1.0 - REGULAR else None


def _with_lags(fit: WindowFit, windows: ShootingWindows, which: list[int]) -> WindowFit:
    """Return a fit with the lags of outputs as further parameters, all of them zero."""
    names = tuple(each.name for each in fit.freedoms)
    empty = replace(windows, y=np.zeros_like(windows.y))
    simulated = -evaluate(fit.model, empty, fit.x0, ()).residual
    column = np.full_like(simulated, np.nan)
    for a, n in zip(windows.starts, windows.lengths, strict=True):
        column[a : a + n] = -np.gradient(simulated[a : a + n], windows.t[a : a + n], axis=0)
    residual, gram = fit.evaluation.residual, fit.evaluation.block_gram
    with_residual = windows.sum_blocks(column * residual / windows.scale**2)
    n_p, m = len(names), len(which)
    old = [*range(n_p), *range(n_p + m, gram.shape[-1] + m)]
    wide = np.zeros((*gram.shape[:2], gram.shape[-1] + m, gram.shape[-1] + m))
    wide[:, :, np.array(old)[:, None], old] = gram
    for k, output in enumerate(which):
        y = np.where(np.isfinite(windows.y), simulated, np.nan)
        y[:, output] += column[:, output]
        products = evaluate(fit.model, replace(windows, y=y), fit.x0, names).block_gram[..., -1]
        wide[:, :, old[:-1], n_p + k] = wide[:, :, n_p + k, old[:-1]] = products[..., :-1]
        wide[:, :, n_p + k, n_p + k] = products[..., -1]
        wide[:, :, -1, n_p + k] = wide[:, :, n_p + k, -1] = with_residual[..., output]
    more = tuple(ParameterPrior(f"lag {i}", -np.inf, np.inf, 0.0, np.inf, 1.0) for i in which)
    evaluation = Evaluation(wide, residual, fit.evaluation.x0)
    return replace(fit, freedoms=(*fit.freedoms, *more), evaluation=evaluation)
