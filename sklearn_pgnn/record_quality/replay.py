"""Replays: the records' inputs, played back faster or slower to the model."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.limits import REPLAYS, TWICE
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows


@dataclass(frozen=True)
class Replay:
    """Inputs at another speed, and what the states would then have been.

    `known` is where the inputs had not come to their end; all have a row per sample.
    """

    u: np.ndarray
    x: np.ndarray
    known: np.ndarray


def replay_inputs(
    problem: EstimationProblem, fit: WindowFit, x: np.ndarray
) -> Iterator[list[Replay]]:
    """Yield the trajectories of the machine if its inputs had run at other speeds.

    The speeds are up to twice as fast and as slow, and at least by the root of two; all inputs run
    together. Every speed is replayed in several ways, for the one or the other is unlike an
    experiment. The speed changes at once, or over the time in which the outputs do: a machine may
    have been at rest when the record began, or in motion. And the states are those of a free run of
    the model, or those of the records with the change that the other inputs make of such a run: the
    first have the errors of the model, the second those of the records.
    """
    windows = problem.windows
    run = _free_runs(fit.model, windows, x)
    powers = np.linspace(0.5, 1.0, REPLAYS // 2)
    for speed in TWICE ** np.concatenate([-powers, powers]):
        ways = []
        for time in (0.0, problem.period / (2 * np.pi)):
            u, known = _at_speed(windows, float(speed), time)
            other = _free_runs(fit.model, replace(windows, u=u), x)
            ways += [Replay(u, other, known), Replay(u, x + other - run, known)]
        yield ways


def _free_runs(model: PhysicsModel, windows: ShootingWindows, x) -> np.ndarray:
    """Return the states of every record, simulated from where it begins."""
    spans = pairwise(windows.bounds)
    return np.concatenate([free_run(model, windows, a, b, x[a]).x for a, b in spans])


def _at_speed(windows: ShootingWindows, speed: float, time: float):
    r"""Return the inputs at the time :math:`s t + (1 - s) T (1 - e^{-t/T})`, and where there are.

    At :math:`t = 0` nothing changes, and after some times :math:`T` the speed is :math:`s`.
    """
    u, known = np.empty_like(windows.u), np.zeros(windows.t.size, dtype=bool)
    for a, b in pairwise(windows.bounds):
        t = windows.t[a:b] - windows.t[a]
        late = -time * np.expm1(-t / time) if time > 0 else 0.0
        at = speed * t + (1 - speed) * late
        known[a:b] = at <= t[-1]
        # held values that were repeated or left out would make a smooth input rough
        u[a:b] = np.column_stack([np.interp(at, t, column) for column in windows.u[a:b].T])
    return u, known


def window_states(problem: EstimationProblem, fit: WindowFit) -> np.ndarray:
    """Return the states of a fitted model, every window simulated from its fitted initial state."""
    windows, x = problem.windows, problem.states.values(fit.model).copy()
    for a, n, x0 in zip(windows.starts, windows.lengths, fit.x0, strict=True):
        run = free_run(fit.model, windows, a, a + n, x0).x
        if np.isfinite(run).all():
            x[a : a + n] = run
    return x
