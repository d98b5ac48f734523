"""Integration steps where samples lie further apart than in a fit.

A fit finds how many integration steps its sample interval takes. Elsewhere an integration step is
nowhere longer than that: rows of a slower table, n sample intervals apart, take n times as many.
Within a table the time loop itself divides long intervals.
"""

from dataclasses import replace

import numpy as np

from sklearn_pgnn.simulation.stepping import usual_interval
from sklearn_pgnn.trajectories.record import Record


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
