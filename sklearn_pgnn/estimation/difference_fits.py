"""Fits of what differs between records, and since when: a large difference is far from linear."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from operator import attrgetter

import numpy as np

from sklearn_pgnn.estimation.budgets import KEPT, STEPS
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.record_groups import Group, marks_of
from sklearn_pgnn.estimation.unusable import BREAKDOWNS
from sklearn_pgnn.physics.effects.differences import IN
from sklearn_pgnn.physics.effects.targets import pair
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, fit_windows

#: a column that is one in a group
MARKED = f"{IN}marked"
#: onsets that are compared at a time
ONSETS = 12
#: the share of the squares that a group explains
SHARE = attrgetter("share")


class DifferenceFits:
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
        usual = sorted(of_records.values(), key=SHARE, reverse=True)[:KEPT]
        best = max(map(self.tried, usual), key=SHARE, default=None)
        first = next((group for group in groups if group.since is not None), None)
        if first is None or (best is not None and best.share >= first.share):
            return best
        near = [g for g in reversed(groups) if g.records == first.records and g.since is not None]
        of_each = {(group.kind, group.quantity): group for group in near}
        sudden = self.settled(list(of_each.values()))
        return sudden if best is None else max(best, sudden, key=SHARE)

    def settled(self, groups: list[Group]) -> Group:
        """Return the group with the onset, to a sample, that leaves least.

        Every quantity has an onset of its own; the better half goes on to smaller steps.
        """
        tried = [self.tried(group) for group in groups]
        step = max(1, len(self._times(groups[0])) // ONSETS)
        while step:
            tried = [self._nearest(group, step) for group in tried]
            tried.sort(key=SHARE, reverse=True)
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
            better = max(tried, key=SHARE, default=group)
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
        marks = marks_of(group, self.record, windows.t, len(windows.bounds) - 1)
        marked = replace(windows, u=np.column_stack([windows.u, marks]))
        with suppress(*BREAKDOWNS):  # another difference may do
            again = fit_windows(
                model,
                marked,
                (*self.fit.freedoms, own),
                *self.problem.states.expected_starts(self.fit.model, windows),
                x0_start=self.fit.x0,
                max_steps=STEPS,
                each_step=self.each_step,
            )
            if again.usable:
                return group._replace(share=1.0 - again.squares / self.fit.squares)
        return group._replace(share=0.0)
