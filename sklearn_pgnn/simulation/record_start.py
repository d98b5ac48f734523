"""Where a record begins, in states that it neither shows nor tells."""

import itertools

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import StateEstimator
from sklearn_pgnn.simulation.window_fit import fit_windows
from sklearn_pgnn.simulation.windows import Windows

#: another start must lower the squares of a record's first window to this share
CLEARLY = 1 / 2
#: steps in which the initial states are fitted
STEPS = 8


def find_starts(model: PhysicsModel, windows: Windows, states: StateEstimator) -> None:
    """Begin hidden states where they usually are, if a record's first window clearly says so.

    A model's own initial state may be a bad place to start from: an empty tank has a level whose
    outflow has no slope, and no small step leads from there.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    windows : Windows
        The records' windows.
    states : StateEstimator
        Estimates the initial states; told where records begin.
    """
    hidden = [list(model.states).index(state) for state in states.hidden(model)]
    begins = np.searchsorted(windows.starts, windows.bounds[:-1])
    unknown = [_unknown(states.starts[r], model, hidden) for r in range(begins.size)]
    if not any(unknown):
        return
    usual = states.estimate(model)
    expected = usual.x[windows.bounds[:-1]]
    elsewhere = expected.copy()
    for r, (a, b) in enumerate(itertools.pairwise(windows.bounds)):
        elsewhere[r, unknown[r]] = np.median(usual.x[a:b, unknown[r]], axis=0)
    first = windows.select(begins)
    here, there = (
        fit_windows(model, first, (), x0, usual.spread, max_steps=STEPS)
        for x0 in (expected, elsewhere)
    )
    better = there.evaluation.squares < CLEARLY * here.evaluation.squares
    names = list(model.states)
    for r in np.flatnonzero(better).tolist():
        states.starts[r].update({names[i]: there.x0[r, i] for i in unknown[r]})


def _unknown(start: dict[str, float], model: PhysicsModel, hidden: list[int]) -> list[int]:
    """Give the hidden states of which a record does not tell where they begin."""
    names = list(model.states)
    return [i for i in hidden if not np.isfinite(start[names[i]])]
