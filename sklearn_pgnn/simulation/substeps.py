r"""How a model goes from sample to sample: by which scheme, and in how many steps.

Explicit steps are stable only where :math:`|\lambda| h` is below some 2.8 for every eigenvalue
:math:`\lambda` of the Jacobian. A simulation beyond that says nothing of the model. So the
steps are chosen from the eigenvalues, which need no simulation that works already, and doubled
until the result hardly changes; a model that is too fast for that makes linearly implicit steps.

A fit finds how many integration steps its sample interval takes. Elsewhere an integration step is
nowhere longer than that: rows of a slower table, n sample intervals apart, take n times as many.
Within a table the time loop itself divides long intervals.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.simulation.model_function import IMPLICIT
from sklearn_pgnn.simulation.stepping import usual_interval
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user

#: the usual scheme
EXPLICIT = "rk4"
#: most steps that are tried
MAX_SUBSTEPS = 32
#: and most implicit ones, where fewer diverge
MOST_IMPLICIT = 16 * MAX_SUBSTEPS
#: change, in tolerances, from which on implicit steps may have gone through a divergence
ROUGH = 100.0
#: largest eigenvalue times step at which explicit steps are taken; they are unstable from 2.78 on
STABLE = 2.0


class Steps(NamedTuple):
    """The scheme of a step, and the number of steps from sample to sample."""

    method: str = EXPLICIT
    substeps: int = 1

    def are_stable(self, fast: float) -> bool:
        """Return whether a model is as fast as these steps allow, or slower.

        >>> Steps("rk4", 4).are_stable(10.0), Steps("rosenbrock", 1).are_stable(1e6)
        (False, True)
        """
        return self.method == IMPLICIT or not fast > STABLE * self.substeps

    @property
    def settings(self) -> dict[str, str | int]:
        """What a model's `simulation` says of them; the usual scheme is not told."""
        told = {} if self.method == EXPLICIT else {"method": self.method}
        return {"substeps": self.substeps, **told}


def given_steps(substeps: int, method: str | None, fast: float) -> Steps:
    """Return so many steps by the given scheme, else by the usual one where that is stable."""
    steps = Steps(method or EXPLICIT, substeps)
    return steps if method or steps.are_stable(fast) else Steps(IMPLICIT, substeps)


def enough_steps(
    run: Callable[[Steps], object],
    change: Callable[[object, object], float],
    fast: float = 0.0,
    substeps: int = 1,
    method: str | None = None,
) -> Steps:
    r"""Double the steps until a simulation hardly changes, by the scheme that needs few.

    ``run`` simulates, ``change`` is the difference of two simulations, the coarse one first, as a
    multiple of the tolerance (not finite if one diverges), ``fast`` the largest
    :math:`|\lambda| h` for one step from sample to sample. Implicit steps are for models with
    stable dynamics that fast only: they would hide a growth. A simulation that diverges is
    reported elsewhere.

    >>> run = lambda steps: (1 + 1 / steps.substeps) ** steps.substeps
    >>> enough_steps(run, lambda one, other: abs(one - other) / 0.1)
    Steps(method='rk4', substeps=8)
    """
    least = substeps
    while least <= MAX_SUBSTEPS and not Steps(EXPLICIT, least).are_stable(fast):
        least *= 2
    tried = []
    if method or least <= MAX_SUBSTEPS:
        first = Steps(method or EXPLICIT, substeps if method else least)
        tried.append(_double(run, change, first))
    if not method and fast > STABLE and not (tried and tried[0][1] < 1.0):
        tried.append(_double(run, change, Steps(IMPLICIT, substeps)))
    found, changed = min(tried, key=lambda each: each[1] if math.isfinite(each[1]) else math.inf)
    diverges = not math.isfinite(changed)
    if diverges or (found.method == IMPLICIT != method and changed > ROUGH):
        return Steps(method or EXPLICIT, max(substeps, MAX_SUBSTEPS))
    if changed >= 1.0:
        warn_user(
            f"the simulation still changes with {found.substeps} integration steps from sample to "
            f"sample, the largest number tried: the model has dynamics much faster than the "
            f"sampling. Remedy: replace the fastest states by their steady-state values, sample "
            f"faster, or set substeps.",
            SimulationWarning,
        )
    return found


def _double(run, change, steps: Steps) -> tuple[Steps, float]:
    """Double the steps until they are enough, and return the last change with them."""
    coarse, changed = run(steps), math.nan
    while True:
        double = Steps(steps.method, 2 * steps.substeps)
        finer = run(double)
        changed = change(coarse, finer)
        if changed < 1.0 or double.substeps > _most(steps, changed):
            return steps, changed
        steps, coarse = double, finer


def _most(steps: Steps, changed: float) -> int:
    """Return how many steps to try: more implicit ones where fewer diverge, as in fast layers."""
    diverges = steps.method == IMPLICIT and not math.isfinite(changed)
    return MOST_IMPLICIT if diverges else MAX_SUBSTEPS


def usual_step(records) -> float:
    """Return the median sample interval of records [s]; infinite if they have a sample each."""
    steps = np.concatenate([np.diff(record.t) for record in records])
    return float(np.median(steps)) if steps.size else np.inf


def without_long_steps(records) -> list[Record]:
    """Return records in which no step is longer than a usual one, to find the substeps of that.

    >>> t, none = np.array([0.0, 1.0, 2.0, 9.0]), np.zeros((4, 0))
    >>> (record,) = without_long_steps([Record(t, none, None, np.zeros(1), "a", np.arange(4))])
    >>> record.t.tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    usual, closed = usual_step(records), []
    for record in records:
        steps = np.diff(record.t)
        steps = np.where(np.rint(steps / usual) > 1, usual, steps)
        closed.append(replace(record, t=record.t[0] + np.append(0.0, np.cumsum(steps))))
    return closed


def substeps_along(record: Record, interval: float, substeps: int) -> int:
    """Return how many integration steps a record takes for its usual sample interval.

    >>> t, none = np.array([0.0, 3.0, 6.0]), np.zeros((3, 0))
    >>> substeps_along(Record(t, none, None, np.zeros(1), "a", np.arange(3)), 1.0, 2)
    6
    """
    usual = usual_interval(record.t)
    if not np.isfinite(usual):
        usual = float(np.max(np.diff(record.t), initial=0.0))
    return substeps * max(1, round(usual / interval))
