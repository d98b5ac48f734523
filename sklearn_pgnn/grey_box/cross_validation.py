"""Cross-validated errors of a depth, on samples that its fit has not seen."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.grey_box.depth import FittedDepth, find_unknown_starts, states_met
from sklearn_pgnn.grey_box.tables import PlainTable, starts_for
from sklearn_pgnn.trajectories.measured import of_measured, where_measured


@dataclass(frozen=True)
class FoldResult:
    """A depth fitted without the hidden samples of a fold, and its errors on them.

    The errors are root mean squares in free run of every trajectory with hidden samples, in
    standard deviations of the outputs; `left` are their magnitudes sample by sample, of shape
    (n_hidden, n_outputs), NaN where nothing was measured.
    """

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
