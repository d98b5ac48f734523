r"""What differs between records, or since when: a screen by a linear model of all windows.

With the normal equations :math:`H_w, g_w` of window :math:`w`, its initial state eliminated, a
quantity :math:`q` that is another by :math:`\delta` in some windows :math:`A` lowers the sum of
squares by :math:`s^2/h` beyond what all windows share: the parameters and the usual value of
:math:`q`, together :math:`p`,

.. math:: s = \sum_{w \in A} g_{w,q} - a^T H^{-1} \sum_w g_{w,p}, \qquad
          h = \sum_{w \in A} H_{w,qq} - a^T H^{-1} a, \qquad
          a = \sum_{w \in A} H_{w,pq}, \qquad H = \sum_w H_{w,pp}.

The windows are those of some records, or those that begin after an onset, in one record or in all.
Groups of records part these in the order of :math:`s/h` of each alone: a record more or less for
which the quantity is larger is then the next best. For a trend from record to record, and for what
grows from an onset to the end, the sums are weighted from zero to one.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from sklearn_pgnn.estimation.difference_fits import ALL, MARKED, ONSETS, SHARE, DifferenceFits
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.record_groups import Group
from sklearn_pgnn.physics.effects.differences import DIFFERENCES, Difference, mark_at
from sklearn_pgnn.physics.effects.targets import pair
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.normal_equations import Normal, project
from sklearn_pgnn.simulation.uncertainty import NORMAL_95
from sklearn_pgnn.simulation.window_fit import EachStep, WindowFit, prior_precision
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate

#: part of a quantity's own curvature below which shared parameters take its place
FLAT = 1e-9


@dataclass(frozen=True)
class _Normal:
    """The normal equations of a quantity in every item: its own, and with what all items share.

    The inverse Hessian and the step of what is shared hold for all items together.
    """

    shared: np.ndarray
    step: np.ndarray
    gradient: np.ndarray
    own: np.ndarray
    mixed: np.ndarray

    def summed(self, items: Sequence[np.ndarray]) -> "_Normal":
        """Return those of groups of items."""
        parts = (
            np.array([part[item].sum(axis=0) for item in items])
            for part in (self.gradient, self.own, self.mixed)
        )
        return _Normal(self.shared, self.step, *parts)

    def weighted(self, by: np.ndarray) -> "_Normal":
        """Return those of the quantity times a number in every item."""
        parts = self.gradient * by, self.own * by**2, self.mixed * by[:, None]
        return _Normal(self.shared, self.step, *parts)

    def of(self, items: np.ndarray) -> "_Normal":
        """Return those of some items, in another order."""
        parts = (part[items] for part in (self.gradient, self.own, self.mixed))
        return _Normal(self.shared, self.step, *parts)

    @property
    def steps(self) -> np.ndarray:
        """Change of the quantity in every item alone."""
        return self._solved(self.gradient, self.own, self.mixed)[0]

    @property
    def decrease(self) -> float:
        """Decrease of squares where the quantity differs in all items."""
        return float(self.summed([np.arange(len(self.gradient))]).from_each_on[0])

    @property
    def from_each_on(self) -> np.ndarray:
        """Decrease of squares where the quantity differs from every item on to the last."""
        parts = (self.gradient, self.own, self.mixed)
        return self._solved(*(np.cumsum(part[::-1], axis=0)[::-1] for part in parts))[1]

    def _solved(
        self, s: np.ndarray, own: np.ndarray, a: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        h, s = own - np.einsum("wi,ij,wj->w", a, self.shared, a), s - a @ self.step
        step = np.where(h > FLAT * self.own.sum(), s / np.where(h > 0.0, h, 1.0), 0.0)
        return step, step * s


def find_group(
    problem: EstimationProblem, fit: WindowFit, each_step: EachStep = None
) -> Group | None:
    """Return where a difference explains most, and in what; None where nothing can differ."""
    if not fit.usable:
        return None
    prior, windows = problem.prior, problem.windows
    wanted = [(kind, name) for kind in DIFFERENCES for name in kind.quantities_of(prior)]
    seen = NORMAL_95**2 * max(fit.squares / problem.n_samples, 1.0)
    groups = [
        Group(records, since, until, kind, name, decrease / fit.squares)
        for (kind, name), normal in zip(wanted, _normals(problem, fit, wanted), strict=True)
        for records, since, until, decrease in (
            *_of_records(windows.record, normal, _goes_up(prior, fit, name), seen),
            *_trend(windows, normal),
            *_since(windows, normal),
            *_gradual(windows, normal),
        )
    ]
    groups += [
        Group(records, since, end and until, *what, normal.of(chosen).decrease / fit.squares)
        for since in _within_windows(problem)
        for end in (None, windows.t.max())
        for what, normal in zip(
            wanted, _normals(problem, fit, wanted, mark_at(windows.t, since, end)), strict=True
        )
        for records, until, chosen in _each_and_all(windows)
    ]
    groups.sort(key=SHARE, reverse=True)
    return DifferenceFits(problem, fit, each_step).best(groups)


def _within_windows(problem: EstimationProblem) -> np.ndarray:
    """Return onsets that are tried where windows are too few to begin near every one."""
    windows = problem.windows
    if len(windows) >= ONSETS * (len(windows.bounds) - 1):
        return np.empty(0)
    return np.quantile(windows.t, np.arange(1, ONSETS) / ONSETS)


def n_groups(problem: EstimationProblem) -> int:
    """Return how many groups of one quantity are compared."""
    count = len(problem.windows.bounds) - 1
    starts = max(2 * len(problem.windows) - count - 1, 0) + max(count - 1, 0) + (count > 2)
    within, of = max(2 * len(_within_windows(problem)), ONSETS - 1), _each_and_all(problem.windows)
    return starts + within * len(of)


def _normals(
    problem: EstimationProblem,
    fit: WindowFit,
    wanted: list[tuple[type[Difference], str]],
    marks: np.ndarray | None = None,
) -> list[_Normal]:
    """Return the normal equations of every quantity in every window, by default all of it."""
    windows, values = problem.windows, fit.model.parameters
    free = [f for f in fit.freedoms if f.low < values[f.name].value < f.high]  # can compensate
    columns = {ALL: np.ones(len(windows.t))} | ({} if marks is None else {MARKED: marks})
    effects = [kind(pair(name, column)) for column in columns for kind, name in wanted]
    inputs = {**fit.model.inputs, **dict.fromkeys(columns, "")}
    model = reduce(add, effects, fit.model.replace(inputs=inputs))
    own = [name for effect in effects for name in effect.names().values()]
    marked = replace(windows, u=np.column_stack([windows.u, *columns.values()]))
    evaluation = evaluate(model, marked, fit.x0, (*(f.name for f in free), *own))
    estimate, n = problem.states.estimate(fit.model), len(free)
    offset = fit.x0 - estimate.x[windows.starts]
    normal = project(evaluation.gram, n + len(own), estimate.spread**-2.0, offset)
    pull, last = prior_precision(tuple(free)), n + len(own) - len(wanted)
    return [_normal_of(normal, pull, n + i, last + i) for i in range(len(wanted))]


def _normal_of(normal: Normal, pull: np.ndarray, usual: int, q: int) -> _Normal:
    """Return the normal equations of a quantity; windows share parameters and its usual value.

    So what is the same everywhere, if only beyond a limit, is no difference.
    """
    n = len(pull)
    every = [*range(n), usual]
    of_shared = normal.hessian[:, every][:, :, every].sum(axis=0)
    of_shared[:n, :n] += pull
    size = np.sqrt(np.maximum(np.diag(of_shared), np.finfo(float).tiny))
    shared = np.linalg.pinv(of_shared / np.outer(size, size), rcond=FLAT, hermitian=True)
    shared /= np.outer(size, size)
    slope = np.append(np.zeros(n), normal.gradient[:, usual].sum())  # the parameters are fitted
    mixed = normal.hessian[:, every, q]
    return _Normal(shared, shared @ slope, normal.gradient[:, q], normal.hessian[:, q, q], mixed)


def _goes_up(prior: PhysicsModel, fit: WindowFit, name: str) -> bool:
    """Return whether records with more of a quantity are further from what the prior says."""
    given, found = prior.parameters.get(name), fit.model.parameters.get(name)
    return given is None or found is None or found.value >= given.value


#: records, onset, end of growth, and decrease of squares
_Found = tuple[tuple[int, ...], float | None, float | None, float]


def _of_records(
    record: np.ndarray, normal: _Normal, goes_up: bool, seen: float
) -> Iterator[_Found]:
    """Yield the group of records, fewer than the others, in which a difference explains most.

    It has no records that explain less than what is seen in one.
    """
    known = np.unique(record)
    if len(known) < 2:
        return
    each = normal.summed([record == r for r in known])
    order = np.argsort(each.steps if goes_up else -each.steps, kind="stable")
    upper, lower = each.of(order), each.of(order[::-1])
    for part, places in ((upper, order), (lower, order[::-1])):
        left = (len(known) - (part is lower)) // 2  # of two equal parts only the upper one
        decreases, some = part.from_each_on, np.arange(len(known) - left, len(known))
        if some.size:
            first = some[decreases[some] >= decreases[some].max() - seen][-1]
            of = tuple(sorted(known[places[first:]].tolist()))
            yield of, None, None, float(decreases[first])


def _trend(windows: ShootingWindows, normal: _Normal) -> Iterator[_Found]:
    """Yield all records, in which a difference rises in equal steps, if they are more than two."""
    last = len(windows.bounds) - 2
    if last > 1:
        rising = normal.weighted(windows.record / last)
        yield tuple(range(last + 1)), None, None, rising.decrease


def _since(windows: ShootingWindows, normal: _Normal) -> Iterator[_Found]:
    """Yield the onset from which on a difference explains most, in every record and in all."""
    starts = windows.t[windows.starts]
    for of, _, chosen in _each_and_all(windows):
        order = chosen[np.argsort(starts[chosen], kind="stable")]
        is_later = np.diff(starts[order], prepend=starts[order[0]]) > 0.0
        decreases = np.where(is_later, normal.of(order).from_each_on, 0.0)
        best = int(np.argmax(decreases))
        if is_later[best]:
            yield of, float(starts[order[best]]), None, float(decreases[best])


def _gradual(windows: ShootingWindows, normal: _Normal) -> Iterator[_Found]:
    """Yield the onset from which on a difference that grows explains most, in each and in all."""
    starts = windows.t[windows.starts]
    middle = (starts + windows.t[windows.starts + windows.lengths - 1]) / 2.0
    for of, end, chosen in _each_and_all(windows):
        mine, at = normal.of(chosen), middle[chosen]
        onsets = np.quantile(starts[chosen], np.arange(1, ONSETS) / ONSETS).tolist()
        decreases = [mine.weighted(mark_at(at, since, end)).decrease for since in onsets]
        best = int(np.argmax(decreases))
        yield of, onsets[best], end, decreases[best]


def _each_and_all(windows: ShootingWindows) -> list[tuple[tuple[int, ...], float, np.ndarray]]:
    """Return the records, their last time and their windows: of all together, and of each."""
    known = np.unique(windows.record).tolist()
    last, some = windows.t[windows.bounds[1:] - 1], [known, *([r] for r in known if len(known) > 1)]
    return [
        (tuple(of), float(last[of].max()), np.flatnonzero(np.isin(windows.record, of)))
        for of in some
    ]
