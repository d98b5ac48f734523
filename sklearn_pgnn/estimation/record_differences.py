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
which the quantity is larger is then the next best. For a trend from record to record the sums are
weighted, from zero in the first record to one in the last.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.budgets import KEPT, STEPS
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.effects.differences import AND, DIFFERENCES, IN, SINCE, TREND, Difference
from sklearn_pgnn.physics.effects.targets import pair
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.normal_equations import Normal, project
from sklearn_pgnn.simulation.window_fit import (
    ParameterPrior,
    WindowFit,
    fit_windows,
    prior_precision,
)
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate
from sklearn_pgnn.trajectories.record import Record

#: a column that is one in every record: what differs in all of them is what any may differ in
ALL = f"{IN}all_records"
#: and one that is one in a group
MARKED = f"{IN}marked"
#: longest column that is made of the names of its records
LONGEST = 60
#: onsets that are compared at a time
ONSETS = 12
#: part of a quantity's own curvature below which shared parameters take its place
FLAT = 1e-9


class Group(NamedTuple):
    """Records that may differ from the others, or from an onset on from what they were before.

    All records without an onset differ by a trend from the first to the last.
    """

    records: tuple[int, ...]
    since: float | None
    kind: type[Difference]
    quantity: str
    share: float


class Marked(NamedTuple):
    """A model and its records with a column that marks a group, and what may differ there."""

    model: PhysicsModel
    records: tuple[Record, ...]
    candidates: tuple[Difference, ...]
    column: str


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
    problem: EstimationProblem, fit: WindowFit, each_step: Callable[[], bool | None] | None = None
) -> Group | None:
    """Return where a difference explains most, and in what; None where nothing can differ."""
    if not fit.usable:
        return None
    prior, windows = problem.prior, problem.windows
    wanted = [(kind, name) for kind in DIFFERENCES for name in kind.quantities_of(prior)]
    groups = [
        Group(records, since, kind, name, decrease / fit.squares)
        for (kind, name), normal in zip(wanted, _normals(problem, fit, wanted), strict=True)
        for records, since, decrease in (
            *_of_records(windows.record, normal, _goes_up(prior, fit, name)),
            *_trend(windows, normal),
            *_since(windows, normal),
        )
    ]
    groups += [
        Group(records, since, kind, name, decrease / fit.squares)
        for since in _within_windows(problem)
        for (kind, name), normal in zip(
            wanted, _normals(problem, fit, wanted, (windows.t >= since).astype(float)), strict=True
        )
        for records, decrease in _in_each_and_all(windows.record, normal)
    ]
    groups.sort(key=_share, reverse=True)
    return _Fits(problem, fit, each_step).best(groups)


def _share(group: Group) -> float:
    return group.share


