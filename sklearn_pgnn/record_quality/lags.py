r"""Outputs that come late, or early: lags that a model does not contain.

An output that is late by :math:`\tau` shows :math:`\hat y(t - \tau) \approx \hat y - \tau\dot{\hat
y}`: its lag is one more parameter of the fit, with the column :math:`-\dot{\hat y}`. What is more
than half a part of a sample is taken off, and the fit is repeated: the model is simulated at the
times of which the output then is.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from sklearn_pgnn.estimators.parameter_search import ParameterFit
from sklearn_pgnn.record_quality.information import can_be_finer, finer, hurry
from sklearn_pgnn.record_quality.limits import ALPHA, STEPS
from sklearn_pgnn.record_quality.refits import is_better, leaves_noise
from sklearn_pgnn.simulation.normal_equations import normal_equations
from sklearn_pgnn.simulation.record_windows import cut, median_window_length, sample_steps
from sklearn_pgnn.simulation.uncertainty import NORMAL_95, correlations, invert, standard_errors
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import Evaluation, ShootingWindows, evaluate

#: how many times longer windows are, with as many blocks: free starts take what lags change there
LONGER = 3
#: lags that are tried first [samples], moves from there, and most samples of one
TRIED, ROUNDS, FARTHEST = (-13, -8, -5, -3, -2, -1, 1, 2, 3, 5, 8, 13), 20, 10
#: parts of a sample by which outputs are moved, the finest that are not too many, and the standard
#: error of a lag in these where outputs have corners
PARTS, FINEST = (8, 4, 2, 1), 0.1
#: correlation from which on a parameter may stand for a lag
ALIKE = 0.9
#: share by which steps of a regular clock may differ
REGULAR = 0.01


@dataclass(frozen=True)
class FoundLag:
    """An output that comes later than the model says by a lag [s], or earlier where it is negative.

    It has a 95 % interval; the parameters that it is `confused_with` may stand for it.
    """

    output: str
    lag: float
    low: float
    high: float
    samples: float
    confused_with: tuple[str, ...]


def find_lags(found: ParameterFit) -> tuple[FoundLag, ...]:
    """Find lags of outputs that differ from zero, and with which little but noise is left.

    Without inputs, they are relative to the first output. Clocks that are uneven tell none, nor
    does a search that takes too long.
    """
    steps, outputs = sample_steps(found.windowed.windows), list(found.fit.model.outputs)
    which = list(range(0 if found.fit.model.inputs else 1, len(outputs)))
    is_regular = np.mean(np.abs(steps / np.median(steps) - 1.0) < REGULAR) > 1.0 - REGULAR
    if not (which and is_regular and found.fit.usable):
        return ()
    search, none = _Search(found, which), np.zeros(len(which))
    fit, lags, errors = search.run()
    if fit is None:
        return ()
    without = min((search.at(none, begun) for begun in search.begun), key=attrgetter("times_noise"))
    if not (without.usable and is_better(without, fit, len(which))):
        return ()
    if not leaves_noise(search.moved(none, search.parts), fit, without):
        return ()
    freedom = max(fit.evaluation.block_squares.size - len(fit.freedoms), 1)
    related = np.abs(correlations(fit, search.expected, search.spread))
    names, reach = search.names, NORMAL_95 * errors
    return tuple(
        FoundLag(
            outputs[output],
            float(lag),
            float(lag - reach[k]),
            float(lag + reach[k]),
            float(lag / np.median(steps)),
            tuple(n for n, r in zip(names, related[len(names) + k], strict=False) if r > ALIKE),
        )
        for k, (output, lag) in enumerate(zip(which, lags, strict=True))
        if abs(lag) > student.isf(ALPHA / 2, freedom) * errors[k]
    )


class _Left(NamedTuple):
    """A fit to moved outputs, with lags as parameters, what is left of these, and what follows."""

    shift: np.ndarray
    fit: WindowFit
    more: WindowFit
    left: np.ndarray
    errors: np.ndarray
    following: WindowFit

    @property
    def is_clear(self) -> np.ndarray:
        """Whether a lag is left beyond chance."""
        return np.abs(self.left) > NORMAL_95 * self.errors


class _Search:
    """Fits to outputs that are moved in time, in long windows with free initial states."""

    def __init__(self, found: ParameterFit, which: list[int]):
        windows, self.which, self.is_late = found.windowed.windows, which, hurry()
        longer = cut(windows, LONGER * median_window_length(windows))
        every = max(1, round(longer.lengths.sum() / windows.lengths.sum()))
        longer = longer.select(np.arange(0, len(longer), every))
        self.windows, model = replace(longer, blocks=LONGER), found.fit.model
        self.expected, spread = found.windowed.states.expected_starts(model, longer)
        self.fit, self.spread = replace(found.fit, x0=self.expected), np.full(spread.shape, np.inf)
        given = {each.name: each.centre for each in self.fit.freedoms}
        self.names = list(given)
        self.low = np.array([each.low for each in self.fit.freedoms])
        self.high = np.array([each.high for each in self.fit.freedoms])
        #: as fitted without lags, and as given
        self.begun = self.fit, replace(self.fit, model=model.with_parameters(**given))
        self.parts = next((n for n in PARTS if can_be_finer(windows, n)), 1)
        self.part = float(np.median(sample_steps(windows))) / self.parts

    def run(self) -> tuple[WindowFit | None, np.ndarray, np.ndarray]:
        """Return a fit with lags, their values and standard errors [s]; None where none is near."""
        (shift, fit), known, least = self._first(), None, np.inf
        for _ in range(ROUNDS):
            fit = self.at(shift, fit)
            if self.is_late():
                break
            if fit.times_noise < least:
                least, known = fit.times_noise, self._left(shift, fit)
                moves = np.rint(np.where(known.is_clear, known.left, 0.0) / self.part)
                if moves.any():
                    shift = shift + moves.clip(-FARTHEST * self.parts, FARTHEST * self.parts)
                    fit = known.following
                    continue
            if known is None:
                break
            moves = np.eye(len(self.which)) * max(1, self.parts // 4)  # a step may end at a corner
            near = [
                (shift, self.at(shift, known.fit)) for shift in known.shift + np.r_[moves, -moves]
            ]
            shift, fit = min(near, key=lambda each: each[1].times_noise)
            if not fit.times_noise < least:
                left = np.where(known.is_clear, known.left.clip(-self.part, self.part), known.left)
                values = known.shift * self.part + left
                return known.more, values, np.hypot(known.errors, FINEST * self.part)
        return None, shift, shift

    def _left(self, shift: np.ndarray, fit: WindowFit) -> "_Left":
        """Return the lags that are left where outputs are moved."""
        more, n_p = _with_lags(fit, self.moved(shift, self.parts), self.which), len(fit.freedoms)
        normal = normal_equations(more, self.expected, self.spread)
        inverse, _ = invert(normal.hessian.sum(axis=0))
        change = inverse @ normal.gradient.sum(axis=0)
        found = standard_errors(more, self.expected, self.spread)
        values = np.clip(fit.values + change[:n_p], self.low, self.high)
        model = fit.model.with_parameters(**dict(zip(self.names, values, strict=True)))
        errors = np.array(list(found.values()))[n_p:]
        return _Left(shift, fit, more, change[n_p:], errors, replace(fit, model=model))

    def _first(self) -> tuple[np.ndarray, WindowFit]:
        """Return the lag of all outputs, in whole samples, with which a fit is best."""
        none = np.zeros(len(self.which))
        tried = [(none, self.at(none, begun, parts=1)) for begun in self.begun]
        for samples in TRIED:
            if not self.is_late():
                fit = self.at(none + samples, self.begun[1], parts=1)
                tried.append((none + samples * self.parts, fit))
        return min(tried, key=lambda each: each[1].times_noise)

    def at(self, shift: np.ndarray, fit: WindowFit, parts: int | None = None) -> WindowFit:
        """Fit to outputs that are moved to earlier times by so many parts of a sample."""
        return fit_windows(
            fit.model, self.moved(shift, parts or self.parts), self.fit.freedoms, self.expected,
            self.spread, x0_start=fit.x0, max_steps=STEPS, each_step=self.is_late,
        )  # fmt: skip

    def moved(self, shift: np.ndarray, parts: int) -> ShootingWindows:
        """Return windows of so many parts of a sample, with outputs moved to earlier ones."""
        windows, fine = self.windows, finer(self.windows, parts)
        by, y = np.zeros(windows.y.shape[1], dtype=int), np.full(fine.y.shape, np.nan)
        by[self.which] = shift
        for (a, b), (first, end) in zip(
            pairwise(windows.bounds), pairwise(fine.bounds), strict=True
        ):
            for i in range(by.size):
                row = first + parts * np.arange(b - a) - by[i]
                inside = (row >= first) & (row < end)
                y[row[inside], i] = windows.y[a:b, i][inside]
        return replace(fine, y=y)


def _slopes(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the lesser slope to either side: at a corner a lag may change nothing to one."""
    slopes = np.diff(values, axis=0) / np.diff(t)[:, None]
    after, before = (np.pad(slopes, (at, (0, 0)), mode="edge") for at in ((0, 1), (1, 0)))
    lesser = np.where(np.abs(after) < np.abs(before), after, before)
    return np.where(after * before > 0.0, lesser, 0.0)


