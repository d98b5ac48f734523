r"""Outputs that come late, or early: lags that a model does not contain.

An output that is late by :math:`\tau` shows :math:`\hat y(t - \tau) \approx \hat y - \tau\dot{\hat
y}`: its lag is one more parameter of the fit, with the column :math:`-\dot{\hat y}`. What is more
than half a sample is taken off the measured output as whole samples, and the fit is repeated.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import t as student

from sklearn_pgnn.estimators.parameter_search import ParameterFit
from sklearn_pgnn.record_quality.information import sample_steps
from sklearn_pgnn.record_quality.limits import ALPHA, STEPS
from sklearn_pgnn.record_quality.refits import leaves_noise
from sklearn_pgnn.simulation.normal_equations import normal_equations
from sklearn_pgnn.simulation.uncertainty import NORMAL_95, correlations, invert, standard_errors
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import Evaluation, ShootingWindows, evaluate

#: fits with outputs moved by whole samples, and most samples of one move
ROUNDS, FARTHEST = 8, 10
#: correlation from which on a parameter may stand for a lag
ALIKE = 0.9
#: standard error of a lag at corners of an output, whose slope is that between samples [samples]
FINEST = 0.02
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


def find_lags(found: ParameterFit) -> tuple[FoundLag, ...]:
    """Find lags of outputs that differ from zero, and with which little but noise is left.

    Without inputs, they are relative to the first output. Clocks that are uneven tell none.
    """
    first, windows = found.fit, found.windowed.windows
    step, outputs = _clock(windows), list(first.model.outputs)
    which = list(range(0 if first.model.inputs else 1, len(outputs)))
    if step is None or not which or not first.usable:
        return ()
    refit = _Refit(found, which, step)
    lags = refit.run()
    if lags is None or not leaves_noise(windows, lags.fit, refit.at(np.zeros(len(which)), first)):
        return ()
    n_blocks = len(windows) * windows.blocks
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


@dataclass(frozen=True)
class _Lags:
    """A fit with lags as parameters, their values [s], and their standard errors."""

    fit: WindowFit
    values: np.ndarray
    errors: np.ndarray


class _Refit:
    """Fits to outputs that are moved in time; initial states are free, which moves with them."""

    def __init__(self, found: ParameterFit, which: list[int], step: float):
        self.found, self.which, self.step = found, which, step
        self.spread = np.full(found.spread.shape, np.inf)

    def run(self) -> _Lags | None:
        """Return the lags, None where whole samples do not bring them near."""
        shift, fit = np.zeros(len(self.which)), self.found.fit
        for _ in range(ROUNDS):
            left = self._left(shift, fit)
            if left is None:
                return None
            clear = np.abs(left.values) > NORMAL_95 * left.errors
            moves = np.rint(np.where(clear, left.values, 0.0) / self.step)
            if not moves.any():
                values = shift * self.step + left.values
                there = self._left(values / self.step, left.fit)
                if there is None:
                    return None
                errors = np.hypot(there.errors, FINEST * self.step)
                return replace(there, values=values, errors=errors)
            shift, fit = shift + moves.clip(-FARTHEST, FARTHEST), left.fit
        return None

    def at(self, shift: np.ndarray, fit: WindowFit) -> WindowFit:
        """Fit to outputs that are moved to earlier samples."""
        return fit_windows(
            fit.model,
            self._moved(shift),
            self.found.fit.freedoms,
            self.found.expected,
            self.spread,
            x0_start=fit.x0,
            max_steps=STEPS,
        )

    def _left(self, shift: np.ndarray, fit: WindowFit) -> _Lags | None:
        """Return the lags that are left where outputs are moved."""
        fit = self.at(shift, fit)
        if not fit.usable:
            return None
        more = _with_lags(fit, self._moved(shift), self.which)
        normal = normal_equations(more, self.found.expected, self.spread)
        inverse, _ = invert(normal.hessian.sum(axis=0))
        n_p = len(fit.freedoms)
        values = (inverse @ normal.gradient.sum(axis=0))[n_p:]
        errors = list(standard_errors(more, self.found.expected, self.spread).values())[n_p:]
        return _Lags(more, values, np.array(errors))

    def _moved(self, shift: np.ndarray) -> ShootingWindows:
        every = np.zeros(self.found.windowed.windows.y.shape[1])
        every[self.which] = shift
        return _moved(self.found.windowed.windows, every)

    def confused_with(self, lags: _Lags, place: int) -> tuple[str, ...]:
        """Name the parameters that may stand for a lag."""
        related = np.abs(correlations(lags.fit, self.found.expected, self.spread))
        names = [each.name for each in self.found.fit.freedoms]
        row = related[len(names) + place]
        return tuple(name for name, r in zip(names, row, strict=False) if r > ALIKE)


def _clock(windows: ShootingWindows) -> float | None:
    """Return the sample interval of all records [s], None where it is not the same everywhere."""
    steps = sample_steps(windows)
    usual = float(np.median(steps))
    return usual if np.mean(np.abs(steps / usual - 1.0) < REGULAR) > 1.0 - REGULAR else None


def _moved(windows: ShootingWindows, shift: np.ndarray) -> ShootingWindows:
    """Return the windows with outputs moved to earlier samples, straight in between."""
    y = np.full(windows.y.shape, np.nan)
    for a, b in pairwise(windows.bounds):
        for i, by in enumerate(shift):
            whole = int(np.floor(by))
            for n, weight in ((whole, 1.0 - (by - whole)), (whole + 1, by - whole)):
                if weight > 0.0:
                    row = np.arange(a, b) + n
                    inside = (row >= a) & (row < b)
                    part = np.where(inside, windows.y[row.clip(a, b - 1), i], np.nan)
                    y[a:b, i] = weight * part + (0.0 if n == whole else y[a:b, i])
    return replace(windows, y=y)


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
