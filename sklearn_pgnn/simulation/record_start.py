"""The initial state of a record, in states that it neither measures nor gives."""

from itertools import pairwise

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import StateEstimator
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import ShootingWindows

#: another start must lower the squares of a record's first window to this share
CLEARLY = 1 / 2
#: quantiles of a simulation in which hidden states are tried as starts
PLACES = (0.25, 0.5, 0.75, 0.95)


def find_starts(model: PhysicsModel, windows: ShootingWindows, states: StateEstimator) -> None:
    """Start hidden states at typical values, if a record's first window is clearly fitted better.

    A model's own initial state may be a poor starting point: in an empty tank the outflow has no
    slope over the level, and no small step leads away from there. Such a start is always left.
    """
    names = list(model.states)
    hidden = [names.index(state) for state in states.hidden(model)]
    unknown = [[i for i in hidden if not np.isfinite(s[names[i]])] for s in states.starts]
    if not any(unknown):
        return
    first = windows.select(np.searchsorted(windows.starts, windows.bounds[:-1]))
    usual = states.estimate(model)
    here = usual.x[windows.bounds[:-1]]
    begun = fit_windows(model, first, (), here, usual.spread)
    least = np.full(len(first), np.inf)
    for place in PLACES:
        there = here.copy()
        for r, (a, b) in enumerate(pairwise(windows.bounds)):
            there[r, unknown[r]] = np.quantile(usual.x[a:b, unknown[r]], place, axis=0)
        tried = fit_windows(model, first, (), there, usual.spread)
        squares = tried.evaluation.squares
        clear = squares < CLEARLY * begun.evaluation.squares
        better = (squares < least) & (clear | _is_stuck(begun, tried, unknown))
        for r in np.flatnonzero(better).tolist():
            least[r] = squares[r]
            states.starts[r].update({names[i]: tried.x0[r, i] for i in unknown[r]})


def _is_stuck(begun: WindowFit, tried: WindowFit, unknown: list[list[int]]) -> np.ndarray:
    """Return for every window whether small changes of a state have no effect there only."""
    here, there = (np.einsum("wii->wi", fit.evaluation.gram) > 0 for fit in (begun, tried))
    lost = ~here & there
    return np.array([bool(lost[r, i].any()) for r, i in enumerate(unknown)])