class _Fits:
    """Fits of what may differ, and since when: a large difference is far from linear."""

    def __init__(
        self,
        problem: EstimationProblem,
        fit: WindowFit,
        each_step: Callable[[], bool | None] | None,
    ):
        self.problem, self.fit, self.each_step = problem, fit, each_step
        windows = problem.windows
        self.record = windows.record_at(np.arange(len(windows.t)))

    def best(self, groups: list[Group]) -> Group | None:
        """Return the best of groups in the order of what they explain by a linear model."""
        of_records = {g.records: g for g in reversed(groups) if g.since is None}  # the last is best
        usual = sorted(of_records.values(), key=_share, reverse=True)[:KEPT]
        best = max(map(self.tried, usual), key=_share, default=None)
        first = next((group for group in groups if group.since is not None), None)
        if first is None or (best is not None and best.share >= first.share):
            return best
        near = [g for g in reversed(groups) if g.records == first.records and g.since is not None]
        of_each = {(group.kind, group.quantity): group for group in near}
        sudden = self.settled(list(of_each.values()))
        return sudden if best is None else max(best, sudden, key=_share)

    def settled(self, groups: list[Group]) -> Group:
        """Return the group with the onset, to a sample, that leaves least.

        Every quantity has an onset of its own; the better half goes on to smaller steps.
        """
        tried = [self.tried(group) for group in groups]
        step = max(1, len(self._times(groups[0])) // ONSETS)
        while step:
            tried = [self._nearest(group, step) for group in tried]
            tried.sort(key=_share, reverse=True)
            tried, step = tried[: -(-len(tried) // 2)], step // 2
        return tried[0]

    def _times(self, group: Group) -> np.ndarray:
        """Return the times of the samples of the records of a group."""
        return np.unique(self.problem.windows.t[np.isin(self.record, group.records)])

    def _nearest(self, group: Group, step: int) -> Group:
        """Move the onset by steps of some samples as long as less is left."""
        times = self._times(group)
        while True:
            here = int(np.searchsorted(times, float(group.since or 0.0)))
            places = [k for k in (here - step, here + step) if 0 < k < len(times)]
            tried = [self.tried(group._replace(since=float(times[k]))) for k in places]
            better = max(tried, key=_share, default=group)
            if better.share <= group.share:
                return group
            group = better

    def tried(self, group: Group) -> Group:
        """Return a group with the share of the squares that a fit of its difference explains."""
        windows, cause = self.problem.windows, group.kind(pair(group.quantity, MARKED))
        wider = self.fit.model.replace(inputs={**self.fit.model.inputs, MARKED: ""})
        model = wider + cause
        ((field, name),) = cause.names().items()
        low, high = cause.limits(cause.target, wider, self.problem.scales).get(
            field, model.parameters[name].bounds
        )
        own = ParameterPrior(name, low, high, 0.0, np.inf, 1.0)
        marks = _marks(group, self.record, windows.t, len(windows.bounds) - 1)
        marked = replace(windows, u=np.column_stack([windows.u, marks]))
        again = fit_windows(
            model,
            marked,
            (*self.fit.freedoms, own),
            *self.problem.states.expected_starts(self.fit.model, windows),
            x0_start=self.fit.x0,
            max_steps=STEPS,
            each_step=self.each_step,
        )
        share = 1.0 - again.squares / self.fit.squares
        return group._replace(share=share if again.usable else 0.0)


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
    return starts + len(_within_windows(problem)) * len(_each_and_all(problem.windows.record))


def _normals(
    problem: EstimationProblem,
    fit: WindowFit,
    wanted: list[tuple[type[Difference], str]],
    marks: np.ndarray | None = None,
) -> list[_Normal]:
    """Return the normal equations of every quantity in every window, by default all of it."""
    windows, free = problem.windows, [f for f in fit.freedoms if _is_within(fit.model, f)]
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


def _is_within(model: PhysicsModel, freedom: ParameterPrior) -> bool:
    """Return whether a parameter lies between its limits, so that it can compensate."""
    return freedom.low < model.parameters[freedom.name].value < freedom.high


def _goes_up(prior: PhysicsModel, fit: WindowFit, name: str) -> bool:
    """Return whether records with more of a quantity are further from what the prior says."""
    given, found = prior.parameters.get(name), fit.model.parameters.get(name)
    return given is None or found is None or found.value >= given.value


#: records, onset and decrease of squares
_Found = tuple[tuple[int, ...], float | None, float]


def _of_records(record: np.ndarray, normal: _Normal, goes_up: bool) -> Iterator[_Found]:
    """Yield the group of records, fewer than the others, in which a difference explains most."""
    known = np.unique(record)
    if len(known) < 2:
        return
    each = normal.summed([record == r for r in known])
    order = np.argsort(each.steps if goes_up else -each.steps, kind="stable")
    upper, lower = each.of(order), each.of(order[::-1])
    for part, places in ((upper, order), (lower, order[::-1])):
        left = (len(known) - (part is lower)) // 2  # of two equal parts only the upper one
        decreases = part.from_each_on
        first = max(range(len(known) - left, len(known)), key=lambda k: decreases[k], default=0)
        if first > 0:
            yield tuple(sorted(known[places[first:]].tolist())), None, float(decreases[first])


def _trend(windows: ShootingWindows, normal: _Normal) -> Iterator[_Found]:
    """Yield all records, in which a difference rises in equal steps, if they are more than two."""
    last = len(windows.bounds) - 2
    if last > 1:
        rising = normal.weighted(windows.record / last)
        yield tuple(range(last + 1)), None, float(rising.from_each_on[0])


def _since(windows: ShootingWindows, normal: _Normal) -> Iterator[_Found]:
    """Yield the onset from which on a difference explains most, in every record and in all."""
    starts = windows.t[windows.starts]
    for chosen in _each_and_all(windows.record):
        order = chosen[np.argsort(starts[chosen], kind="stable")]
        is_later = np.diff(starts[order], prepend=starts[order[0]]) > 0.0
        decreases = np.where(is_later, normal.of(order).from_each_on, 0.0)
        best = int(np.argmax(decreases))
        if is_later[best]:
            of = tuple(np.unique(windows.record[chosen]).tolist())
            yield of, float(starts[order[best]]), float(decreases[best])


def _in_each_and_all(
    record: np.ndarray, normal: _Normal
) -> Iterator[tuple[tuple[int, ...], float]]:
    """Yield every record and all of them, with the decrease of squares there."""
    for chosen in _each_and_all(record):
        yield tuple(np.unique(record[chosen]).tolist()), float(normal.of(chosen).from_each_on[0])


def _each_and_all(record: np.ndarray) -> list[np.ndarray]:
    """Return the windows of all records together, and of each."""
    known = np.unique(record)
    return [np.arange(len(record)), *(np.flatnonzero(record == r) for r in known if known.size > 1)]


def mark(model: PhysicsModel, records: tuple[Record, ...], group: Group) -> Marked:
    """Return a model and its records with a column that is one in a group, else zero."""
    column = _column(model, records, group)
    marked = tuple(
        replace(
            record,
            u=np.column_stack(
                [record.u, _marks(group, np.full(len(record.t), r), record.t, len(records))]
            ),
        )
        for r, record in enumerate(records)
    )
    candidates = [
        kind(pair(name, column)) for kind in DIFFERENCES for name in kind.quantities_of(model)
    ]
    wider = model.replace(inputs={**model.inputs, column: ""})
    return Marked(wider, marked, tuple(candidates), column)


def _marks(group: Group, record: np.ndarray, t: np.ndarray, n_records: int) -> np.ndarray:
    """Return the column of a group, or of a trend, at samples of some records."""
    if _is_trend(group, n_records):
        return record / (n_records - 1.0)
    is_later = t >= (-np.inf if group.since is None else group.since)
    return (np.isin(record, group.records) & is_later).astype(float)


def _is_trend(group: Group, n_records: int) -> bool:
    return group.since is None and len(group.records) == n_records


def _column(model: PhysicsModel, records: tuple[Record, ...], group: Group) -> str:
    """Return a name for a group: that of its records, if these are short, and its onset."""
    if _is_trend(group, len(records)):
        return TREND
    names = [re.sub(r"\W+", "_", records[r].name) for r in group.records]
    name = IN + AND.join(names)
    if len(names) == len(records):
        name = f"{IN}all"
    elif len(name) > LONGEST:
        name = f"{IN}group_{len(model.inputs)}"
    if group.since is None:
        return name
    time = np.format_float_positional(group.since, 4, unique=False, fractional=False, trim="-")
    return name + SINCE + re.sub(r"\W", "p", time)
