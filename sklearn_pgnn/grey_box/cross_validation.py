"""Cross-validated errors of the depths, on samples that their fits have not seen."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pandas as pd
from joblib import Memory, Parallel, delayed

from sklearn_pgnn.estimators.progress import PrintLine, silence
from sklearn_pgnn.exceptions import OptionError, TrainingError
from sklearn_pgnn.grey_box.depth import (
    FittedDepth,
    find_unknown_starts,
    fit_network,
    fit_physics,
    states_met,
)
from sklearn_pgnn.grey_box.options import NETWORKS, network_or_default, warn_of_training
from sklearn_pgnn.grey_box.tables import PlainTable, starts_for
from sklearn_pgnn.grey_box.time_limit import TimeLimit
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.measured import of_measured, where_measured


@dataclass(frozen=True)
class FoldResult:
    """A fit without hidden samples, its RMS errors there by trajectory, and all sizes."""

    fitted: FittedDepth
    errors: list[float]
    left: np.ndarray


def judge(
    fit: Callable[[PlainTable, np.ndarray], FittedDepth],
    table: PlainTable,
    hidden: np.ndarray,
    window: int,
) -> FoldResult:
    """Fit a depth without the hidden samples, and compare its free run with them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the final fit gives them again
        fitted = fit(table, ~hidden)
        starts = _starts(fitted, table, hidden, window)
        left = np.abs(fitted.predict(table, starts) - table.y)
    left = np.where(counted(table, hidden, window)[:, None], left, np.nan)
    relative = left / output_spread(table.y)
    with np.errstate(invalid="ignore"):
        squares = pd.DataFrame(relative**2).groupby(table.X["trajectory"]).mean().mean(axis=1)
    return FoldResult(fitted, np.sqrt(squares.dropna()).tolist(), left[hidden])


def counted(table: PlainTable, hidden: np.ndarray, window: int) -> np.ndarray:
    """Return which samples count in a fold: hidden, and not used for an initial state."""
    unseen = np.repeat(is_unseen(table, hidden), table.lengths)
    return hidden & ~(unseen & (table.place < window))


def check_window(table: PlainTable, folds: list[np.ndarray], window: int) -> None:
    """Raise `OptionError` if no fold has a measured sample to evaluate on."""
    measured = where_measured(table.y)
    if any((counted(table, hidden, window) & measured).any() for hidden in folds):
        return
    longest = int(np.max(table.lengths))
    raise OptionError(
        f"initial_window: expected fewer samples than a trajectory has, since the error of a fit "
        f"to other trajectories is computed on the samples after them, got {window}; the longest "
        f"has {longest}. Remedy: a smaller initial_window, such as {max(1, longest // 10)}, longer "
        f"records, or by='time'."
    )


def mean_error(results: list[FoldResult]) -> float:
    """Return the geometric mean of the errors, so that no fold or trajectory dominates."""
    errors = np.concatenate([result.errors for result in results])
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(errors))))


def output_spread(y: np.ndarray) -> np.ndarray:
    """Return the standard deviation of every output, 1 for a constant one."""
    spread = of_measured(np.nanstd, y)
    return np.where(spread > 0, spread, 1.0)


def training_error(fitted: FittedDepth, table: PlainTable, visible: np.ndarray) -> np.ndarray:
    """Return the root mean square error of every output on the visible samples."""
    left = np.where(visible[:, None], fitted.predict(table, fitted.starts) - table.y, np.nan)
    return np.maximum(np.sqrt(of_measured(np.nanmean, left**2)), 1e-6 * output_spread(table.y))


def _starts(fitted, table, hidden, window) -> np.ndarray:
    unseen = is_unseen(table, hidden)
    if not unseen.any():
        return fitted.starts
    known = np.where(unseen[:, None], starts_for(fitted.model, table), fitted.starts)
    noise = training_error(fitted, table, ~hidden)
    return find_unknown_starts(fitted, table, known, states_met(fitted, table), window, noise)


def is_unseen(table: PlainTable, hidden: np.ndarray) -> np.ndarray:
    """Return which trajectories are hidden as a whole."""
    return np.bincount(table.X["trajectory"], weights=~hidden) == 0


# -- all depths, on the same folds -----------------------------------------------------------------


@dataclass(frozen=True)
class JudgedDepths:
    """Results by depth and fold, the best physical depth, and depths for which the time was up."""

    results: dict[str, list[FoldResult]]
    base: str
    skipped: tuple[str, ...] = ()

    @property
    def errors(self) -> dict[str, float]:
        """Cross-validated error of every depth."""
        return {depth: mean_error(found) for depth, found in self.results.items()}

    def choose(self, least_gain: float) -> str:
        """Return the shallowest depth that no deeper one improves on by the least gain."""
        enough = (1 + least_gain) * min(self.errors.values())
        return next(depth for depth, error in self.errors.items() if error <= enough)

    def left(self, depth: str) -> np.ndarray:
        """Return the sorted magnitudes of a depth's errors on hidden samples, for every output."""
        return np.sort(np.concatenate([result.left for result in self.results[depth]]), axis=0)


@dataclass(frozen=True)
class DepthJudge:
    """Cross-validates depths on the same folds, until the time is up and there is a result."""

    table: PlainTable
    folds: list[np.ndarray]
    window: int
    n_jobs: int | None
    memory: Memory
    print_line: PrintLine
    show: Callable[..., None] = silence
    time: TimeLimit = field(default_factory=lambda: TimeLimit(None))

    def judge_all(
        self, candidates: dict[str, PhysicsModel], depths: tuple[str, ...], network
    ) -> JudgedDepths:
        """Fit every depth in every fold, networks on the best physical one."""
        kept, n = self.memory.cache(judge), len(self.folds)
        tried = {
            depth: self._judge(depth, [partial(fit_physics, depth, model)] * n, kept)
            for depth, model in candidates.items()
        }
        results = {depth: found for depth, found in tried.items() if found}
        base = min(results, key=lambda depth: mean_error(results[depth]))
        physical = [each.fitted for each in results[base]]
        for depth in (each for each in depths if each in NETWORKS):
            taught = network_or_default(network)
            fits = [partial(fit_network, taught, depth, each) for each in physical]
            try:
                tried[depth] = self._judge(depth, fits, judge)
            except TrainingError as error:
                warn_of_training(error, depth, base)
        results = {depth: found for depth, found in tried.items() if found}
        return JudgedDepths(results, base, tuple(each for each in tried if each not in results))

    def _judge(
        self, depth: str, fits: Sequence[Callable[..., FittedDepth]], score: Callable
    ) -> list[FoldResult]:
        """Compare a depth with what was hidden from its fits; nothing if the time is up."""
        found = Parallel(n_jobs=self.n_jobs)(self._calls(depth, fits, score))
        if len(found) < len(self.folds):
            return []
        self.time.counts = True
        self.print_line(f"{depth}: cross-validated error {mean_error(found):.4g}")
        return found

    def _calls(
        self, depth: str, fits: Sequence[Callable[..., FittedDepth]], score: Callable
    ) -> Iterator[tuple]:
        """Yield the fits of a depth, fold by fold, until the time is up."""
        for k, (fit, hidden) in enumerate(zip(fits, self.folds, strict=True)):
            if self.time.is_up:
                return
            self.show(f"depth {depth!r}, folds", k, len(self.folds))
            yield delayed(score)(fit, self.table, hidden, self.window)
