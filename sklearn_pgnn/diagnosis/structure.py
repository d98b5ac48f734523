r"""Is what a model leaves predictable? A law without a name, static or with memory, at every place.

At a place (a rate, an input or an output) a law predicts a hidden input :math:`d(t)` from signals
that hold no sensor noise, the inputs and the states of a free-run simulation, and from what these
were before, by lags

.. math:: T_i\, \dot z_i = s - z_i, \qquad T_i \text{ from two samples to a third of a record}.

Smoothing finds the hidden input that would make the model follow the records; the law is learned
on some groups of these and predicts the others: linear with one lag by ridge regression, and of any
shape with all lags by boosted trees. It must predict a share of the hidden input, or of the
outputs, that exceeds zero; and it counts by what it does to the outputs. With the response
:math:`R \hat d` of the windows, their initial states projected out, it explains of a group's
residuals :math:`r` the share

.. math:: 1 - \frac{\| r - R \hat d \|^2}{\| r \|^2}.

Of many places those are looked at where any input explains most of what is left.

A sensor's noise, however coloured, and a disturbance from outside cannot be predicted in this way.
Measured states are no signals: their noise would explain itself.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.stats import t as student
from sklearn.model_selection import GroupKFold

from sklearn_pgnn.diagnosis.trees import boosted_trees, groups_of
from sklearn_pgnn.diagnosis.unexplained import hidden_input
from sklearn_pgnn.estimation.budgets import FILTERS, FOLDS, SAMPLES
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitted_records import record_starts
from sklearn_pgnn.estimation.held_out import segments
from sklearn_pgnn.estimation.likely_places import likely_places
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.exceptions import SimulationError
from sklearn_pgnn.physics.places import places_of
from sklearn_pgnn.simulation.linear_response import linear_responses, without_states
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.window_fit import EachStep
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.threads import one_thread_each

#: name of the time since the start of the record
IN_RECORD = "time in the record"
#: weight of the ridge, in units of the squares of the features
RIDGE = 1e-3
#: features of a law without lags, and with all of them
STATIC, ALL = slice(0, 0), slice(None)
#: samples: some, or all
Rows = np.ndarray | slice


@dataclass(frozen=True)
class Structure:
    """The law without a name that explains most of what is left.

    Parameters
    ----------
    place : str
        The port where it acts, the state in whose rate, or the input or output; empty if no law
        explains anything.
    share : float
        Share of an output's squared error over windows that it explains, of records not used for
        it.
    memory : float
        Time constant [s] of what it remembers; 0 for a static law.
    depends_on : tuple of str
        States, inputs and the time without which it explains less, the most important first.

    Examples
    --------
    >>> Structure("v", share=0.97, memory=0.24, depends_on=("F",)).is_significant
    True
    """

    place: str = ""
    share: float = 0.0
    memory: float = 0.0
    depends_on: tuple[str, ...] = ()

    @property
    def is_significant(self) -> bool:
        """Whether a law explains a share that matters, beyond chance."""
        return bool(self.place)


def find_structure(
    problem: EstimationProblem,
    trial: FittedHypothesis,
    alpha: float,
    smallest_share: float,
    each_step: EachStep = None,
) -> Structure:
    """Look for a law without a name that predicts what a hypothesis leaves, at every place.

    It counts if its share of an output's error reaches `smallest_share`, and if this share or that
    of the hidden input exceeds zero by Student's test over the groups, at `alpha` divided by the
    number of tests.
    """
    names = places_of(problem.prior)
    level = alpha / (4 * len(names) * (1 + len(problem.prior.outputs)))
    found = [Structure()]
    for place in _places(problem, trial, names, each_step):
        with suppress(SimulationError), one_thread_each():  # where no response can be computed
            found.append(place.best_law(level, smallest_share))
    return max(found, key=lambda law: law.share)


def share_of_laws(
    problem: EstimationProblem,
    trial: FittedHypothesis,
    names: Sequence[str],
    each_step: EachStep = None,
) -> float:
    """Return the largest share of what a hypothesis leaves that a law at some places predicts.

    The laws are of the plant: none depends on the time.
    """
    found = [0.0]
    for place in _places(problem, trial, names, each_step, timed=False):
        with suppress(SimulationError), one_thread_each():
            found += place.shares()
    return max(found)


def _places(
    problem: EstimationProblem,
    trial: FittedHypothesis,
    names: Sequence[str],
    each_step: EachStep,
    timed: bool = True,
) -> Iterator["_Place"]:
    """Yield the places where the hidden input can be found."""
    signals = _Signals.of(problem, trial, timed) if names else None
    for name in likely_places(problem, trial, tuple(names)):
        d = hidden_input(problem, trial, name, each_step).values
        if signals is not None and np.isfinite(d).all():
            yield _Place(problem, trial, name, signals, d)


@dataclass(frozen=True)
class _Signals:
    """What a law may depend on at every sample: quantities, and each as it was before."""

    names: tuple[str, ...]
    now: np.ndarray
    before: np.ndarray  # of shape (n_lags, n_samples, n_quantities)
    times: np.ndarray
    of_windows: np.ndarray  # the group of every window
    of_samples: np.ndarray  # the group of every sample, -1 outside the windows

    @classmethod
    def of(
        cls, problem: EstimationProblem, trial: FittedHypothesis, timed: bool = True
    ) -> "_Signals":
        windows, model = problem.windows, trial.fit.model
        spans = list(pairwise(windows.bounds))
        starts = record_starts(problem, model, trial.fit.x0)
        runs = [
            _held_where_endless(free_run(model, windows, a, b, x0).x)
            for (a, b), x0 in zip(spans, starts, strict=True)
        ]
        acting = windows.acting_inputs(model)[:, : len(model.inputs)]  # not their slopes by delays
        signals = np.hstack([np.concatenate(runs), acting])
        signals /= np.maximum(np.abs(signals).max(axis=0), np.finfo(float).tiny)
        begun = np.concatenate([windows.t[a:b] - windows.t[a] for a, b in spans])
        least = 2 * problem.scales.sample_time
        longest = float(np.median([windows.t[b - 1] - windows.t[a] for a, b in spans])) / 3
        times = np.geomspace(least, max(longest, least), FILTERS)
        before = np.stack([_filtered(windows, signals, time) for time in times])
        group, window = groups_of(windows.record), segments(windows)
        names = (*model.states, *model.inputs, *([IN_RECORD] * timed))
        of_samples = np.where(window >= 0, group[window], -1)
        now = np.column_stack([signals, *([begun] * timed), np.ones(begun.size)])
        return cls(names, now, before, times, group, of_samples)

    def columns(self, lags: slice, rows: Rows = ALL, shuffled: int = -1) -> np.ndarray:
        """Return the features of a law with some of the lags, those of one quantity shuffled."""
        before = self.before[lags]
        features = np.hstack([self.now[rows], *before[:, rows]])
        if shuffled >= 0:
            of_lags = np.tile(np.arange(self.before.shape[2]), len(before))
            own = np.concatenate([np.arange(len(self.names) + 1), of_lags]) == shuffled
            order = np.random.default_rng(0).permutation(len(self.now))
            features[:, own] = self.columns(lags, order[rows])[:, own]
        return features


class _Fold(NamedTuple):
    """A law that was learned on some groups, and the samples of the others."""

    predict: Callable[[np.ndarray], np.ndarray]
    lags: slice
    inside: np.ndarray


class _Moments(NamedTuple):
    """Second moments of some features and of the hidden input, by group."""

    lags: slice
    of_groups: np.ndarray  # of shape (n_groups, n_features + 1, n_features + 1)

    def learn(self, groups: Sequence[int]) -> np.ndarray:
        """Return the coefficients by ridge regression on some groups."""
        total = self.of_groups[groups].sum(axis=0)
        gram, target = total[:-1, :-1], total[:-1, -1]
        size = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
        scaled = gram / np.outer(size, size) + RIDGE * np.eye(size.size)
        return np.linalg.solve(scaled, target / size) / size

    def left(self, groups: Sequence[int]) -> float:
        """Return the squares that are left of some groups, each predicted by the others of them."""
        left = 0.0
        for group in groups:
            law = np.append(self.learn([other for other in groups if other != group]), -1.0)
            left += float(law @ self.of_groups[group] @ law)
        return left


@dataclass(frozen=True)
class _Place:
    """A place of a model where a law may act, and the hidden input there."""

    problem: EstimationProblem
    trial: FittedHypothesis
    name: str
    signals: _Signals
    d: np.ndarray

    def best_law(self, level: float, smallest_share: float) -> Structure:
        """Return the law that explains most beyond chance, static if memory gains nothing."""
        laws = self._laws
        predicted = [self._predict(law) for law in laws]
        pairs = zip(predicted, self._explained(predicted), strict=True)
        found = [(self._of_hidden_input(each), share) for each, share in pairs]
        shares = [_largest(*each, level, smallest_share) for each in found]
        static, best = max(shares[::2]), max(shares)
        if not best > 0.0:
            return Structure()
        share = static if static >= best - smallest_share else best
        law = laws[shares.index(share)]
        memory = 0.0 if share == static else self._memory(law)
        return Structure(self.name, share, memory, self._needs(law, smallest_share))

    def shares(self) -> list[float]:
        """Return the share of all residuals that each law predicts."""
        explained = self._explained([self._predict(law) for law in self._laws])
        return [float(each[0].sum() / each[1].sum()) for each in explained]

    # -- laws --------------------------------------------------------------------------------------

    @property
    def _laws(self) -> list[list[_Fold]]:
        """The laws, in turn static and with memory."""
        linear = [self._linear([STATIC]), self._linear([STATIC, *self._each_lag])]
        return [*linear, self._trees(STATIC), self._trees(ALL)]

    @property
    def _each_lag(self) -> list[slice]:
        return [slice(i, i + 1) for i in range(self.signals.times.size)]

    def _linear(self, options: list[slice]) -> list[_Fold]:
        """Learn a linear law for every group from the others, with the lag that suits them best."""
        moments = [self._moments(lags) for lags in options]
        groups = np.unique(self.signals.of_windows).tolist()
        folds = []
        for group in groups:
            others = [other for other in groups if other != group]
            best = min(moments, key=lambda each: each.left(others))
            law, inside = best.learn(others), self.signals.of_samples == group
            folds.append(_Fold(law.__rmatmul__, best.lags, inside))
        return folds

    def _moments(self, lags: slice) -> _Moments:
        """Return the moments of the features with some lags."""
        table, group = (
            np.column_stack([self.signals.columns(lags), self.d]),
            self.signals.of_samples,
        )
        parts = [table[group == each] for each in range(self.signals.of_windows.max() + 1)]
        return _Moments(lags, np.stack([part.T @ part for part in parts]))

    def _trees(self, lags: slice) -> list[_Fold]:
        """Learn a law of any shape for every fold of groups from the others."""
        features, group = self.signals.columns(lags), self.signals.of_samples
        rows = np.flatnonzero(group >= 0)
        some = rows[:: max(1, rows.size // SAMPLES)]
        folds = []
        count = min(FOLDS, np.unique(group[some]).size)
        for known, _ in GroupKFold(count).split(some, groups=group[some]) if count > 1 else ():
            learned = some[known]
            trees = boosted_trees().fit(features[learned], self.d[learned])
            inside = (group >= 0) & ~np.isin(group, group[learned])
            folds.append(_Fold(trees.predict, lags, inside))
        return folds

    # -- what a law predicts -----------------------------------------------------------------------

    def _predict(self, law: list[_Fold], shuffled: int = -1) -> np.ndarray:
        """Return the hidden input that a law predicts of the groups it was not learned on."""
        predicted = np.zeros(self.d.size)
        for fold in law:
            features = self.signals.columns(fold.lags, fold.inside, shuffled)
            predicted[fold.inside] = fold.predict(features)
        return predicted

    def _responses(self, inputs: np.ndarray) -> np.ndarray:
        """Return the responses of the windows to hidden inputs, and what is left of the outputs.

        They are in units of the noise, without what the initial states explain.
        """
        windows, fit = self.problem.windows, self.trial.fit
        x0 = fit.evaluation.x0
        responses, by_state = linear_responses(fit.model, windows, x0, self.name, inputs)
        table = np.concatenate([responses, fit.evaluation.residual[..., None]], axis=-1)
        return without_states(windows, table, by_state)

    def _of_hidden_input(self, predicted: np.ndarray) -> np.ndarray:
        """Return the squares of the hidden input that a prediction explains, and all, by group."""
        inside = self.signals.of_samples >= 0
        group, d, left = (x[inside] for x in (self.signals.of_samples, self.d, self.d - predicted))
        before = _sums(d[:, None] ** 2, group)
        return np.stack([before - _sums(left[:, None] ** 2, group), before])

    def _explained(self, predicted: list[np.ndarray]) -> list[np.ndarray]:
        """Return the squares that every prediction explains, and all, by group and output."""
        table = self._responses(np.column_stack(predicted))
        table = table.reshape(-1, self.problem.windows.y.shape[1], table.shape[-1])
        group = np.repeat(self.signals.of_windows, self.problem.windows.lengths)
        before = _sums(table[..., -1] ** 2, group)
        return [
            np.stack([before - _sums((table[..., -1] - part) ** 2, group), before])
            for part in np.moveaxis(table[..., :-1], -1, 0)
        ]

    def _memory(self, law: list[_Fold]) -> float:
        """Return the time constant of the lag with which a law explains most."""
        used = [fold.lags.start for fold in law if fold.lags not in (STATIC, ALL)]
        if not used:
            alone = self._explained([self._predict(self._trees(lags)) for lags in self._each_lag])
            used = [int(np.argmax([each[0].sum(axis=0).max() for each in alone]))]
        return float(np.median(self.signals.times[used]))

    def _needs(self, law: list[_Fold], smallest_share: float) -> tuple[str, ...]:
        """Return the quantities without which a law explains less, the most important first."""
        names = self.signals.names
        predicted = [self._predict(law, i) for i in range(-1, len(names))]
        whole, *without = [each.sum(axis=1) for each in self._explained(predicted)]
        output = int(np.argmax(whole[0] / np.maximum(whole[1], np.finfo(float).tiny)))
        lost = {
            n: 1.0 - w[0, output] / whole[0, output] for n, w in zip(names, without, strict=True)
        }
        needed = [name for name, each in lost.items() if each >= smallest_share]
        return tuple(sorted(needed, key=lambda name: -lost[name]))


def _sums(squares: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Sum the squares of every output by group."""
    return np.stack([np.bincount(group, weights=each) for each in squares.T], axis=1)


