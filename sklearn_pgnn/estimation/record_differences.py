r"""Which records differ, and in what: a screen by a linear model of all windows.

With the normal equations :math:`H_r, g_r` of record :math:`r`, its initial states eliminated, a
quantity :math:`q` that is another by :math:`\delta` in a group :math:`A` of records, all shared
parameters :math:`p` re-tuned, lowers the sum of squares by

.. math:: \frac{s^2}{h}, \qquad s = \sum_{r \in A} g_{r,q}, \qquad
          h = \sum_{r \in A} H_{r,qq} - a^T \Big(\sum_r H_{r,pp}\Big)^{-1} a, \qquad
          a = \sum_{r \in A} H_{r,pq}.

Of all groups only those are tried that part the records in the order of :math:`s/h` of each alone:
a record more or less for which the quantity is larger is then the next best.
"""

import re
from dataclasses import replace
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.effects.differences import AND, DIFFERENCES, IN, Difference
from sklearn_pgnn.physics.effects.targets import pair
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.normal_equations import project
from sklearn_pgnn.simulation.window_fit import WindowFit, prior_precision
from sklearn_pgnn.simulation.windows import evaluate
from sklearn_pgnn.trajectories.record import Record

#: a column that is one in every record: what differs in all of them is what any may differ in
ALL = f"{IN}all_records"
#: longest column that is made of the names of its records
LONGEST = 60
#: part of a quantity's own curvature below which shared parameters take its place
FLAT = 1e-9


class Group(NamedTuple):
    """Records that may differ from the others, and the share of the squares that explains."""

    records: tuple[int, ...]
    share: float


class Marked(NamedTuple):
    """A model and its records with a column that marks a group, and what may differ there."""

    model: PhysicsModel
    records: tuple[Record, ...]
    candidates: tuple[Difference, ...]
    column: str


def find_group(problem: EstimationProblem, fit: WindowFit) -> Group | None:
    """Return the records of which a difference explains most; None where there is but one."""
    record = problem.windows.record
    if len(np.unique(record)) < 2 or not fit.usable:
        return None
    wanted = [(kind, name) for kind in DIFFERENCES for name in kind.quantities_of(problem.prior)]
    equations, ups = _by_record(problem, fit, wanted), _goes_up(problem.prior, fit, wanted)
    groups = (_best_group(*equations, place, up) for place, up in enumerate(ups))
    best = max(groups, key=lambda group: group.share)
    return best._replace(share=best.share / fit.squares)


def _by_record(
    problem: EstimationProblem, fit: WindowFit, wanted: list[tuple[type[Difference], str]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the inverse Hessian of the shared parameters, and every record's normal equations."""
    windows, free = problem.windows, [f for f in fit.freedoms if _is_within(fit.model, f)]
    model = fit.model.replace(inputs={**fit.model.inputs, ALL: ""})
    effects = [kind(pair(name, ALL)) for kind, name in wanted]
    model = reduce(add, effects, model)
    own = [name for effect in effects for name in effect.names().values()]
    ones = np.column_stack([windows.u, np.ones(len(windows.t))])
    evaluation = evaluate(model, replace(windows, u=ones), fit.x0, (*(f.name for f in free), *own))
    estimate = problem.states.estimate(fit.model)
    offset = fit.x0 - estimate.x[windows.starts]
    normal = project(evaluation.gram, len(free) + len(own), estimate.spread**-2.0, offset)
    groups = [windows.record == r for r in range(len(windows.bounds) - 1)]
    hessian, gradient = (
        np.array([part[group].sum(axis=0) for group in groups])
        for part in (normal.hessian, normal.gradient)
    )
    n = len(free)
    inverse = np.linalg.pinv(hessian[:, :n, :n].sum(axis=0) + prior_precision(tuple(free)))
    return inverse, hessian, gradient


def _is_within(model: PhysicsModel, freedom) -> bool:
    """Return whether a parameter lies between its limits, so that it can compensate."""
    return freedom.low < model.parameters[freedom.name].value < freedom.high


def _goes_up(
    prior: PhysicsModel, fit: WindowFit, wanted: list[tuple[type[Difference], str]]
) -> list[bool]:
    """Return whether records with more of a quantity are further from what the prior says."""
    found, given = fit.model.parameters, prior.parameters
    return [name not in given or found[name].value >= given[name].value for _, name in wanted]


def _best_group(
    shared: np.ndarray, hessian: np.ndarray, gradient: np.ndarray, place: int, goes_up: bool
) -> Group:
    """Return the group of records of which one quantity explains most, with that decrease."""
    n, count = len(shared), len(hessian)
    q = n + place

    def step(group: tuple[int, ...]) -> tuple[float, float]:
        """Return the change of the quantity, and the decrease of squares."""
        chosen = list(group)
        s, a = gradient[chosen, q].sum(), hessian[chosen][:, :n, q].sum(axis=0)
        h = hessian[chosen, q, q].sum() - a @ shared @ a
        return (s / h, s * s / h) if h > FLAT * hessian[:, q, q].sum() else (0.0, 0.0)

    order = sorted(range(count), key=lambda r: step((r,))[0])
    parts = ((order[:k], order[k:]) if goes_up else (order[k:], order[:k]) for k in range(1, count))
    splits = [tuple(sorted(min(part[::-1], key=len))) for part in parts]
    return max((Group(split, step(split)[1]) for split in splits), key=lambda each: each.share)


def mark(model: PhysicsModel, records: tuple[Record, ...], group: tuple[int, ...]) -> Marked:
    """Return a model and its records with a column that is one in a group, else zero."""
    column = _column(model, records, group)
    marked = tuple(
        replace(record, u=np.column_stack([record.u, np.full(len(record.t), float(r in group))]))
        for r, record in enumerate(records)
    )
    candidates = [
        kind(pair(name, column)) for kind in DIFFERENCES for name in kind.quantities_of(model)
    ]
    wider = model.replace(inputs={**model.inputs, column: ""})
    return Marked(wider, marked, tuple(candidates), column)


def _column(model: PhysicsModel, records: tuple[Record, ...], group: tuple[int, ...]) -> str:
    """Return a name for a group: those of its records, if these are short."""
    name = IN + AND.join(re.sub(r"\W+", "_", records[r].name) for r in group)
    return name if len(name) <= LONGEST else f"{IN}group_{len(model.inputs)}"
