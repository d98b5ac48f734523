"""Fits of what differs between records, and since when: a large difference is far from linear."""

from contextlib import suppress
from dataclasses import replace
from operator import attrgetter

import numpy as np

from sklearn_pgnn.estimation.budgets import KEPT, STEPS
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.record_groups import Group, marks_of
from sklearn_pgnn.estimation.unusable import BREAKDOWNS
from sklearn_pgnn.physics.effects.differences import IN, Difference
from sklearn_pgnn.physics.effects.targets import pair
from sklearn_pgnn.simulation.uncertainty import NORMAL_95
from sklearn_pgnn.simulation.window_fit import EachStep, ParameterPrior, WindowFit, fit_windows

#: a column that is one in every record: what differs in all of them is what any may differ in
ALL = f"{IN}all_records"
#: and one that is one in a group
MARKED = f"{IN}marked"
#: onsets that are compared at a time, and differences of each set of records
ONSETS, EACH = 12, 2
#: steps of a fit, which goes far from where it begins
FAR = 3 * STEPS
#: the shares of the squares that a group explains, and that are left
SHARE, LEFT = attrgetter("share"), attrgetter("left")


class DifferenceFits:
    """Fits of what may differ, and since when; what is wrong everywhere does not differ."""

    def __init__(self, problem: EstimationProblem, fit: WindowFit, each_step: EachStep):
        self.problem, self.fit, self.each_step = problem, fit, each_step
        self.n_records = len(problem.windows.bounds) - 1
        self.record = problem.windows.record_at(np.arange(len(problem.windows.t)))
        self._usual: dict[tuple[type[Difference], str], float] = {}

    def best(self, groups: list[Group]) -> Group | None:
        r"""Return the group that leaves least, of those that explain most by a linear model.

        They are in its order; the best differences of each set of records, and the onsets of the
        first, sudden or gradual. One of :math:`n` onsets costs :math:`2 \log n` squares.
        """
        of_records: dict[tuple[int, ...], list[Group]] = {}
        for group in groups:
            if group.since is None:
                of_records.setdefault(group.records, []).append(group)
        usual = [group for of in list(of_records.values())[:KEPT] for group in of[:EACH]]
        best = min(map(self.tried, usual), key=LEFT, default=None)
        best = best and self._or_other_half(best)
        first = next((group for group in groups if group.since is not None), None)
        if first is None:
            return best
        near = [g for g in groups if g.records == first.records and g.since is not None]
        later, squares = self.settled(_best_of_each(near)), self.fit.squares
        grows = later.until is not None
        otherwise = [g for g in near if g.what == later.what and (g.until is None) == grows]
        later = self.settled([later, *_best_of_each(otherwise)])
        dispersion = max(later.left * squares / self.problem.n_samples, 1.0)
        price = 2.0 * np.log(len(self._times(first))) * dispersion
        is_dear = best is not None and (best.left - later.left) * squares < price
        return best if is_dear else later

    def _or_other_half(self, group: Group) -> Group:
        """Return a group of half the records, or the other half if that differs from the usual."""
        if 2 * len(group.records) != self.n_records:
            return group
        rest = tuple(r for r in range(self.n_records) if r not in group.records)
        others = group._replace(records=rest)
        mine, theirs = (self._left(g, {MARKED: self._marks(g)}) for g in (group, others))
        seen = NORMAL_95**2 * max(theirs / self.problem.n_samples, 1.0)
        return others if theirs < mine - seen else group

    def settled(self, groups: list[Group]) -> Group:
        """Return the best group with its onset; the better half goes on to smaller steps."""
        tried = [self.tried(group) for group in groups]
        step = max(1, len(self._times(groups[0])) // ONSETS)
        while step:
            tried = sorted((self._nearest(group, step) for group in tried), key=LEFT)
            tried, step = tried[: -(-len(tried) // 2)], step // 2
        return tried[0]

    def _times(self, group: Group) -> np.ndarray:
        """Return the times of the samples of the records of a group at which it can begin."""
        times = np.unique(self.problem.windows.t[np.isin(self.record, group.records)])
        return times if group.until is None else times[times < group.until]

    def _nearest(self, group: Group, step: int) -> Group:
        """Move the onset by steps of some samples as long as less is left."""
        times = self._times(group)
        while True:
            here = int(np.searchsorted(times, float(group.since or 0.0)))
            places = [k for k in (here - step, here + step) if 0 < k < len(times)]
            tried = [self.tried(group._replace(since=float(times[k]))) for k in places]
            better = min(tried, key=LEFT, default=group)
            if better.left >= group.left:
                return group
            group = better

    def tried(self, group: Group) -> Group:
        """Return a group with what it explains beyond another usual value, and leaves."""
        what = group.what
        if what not in self._usual:
            self._usual[what] = self._left(group, {ALL: np.ones(len(self.record))})
        left = self._left(group, {ALL: np.ones(len(self.record)), MARKED: self._marks(group)})
        if not np.isfinite(left):
            return group._replace(share=0.0, left=np.inf)
        explained = self._usual[what] - left
        return group._replace(share=explained / self.fit.squares, left=left / self.fit.squares)

    def _marks(self, group: Group) -> np.ndarray:
        """Return the column of a group."""
        return marks_of(group, self.record, self.problem.windows.t, self.n_records)

    def _left(self, group: Group, columns: dict[str, np.ndarray]) -> float:
        """Return the squares that are left where a quantity is another by each of some columns."""
        windows, model = self.problem.windows, self.fit.model
        model, own = model.replace(inputs={**model.inputs, **dict.fromkeys(columns, "")}), []
        for column in columns:
            cause = group.kind(pair(group.quantity, column))
            limits = cause.limits(cause.target, model, self.problem.scales)
            model = model + cause
            ((field, name),) = cause.names().items()
            low, high = limits.get(field, model.parameters[name].bounds)
            own.append(ParameterPrior(name, low, high, 0.0, np.inf, 1.0))
        marked = replace(windows, u=np.column_stack([windows.u, *columns.values()]))
        with suppress(*BREAKDOWNS):  # another difference may do
            again = fit_windows(
                model,
                marked,
                (*self.fit.freedoms, *own),
                *self.problem.states.expected_starts(self.fit.model, windows),
                x0_start=self.fit.x0,
                max_steps=FAR,
                each_step=self.each_step,
            )
            if again.usable:
                return again.squares
        return np.inf


def _best_of_each(groups: list[Group]) -> list[Group]:
    """Return the first group, the best, of every difference in a quantity."""
    return list({group.what: group for group in reversed(groups)}.values())