def _largest(
    of_hidden_input: np.ndarray, of_outputs: np.ndarray, level: float, smallest_share: float
) -> float:
    """Return the largest share of an output that a law explains beyond chance; else 0."""
    explained, power = of_hidden_input[..., 0]
    is_law = _is_beyond_chance(explained, power, level)
    best = 0.0
    for explained, power in zip(*(part.T for part in of_outputs), strict=True):
        share = explained.sum() / max(power.sum(), np.finfo(float).tiny)
        if share >= max(best, smallest_share) and (
            is_law or _is_beyond_chance(explained, power, level)
        ):
            best = float(share)
    return best


def _is_beyond_chance(explained: np.ndarray, power: np.ndarray, level: float) -> bool:
    known = power > 0
    return is_positive(explained[known] / power[known], power[known], level)


def _filtered(windows: ShootingWindows, signals: np.ndarray, time: float) -> np.ndarray:
    """Filter signals in every record, from their first values, by a lag."""
    found = np.empty_like(signals)
    for a, b in pairwise(windows.bounds):
        step = float(np.median(np.diff(windows.t[a:b]))) if b - a > 1 else time
        pole = np.exp(-step / time)
        rise = signals[a:b] - signals[a]
        found[a:b] = signals[a] + lfilter([1.0 - pole], [1.0, -pole], rise, axis=0)
    return found


