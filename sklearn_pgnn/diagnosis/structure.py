r"""Test whether the residuals of a model depend on anything that was recorded.

The residuals over windows are regressed on the states of a free-run simulation and on the inputs,
present and past, by boosted trees, and predicted on held-out records. A sensor's noise, however
coloured, and an external disturbance cannot be predicted in this way; missing physics can.
Measured states are not among the features: their noise would explain itself.

A wrong model leaves much in some windows and little in others, and trees that minimise squared
errors learn mainly the former. The test is therefore made with every window in units of its own
root mean square, as in weighted least squares, and also without scaling: missing physics may show
in a few windows only.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student
from sklearn.ensemble import HistGradientBoostingRegressor

from sklearn_pgnn.diagnosis.trees import boosted_trees, groups_of
from sklearn_pgnn.estimation.budgets import LAGS, SAMPLES, STRETCHES
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitted_records import record_starts
from sklearn_pgnn.estimation.held_out import record_of, segments
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.threads import one_thread_each

#: names of the time since the start of the window, and since the start of the record
IN_WINDOW, IN_RECORD = "simulated time", "time in the record"


@dataclass(frozen=True)
class Structure:
    """How well the residuals can be predicted from what was recorded.

    Parameters
    ----------
    skill : dict of str to float
        Share of every output's residual power that is predicted on held-out groups.
    is_significant : bool
        Whether any output is predicted better than by chance.
    depends_on : tuple of str
        States, inputs and the time without which less is predicted, the most important first.
    """

    skill: dict[str, float]
    is_significant: bool
    depends_on: tuple[str, ...] = ()


def find_structure(
    problem: EstimationProblem,
    trial: FittedHypothesis,
    alpha: float,
    smallest_share: float,
) -> Structure:
    r"""Test whether the residuals of a hypothesis can be predicted from what was recorded.

    An output's residual has structure if the share of its power that is predicted, averaged over
    groups of records, is at least the smallest share that counts and exceeds zero, see
    `is_positive`. It is tested twice, each time at half the rate: with windows in units of their
    own root mean square, and without scaling, groups weighted by their power.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    trial : FittedHypothesis
        The hypothesis, fitted on all windows.
    alpha : float
        Rate at which noise is taken for structure.
    smallest_share : float
        Smallest predicted share that counts.

    Returns
    -------
    Structure
        The answer.
    """
    table = _Table.of(problem, trial)
    ways = table.levelled(), table
    level = alpha / len(problem.prior.outputs) / len(ways)
    skill: dict[str, float] = {}
    depends: dict[str, float] = {}
    for column, output in enumerate(problem.prior.outputs):
        skill[output], lost = _predicted(ways, column, level, smallest_share)
        for name, share in lost.items():
            depends[name] = max(depends.get(name, 0.0), share)
    telling = [name for name, lost in depends.items() if lost >= smallest_share]
    return Structure(skill, bool(depends), tuple(sorted(telling, key=lambda n: -depends[n])))


def _predicted(
    ways: "tuple[_Table, ...]", column: int, level: float, smallest_share: float
) -> tuple[float, dict[str, float]]:
    """Return the predicted share of an output, and the part of it that needs each quantity.

    The share is that of the first of the two tests that is significant; if neither is, no quantity
    is needed.
    """
    found = []
    for table in ways:
        with one_thread_each():
            predictions = list(table.predictions(column))
        shares, powers = np.array([each[:2] for each in predictions]).reshape(-1, 2).T
        found.append(float(np.average(shares, weights=powers)) if shares.size else 0.0)
        if found[-1] >= smallest_share and is_positive(shares, powers, level):
            lost = table.importance(column, predictions, powers)
            return found[-1], {name: each / found[-1] for name, each in lost.items()}
    return found[0], {}


def is_positive(shares: np.ndarray, weights: np.ndarray, alpha: float) -> bool:
    r"""Return whether the weighted mean of shares exceeds zero, by Student's t-test.

    .. math:: m = \frac{\sum_i w_i s_i}{\sum_i w_i}, \qquad
              e^2 = \frac{k}{k - 1} \frac{\sum_i w_i^2 (s_i - m)^2}{(\sum_i w_i)^2},
              \qquad k = \frac{(\sum_i w_i)^2}{\sum_i w_i^2}

    with :math:`k - 1` degrees of freedom: unequal groups count as :math:`k` equal ones.

    Parameters
    ----------
    shares : ndarray of shape (n_groups,)
        Shares :math:`s`.
    weights : ndarray of shape (n_groups,)
        Their weights :math:`w`.
    alpha : float
        False-alarm rate.

    Returns
    -------
    bool
        Whether it exceeds zero.

    Examples
    --------
    >>> is_positive(np.array([0.8, 0.9, 0.7, -9.0]), np.array([10.0, 10.0, 9.0, 0.01]), 0.01)
    True
    """
    if shares.size < 2 or not weights @ shares > 0:
        return False
    total = weights.sum()
    count, mean = total**2 / (weights**2).sum(), weights @ shares / total
    if not count > 1:
        return False
    square = count / (count - 1) * (weights**2 @ (shares - mean) ** 2) / total**2
    return bool(mean > student.ppf(1 - alpha, count - 1) * np.sqrt(square))


class _Prediction(NamedTuple):
    """The prediction of one group by the others."""

    share: float
    power: float
    trees: HistGradientBoostingRegressor
    inside: np.ndarray


@dataclass(frozen=True)
class _Table:
    """Features and residuals of some samples, and the window and the group of each."""

    names: tuple[str, ...]
    features: np.ndarray
    residual: np.ndarray
    window: np.ndarray
    group: np.ndarray

    @classmethod
    def of(cls, problem: EstimationProblem, trial: FittedHypothesis) -> "_Table":
        windows, model = problem.windows, trial.fit.model
        window = segments(windows)
        rows = np.flatnonzero(window >= 0)
        rows = rows[:: max(1, rows.size // SAMPLES)]
        starts = record_starts(problem, model, trial.fit.x0)
        spans = list(pairwise(windows.bounds))
        runs = [
            _held_where_endless(free_run(model, windows, a, b, x0).x)
            for (a, b), x0 in zip(spans, starts, strict=True)
        ]
        acting = windows.acting_inputs(model)[:, : len(model.inputs)]  # not their slopes by delays
        signals = np.hstack([np.concatenate(runs), acting])
        record = record_of(windows)[rows]
        since = windows.t[rows] - windows.t[windows.starts[window[rows]]]
        longest = _longest_lag(windows)
        earlier = [np.maximum(rows - round(lag * longest), windows.bounds[record]) for lag in LAGS]
        columns = [signals[at] for at in earlier]
        names = (*model.states, *model.inputs) * len(LAGS)
        return cls(
            (*names, IN_WINDOW, IN_RECORD),
            np.column_stack([*columns, since, windows.t[rows] - windows.t[windows.bounds[record]]]),
            trial.fit.evaluation.residual[rows] / windows.scale,
            window[rows],
            groups_of(record),
        )

    def levelled(self) -> "_Table":
        """Return the table with every window's residuals in units of their root mean square."""
        place = np.unique(self.window, return_inverse=True)[1]
        known = np.isfinite(self.residual)
        squares, counts = (
            np.column_stack([np.bincount(place, weights=each) for each in values.T])
            for values in (np.where(known, self.residual, 0.0) ** 2, known)
        )
        rms = np.sqrt(squares / np.maximum(counts, 1))[place]
        return replace(self, residual=self.residual / np.maximum(rms, np.finfo(float).tiny))

    def predictions(self, column: int) -> Iterator[_Prediction]:
        """Yield the predictions of an output, group by group."""
        y = self.residual[:, column]
        known = np.isfinite(y)
        for group in np.unique(self.group[known]):
            inside, outside = known & (self.group == group), known & (self.group != group)
            if not outside.any() or not np.var(y[inside]) > 0:
                continue
            trees = boosted_trees().fit(self.features[outside], y[outside])
            share = _share(trees, self.features[inside], y[inside])
            yield _Prediction(share, float(np.sum(y[inside] ** 2)), trees, inside)

    def importance(self, column: int, predictions, weights) -> dict[str, float]:
        """Return the loss of predicted share if a quantity is permuted."""
        y, rng, lost = self.residual[:, column], np.random.default_rng(0), {}
        for name in dict.fromkeys(self.names):
            own, falls = np.array([n == name for n in self.names]), []
            for each in predictions:
                shuffled = self.features[each.inside].copy()
                shuffled[:, own] = rng.permutation(shuffled[:, own])
                falls.append(each.share - _share(each.trees, shuffled, y[each.inside]))
            lost[name] = float(np.average(falls, weights=weights))
        return lost


def _share(trees, features, y) -> float:
    """Return the share of a quantity's power that is predicted."""
    return 1.0 - float(np.sum((y - trees.predict(features)) ** 2) / np.sum(y**2))


def _longest_lag(windows: ShootingWindows) -> float:
    """Return the samples of a window, or of a part of a record so short that most have a past."""
    record = float(np.median(np.diff(windows.bounds)))
    return max(min(float(np.median(windows.lengths)), record / STRETCHES), 1.0)


def _held_where_endless(x: np.ndarray) -> np.ndarray:
    """Return the states of a run, the last finite ones held after it becomes non-finite."""
    finite = np.isfinite(x)
    rows = np.arange(len(x))[:, None]
    last = np.maximum.accumulate(np.where(finite, rows, 0), axis=0)
    return np.take_along_axis(x, last, axis=0)
