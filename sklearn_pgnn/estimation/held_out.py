"""Cross-validation of hypotheses on held-out records: over windows, and in free run."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from sklearn_pgnn.estimation.added_states import price_of_states
from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times
from sklearn_pgnn.estimation.budgets import FOLDS, MOST_HELD_OUT, STRETCHES
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals
from sklearn_pgnn.simulation.led_states import led_states, n_free_states
from sklearn_pgnn.simulation.simulate import Simulation
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.uncertainty import parameter_covariance, propagated_variance
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows


def make_folds(problem: EstimationProblem) -> np.ndarray:
    """Split windows into folds: by records, or by stretches where one record holds too many."""
    folds = problem.windows.record % FOLDS
    if np.bincount(folds).max() > MOST_HELD_OUT * folds.size:
        folds = np.arange(folds.size) * min(STRETCHES, folds.size) // folds.size
    return np.unique(folds, return_inverse=True)[1]


@dataclass
class CrossValidation:
    """The held-out residuals of a hypothesis, fold by fold, from expected initial states."""

    problem: EstimationProblem
    expected: np.ndarray
    spread: np.ndarray

    def run(
        self,
        fit: WindowFit,
        folds: np.ndarray,
        learn: Callable[[np.ndarray], WindowFit],
        judge: Callable[[WindowFit, np.ndarray], WindowFit],
    ) -> HeldOut:
        """Fit every fold's windows with the parameters estimated from the others."""
        windows = self.problem.windows
        over_windows, over_runs = (np.full(windows.y.shape, np.nan) for _ in range(2))
        variance = np.zeros(windows.y.shape)
        names = tuple(freedom.name for freedom in fit.freedoms)
        grams, models = [], []
        x0, begun = fit.x0.copy(), fit.evaluation.x0.copy()
        for fold in np.unique(folds):
            inside = folds == fold
            learned = learn(~inside)
            judged = judge(learned, inside)
            if not (learned.usable and judged.usable):
                return self._lost()
            rows = windows.select(inside).rows
            over_windows[rows] = judged.evaluation.residual[rows]
            x0[inside], begun[inside] = judged.x0, judged.evaluation.x0
            models.append(learned.model)
            grams.append(judged.evaluation.gram)
            covariance = parameter_covariance(learned, self.expected[~inside], self.spread)
            for a, b, first in stretches(windows, inside):
                run = free_run(learned.model, windows, a, b, begun[first], names)
                over_runs[a:b] = windows.y[a:b] - run.y
                gram = grams[-1][np.count_nonzero(inside[:first])]
                variance[a:b] = self._variance(run, covariance, gram)
        seen = self._residuals(over_windows, segments(windows))
        order = np.argsort(folds, kind="stable")
        record = record_of(windows)
        free = self._residuals(over_runs, record)
        free = replace(free, errors=over_runs / windows.scale, segment=record)
        power = (self.problem.typical_outputs / windows.scale) ** 2  # about the means
        return HeldOut(
            windows=seen,
            free_run=free,
            memory_price=self._memory_price(fit, np.concatenate(grams), x0[order], order, seen),
            block_squares=windows.sum_blocks((over_windows / windows.scale) ** 2),
            n_added=len(fit.model.states) - len(self.problem.prior.states),
            n_free=n_free_states(fit.model, windows),
            tells_in_free_run=free.squares < free.counts * power,
            learned=tuple(models),
            x0=x0,
            uncertain=np.where(np.isfinite(windows.y), variance, 0.0).sum(axis=0),
        )

    def _variance(self, run: Simulation, covariance: np.ndarray, gram: np.ndarray) -> np.ndarray:
        """Return the variance of outputs due to the errors of parameters and initial state.

        It is in units of the noise, and zero where it is unknown. The information of a window on
        its initial state is in its Gram matrix.
        """
        n = len(self.spread)
        start = np.linalg.pinv(gram[:n, :n] + np.diag(1.0 / self.spread**2), hermitian=True)
        both = block_diag(covariance, start)
        variance = propagated_variance(np.asarray(run.sensitivities), both)
        with np.errstate(over="ignore"):
            variance /= self.problem.windows.scale**2
        return np.where(np.isfinite(variance), variance, 0.0)

    def _residuals(self, residual: np.ndarray, segment: np.ndarray) -> Residuals:
        """Return the statistics of residuals, with the accuracy limit of a simulation."""
        windows = self.problem.windows
        scaled = residual / windows.scale
        measured = np.isfinite(windows.y) & (segment >= 0)[:, None]
        counts = measured.sum(axis=0).astype(float)
        lost = (measured & ~np.isfinite(residual)).any(axis=0)
        with np.errstate(over="ignore"):
            squares = np.nansum(np.where(measured, scaled, 0.0) ** 2, axis=0)
        squares = np.where(lost | ~np.isfinite(squares), np.inf, squares)
        return Residuals(
            squares + counts * self.problem.resolution**2,
            counts,
            autocorrelation_times(np.where(measured, scaled, np.nan), segment),
        )

    def _memory_price(
        self, fit: WindowFit, gram: np.ndarray, x0: np.ndarray, order: np.ndarray, seen: Residuals
    ) -> float:
        """Return the penalty for the initial values of as many states as a hypothesis adds."""
        windows, states = self.problem.windows, list(fit.model.states)
        values = windows.sum_blocks(np.isfinite(windows.y)).sum(axis=(1, 2))
        first = np.where(windows.starts == windows.bounds[windows.record], values, 0)
        power = max(float((seen.squares * seen.times).sum() / seen.counts.sum()), 1.0)
        told = gram[:, : len(states), : len(states)] * np.outer(self.spread, self.spread) / power
        return price_of_states(
            told,
            (x0 - self.expected[order]) / self.spread,
            power,
            first[order],
            np.isin(states, led_states(fit.model, windows)),
            len(states) - len(self.problem.prior.states),
        )

    def _lost(self) -> HeldOut:
        windows = self.problem.windows
        counts = np.isfinite(windows.y).sum(axis=0).astype(float)
        none = Residuals(np.full(counts.shape, np.inf), counts, np.ones(counts.shape))
        shape = (len(windows), windows.blocks, windows.y.shape[1])
        return HeldOut(none, none, 0.0, np.full(shape, np.inf))


def segments(windows: ShootingWindows) -> np.ndarray:
    """Return the window of every sample, -1 if there is none."""
    segment = np.full(windows.t.size, -1)
    segment[windows.rows] = np.repeat(np.arange(len(windows)), windows.lengths)
    return segment


def record_of(windows: ShootingWindows) -> np.ndarray:
    """Return the record of every sample that lies in a window, else -1."""
    record = windows.record_at(np.arange(windows.t.size))
    return np.where(segments(windows) >= 0, record, -1)


def stretches(windows: ShootingWindows, inside: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """Yield first sample, end and first window of adjacent windows of one record."""
    record, ends = windows.record, windows.starts + windows.lengths
    which = np.flatnonzero(inside)
    follows = (np.diff(which) == 1) & (ends[which[:-1]] == windows.starts[which[1:]])
    follows &= record[which[1:]] == record[which[:-1]]
    for group in np.split(which, np.flatnonzero(~follows) + 1):
        yield int(windows.starts[group[0]]), int(ends[group[-1]]), int(group[0])
