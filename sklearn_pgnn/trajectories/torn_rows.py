r"""Rows that were drawn one by one from records, as folds of independent samples do.

Rows kept at random with a probability :math:`q` on an even clock leave steps of :math:`k` sample
intervals that are independent of each other and geometrically distributed,

.. math:: P(\text{step} > k) = (1 - q)^k, \qquad q = P(\text{step} = 1)

Uneven sampling gives no multiples of one interval, lost samples leave almost all steps at 1, a gap
is one long step, and a clock that depends on what is measured gives steps that resemble the ones
before. Longest steps that chance would exceed, as where a message comes after one or two intervals,
are no chance. Rows in random order give ascending runs of two rows on average.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import spearmanr

from sklearn_pgnn.exceptions import RecordError

#: what to use in place of tools that take rows for independent
INSTEAD = (
    "Remedy: folds by TrajectoryKFold, a split by train_validation_test_split, "
    "HalvingBayesSearchCV for HalvingGridSearchCV over n_samples, EnsembleRegressor for "
    "BaggingRegressor, and for permutation_importance the scores of fits without an input"
)
#: share of the rows above which the others count as lost samples
KEPT = 0.85
#: fewest steps that tell, of one trajectory and of all
FEW, ENOUGH = 8, 25
#: largest distance of a step from a multiple of the interval, and least share of such steps
NEAR, MOSTLY = 0.2, 0.9
#: standard errors within which shares of steps are those of random rows, and what jitter adds
SIGMAS, SLACK = 3.5, 0.02
#: probability below which steps are not said to be random
CHANCE = 1e-4
#: rows of a trajectory on average, below which their order is looked at
SHORT = 3.0


def refuse_torn_rows(times: Sequence[np.ndarray]) -> None:
    """Raise `RecordError` where trajectories consist of single rows drawn from records."""
    if _is_shuffled(times):
        raise RecordError(
            "X: expected the rows of a trajectory in the order of their time, got rows in random "
            "order, as ShuffleSplit, train_test_split, a bootstrap or a permutation leave them. "
            f"{INSTEAD}."
        )
    missing = _share_torn_out(times)
    if missing:
        raise RecordError(
            f"X: {100 * missing:.0f} % of the rows are missing, one by one and at random, as in "
            f"folds that tear trajectories (KFold(shuffle=True), ShuffleSplit, train_test_split, "
            f"a bootstrap). {INSTEAD}; rows that a logger lost can be added with y = NaN."
        )


def _is_shuffled(times: Sequence[np.ndarray]) -> bool:
    """Return whether many short trajectories of different lengths start all over the clock."""
    lengths = np.array([t.size for t in times])
    if lengths.sum() < FEW or lengths.size < FEW / 2 or lengths.mean() >= SHORT:
        return False
    alike = np.ptp(lengths) == 0 and lengths[0] > 1
    return not alike and np.unique([t[0] for t in times]).size >= FEW / 2


def _share_torn_out(times: Sequence[np.ndarray]) -> float:
    """Return the share of rows that were left out at random; 0 where they were not."""
    found = [_steps(np.diff(t)) for t in times if t.size > FEW]
    steps = np.concatenate([k for k in found if k is not None] or [np.zeros(0)])
    if steps.size < ENOUGH or not steps.all():
        return 0.0
    kept = float(np.mean(steps == 1))
    return 1.0 - kept if kept < KEPT and _are_random(steps, kept) else 0.0


def _steps(intervals: np.ndarray) -> np.ndarray | None:
    """Return a trajectory's steps as multiples of its shortest interval; None if they are none."""
    if not (intervals > 0).all():
        return None
    interval = np.median(intervals[intervals < 1.5 * intervals.min()])
    multiples = intervals / interval
    whole = np.rint(multiples)
    return whole if np.mean(np.abs(multiples - whole) < NEAR) >= MOSTLY else None


def _are_random(steps: np.ndarray, kept: float) -> bool:
    """Return whether steps are geometrically distributed and independent of each other."""
    n, lost, mean = steps.size, 1.0 - kept, 1.0 / kept
    if (1.0 - lost ** steps.max()) ** n < CHANCE:
        return False
    for k in (2, 3, int(np.ceil(mean)), int(np.ceil(2 * mean))):
        expected = lost**k
        of_kept = k * expected * np.sqrt(kept / lost / n)
        error = np.hypot(np.sqrt(expected * (1.0 - expected) / n), of_kept)
        if abs(np.mean(steps > k) - expected) > SIGMAS * error + SLACK:
            return False
    return bool(abs(spearmanr(steps[1:], steps[:-1]).statistic) < SIGMAS / np.sqrt(n))