def _with_lags(fit: WindowFit, windows: ShootingWindows, which: list[int]) -> WindowFit:
    """Return a fit with the lags of outputs as further parameters, all of them zero."""
    names = tuple(each.name for each in fit.freedoms)
    empty = replace(windows, y=np.zeros_like(windows.y))
    simulated = -evaluate(fit.model, empty, fit.x0, ()).residual
    column = np.full_like(simulated, np.nan)
    for a, n in zip(windows.starts, windows.lengths, strict=True):
        column[a : a + n] = -_slopes(windows.t[a : a + n], simulated[a : a + n])
    residual, gram = fit.evaluation.residual, fit.evaluation.block_gram
    with_residual = windows.sum_blocks(column * residual / windows.scale**2)
    n_p, m = len(names), len(which)
    old = np.array([*range(n_p), *range(n_p + m, gram.shape[-1] + m)])
    wide = np.zeros((*gram.shape[:2], gram.shape[-1] + m, gram.shape[-1] + m))
    wide[:, :, old[:, None], old] = gram
    for k, output in enumerate(which, n_p):
        y = np.where(np.isfinite(windows.y), simulated, np.nan)
        y[:, output] += column[:, output]
        products = evaluate(fit.model, replace(windows, y=y), fit.x0, names).block_gram[..., -1]
        wide[:, :, old[:-1], k] = wide[:, :, k, old[:-1]] = products[..., :-1]
        wide[:, :, k, k] = products[..., -1]
        wide[:, :, -1, k] = wide[:, :, k, -1] = with_residual[..., output]
    more = tuple(ParameterPrior(f"lag {i}", -np.inf, np.inf, 0.0, np.inf, 1.0) for i in which)
    evaluation = Evaluation(wide, residual, fit.evaluation.x0)
    return replace(fit, freedoms=(*fit.freedoms, *more), evaluation=evaluation)