def is_positive(shares: np.ndarray, weights: np.ndarray, alpha: float) -> bool:
    r"""Return whether the weighted mean of shares exceeds zero, by Student's t-test.

    .. math:: m = \frac{\sum_i w_i s_i}{\sum_i w_i}, \qquad
              e^2 = \frac{k}{k - 1} \frac{\sum_i w_i^2 (s_i - m)^2}{(\sum_i w_i)^2},
              \qquad k = \frac{(\sum_i w_i)^2}{\sum_i w_i^2}

    with :math:`k - 1` degrees of freedom: unequal groups count as :math:`k` equal ones.
    """
    if shares.size < 2 or not weights @ shares > 0:
        return False
    total = weights.sum()
    count, mean = total**2 / (weights**2).sum(), weights @ shares / total
    if not count > 1:
        return False
    square = count / (count - 1) * (weights**2 @ (shares - mean) ** 2) / total**2
    return bool(mean > student.ppf(1 - alpha, count - 1) * np.sqrt(square))


def _held_where_endless(x: np.ndarray) -> np.ndarray:
    """Return the states of a run, the last finite ones held after it becomes non-finite."""
    finite = np.isfinite(x)
    rows = np.arange(len(x))[:, None]
    last = np.maximum.accumulate(np.where(finite, rows, 0), axis=0)
    return np.take_along_axis(x, last, axis=0)
