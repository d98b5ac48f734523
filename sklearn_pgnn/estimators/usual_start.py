"""Where a fitted model starts the trajectories of which no table gives the initial state."""

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.finite_run import FreeRuns

#: least share of the free-run error that another initial state has to remove
LEAST_SHARE = 0.05


def with_usual_start(
    model: PhysicsModel, records, found: np.ndarray, runs: FreeRuns, noise: np.ndarray
) -> PhysicsModel:
    """Return a model that starts where its records did on average, if that describes them better.

    A machine at rest stays exactly there: what noise adds to a fitted state changes no error.

    Examples
    --------
    >>> from sklearn_pgnn.trajectories import read_records
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.arange(9.0)
    >>> records = read_records(lag, np.column_stack([t, 0 * t]), 3 * np.exp(-t / 2))
    >>> runs = FreeRuns(1.0, 4, np.array([np.inf]), "zoh")
    >>> with_usual_start(lag, records, np.array([[3.0]]), runs, np.ones(1)).initial_state["y"]
    3.0
    """
    told = np.isfinite(np.array([record.x0 for record in records])).any(axis=0).tolist()
    means = {
        state: float(np.mean(column[np.isfinite(column)]))
        for state, column, is_told in zip(model.states, found.T, told, strict=True)
        if not is_told and state not in model.settled and np.isfinite(column).any()
    }
    if not means:
        return model
    other = model.replace(initial_state={**model.initial_state, **means})
    own, moved = (free_run_error(each, records, runs, noise) for each in (model, other))
    return other if moved < (1 - LEAST_SHARE) * own else model


def free_run_error(model, records, runs: FreeRuns, noise) -> float:
    """Return the sum of squares of a free run's errors, infinite where one diverges."""
    total = 0.0
    for record in records:
        with np.errstate(all="ignore"):
            left = (runs.run(model, record).y - record.y) / noise
            total += float(np.sum(left**2, where=np.isfinite(record.y)))
    return total if np.isfinite(total) else np.inf
