"""The cross-validated depths of a recipe, and the one that is chosen."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from joblib import Memory, Parallel, delayed

from sklearn_pgnn.estimators.progress import PrintLine, silence
from sklearn_pgnn.exceptions import TrainingError
from sklearn_pgnn.grey_box.cross_validation import FoldResult, judge, mean_error
from sklearn_pgnn.grey_box.default_parts import network_or_default
from sklearn_pgnn.grey_box.depth import FittedDepth
from sklearn_pgnn.grey_box.depth_fits import fit_depth, train_depth
from sklearn_pgnn.grey_box.depth_warnings import warn_of_training
from sklearn_pgnn.grey_box.possible_depths import NETWORKS
from sklearn_pgnn.grey_box.tables import PlainTable
from sklearn_pgnn.grey_box.time_limit import TimeLimit
from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class JudgedDepths:
    """The results of every depth that could be fitted.

    Results are fold by fold, and from the shallowest depth to the deepest. `base` is the best
    physical depth, on which networks were trained; `skipped` are depths for which the time was up.
    """

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
    """Cross-validates depths on the same folds.

    A fold is a mask of the hidden samples, and `n_jobs` of them are fitted in parallel. `window` is
    the number of first samples of a hidden trajectory from which its initial state is estimated.
    `memory` keeps the results of physical depths, `print_line` receives a line of text for every
    depth, and ``show(stage, done, total)`` is called with the folds of a depth. Once there is a
    result, no fold is begun after the time.
    """

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
        tried = {depth: self._physical(depth, model) for depth, model in candidates.items()}
        results = {depth: found for depth, found in tried.items() if found}
        base = min(results, key=lambda depth: mean_error(results[depth]))
        physical = [each.fitted for each in results[base]]
        for depth in (each for each in depths if each in NETWORKS):
            taught = network_or_default(network)
            fits = [partial(train_depth, taught, depth, each) for each in physical]
            try:
                tried[depth] = self._judge(depth, fits, judge)
            except TrainingError as error:
                warn_of_training(error, depth, base)
        results = {depth: found for depth, found in tried.items() if found}
        return JudgedDepths(results, base, tuple(each for each in tried if each not in results))

    def _physical(self, depth: str, model: PhysicsModel) -> list[FoldResult]:
        fits = [partial(fit_depth, depth, model)] * len(self.folds)
        return self._judge(depth, fits, self.memory.cache(judge))

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

    def _calls(self, depth: str, fits: Sequence[Callable[..., FittedDepth]], score: Callable):
        """Yield the fits of a depth, fold by fold, until the time is up."""
        for k, (fit, hidden) in enumerate(zip(fits, self.folds, strict=True)):
            if self.time.is_up:
                return
            self.show(f"depth {depth!r}, folds", k, len(self.folds))
            yield delayed(score)(fit, self.table, hidden, self.window)
