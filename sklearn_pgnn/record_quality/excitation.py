"""Excitation: inputs that hardly change, and parameters that richer ones would determine."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.limits import SHARE, SINES, TWICE
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.simulation.normal_equations import project
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate


def find_dull_input(signal: Signal) -> Finding | None:
    """Find an input that never changes or has two values only.

    >>> still = Signal("u", "V", [np.ones(9)], [np.arange(9.0)], ["a"])
    >>> find_dull_input(still).text
    'u has the value 1 V throughout'
    """
    levels = np.unique(signal.values)
    is_condition = levels.size > 1 and all(np.ptp(piece) == 0.0 for piece in signal.pieces)
    if levels.size > 2 or is_condition:  # a condition of a record is no drive
        return None
    values = " and ".join(signal.measured(level) for level in levels)
    text, remedy = {
        1: (
            f"{signal.name} has the value {values} throughout",
            "vary it: its effect on the machine cannot be identified",
        ),
        2: (
            f"{signal.name} has only the values {values}",
            "drive it at several levels: its gain, offset, dead zone and limit cannot be "
            "distinguished with two levels",
        ),
    }[levels.size]
    return Finding("poor excitation", signal.name, text, float(levels.size), remedy)


def find_first_steps(inputs: Sequence[Signal]) -> Finding | None:
    """Find that inputs change between records only: every record begins with its step.

    What acted before a record is taken to be what its first sample says.
    """
    pieces = [piece for signal in inputs for piece in signal.pieces]
    if any(np.ptp(piece) > 0.0 for piece in pieces):
        return None
    stepped = [signal.name for signal in inputs if np.ptp(signal.values) > 0.0]
    if not stepped:
        return None
    names = ", ".join(stepped)
    return Finding(
        "poor excitation",
        names,
        f"every record has a constant {names} from its first sample on: earlier inputs are assumed "
        f"equal, so delays, lags and backlash cannot be identified",
        float(len(inputs[0].pieces)),
        "start the record before the step, or insert samples before it, with the inputs of that "
        "time and empty (NaN) outputs",
    )


def find_blind_parameters(problem: EstimationProblem, base: WindowFit) -> list[Finding]:
    r"""Find parameters that these records cannot fix and richer ones of the same size could.

    With the Fisher information :math:`H` of the windows, initial states projected out, and the
    parameters' spread :math:`\sigma_i` in the prior, a record leaves the variance
    :math:`v_i = [(H + \mathrm{diag}(\sigma^{-2}))^{-1}]_{ii}`. A parameter is reported if a record
    with the same clock and range of inputs, but many sines, would settle more than twice as much
    of :math:`\sigma_i^2`. What no record settles is not reported.

    .. [1] L. Ljung, "System identification: theory for the user", 2nd ed., Prentice Hall, 1999.
    """
    freedoms = [f for f in base.freedoms if np.isfinite(f.spread) and f.spread > 0]
    if not freedoms or not np.ptp(problem.windows.u, axis=0).any():
        return []
    rich, x0 = rich_windows(base, problem.windows)
    spread = problem.states.estimate(base.model).spread
    here = _shares_left(base.model, problem.windows, base.x0, spread, freedoms)
    there = _shares_left(base.model, rich, x0, spread, freedoms)
    findings = []
    for freedom, mine, best in zip(freedoms, here, there, strict=True):
        if 1 - best > max(SHARE, TWICE * (1 - mine)):
            findings.append(_blind(freedom.name, float(np.sqrt(mine))))
    return findings


def _blind(name: str, share: float) -> Finding:
    return Finding(
        "poor excitation",
        name,
        f"these records reduce the uncertainty of {name} only to {share:.0%}; richer inputs of the "
        f"same size would determine it",
        share,
        f"excite at several frequencies and levels, or measure {name} on its own",
    )


def rich_windows(fit: WindowFit, windows: ShootingWindows) -> tuple[ShootingWindows, np.ndarray]:
    """Return the windows with many sines of the inputs' own range as inputs, and their starts."""
    rng = np.random.default_rng(0)
    u = np.empty_like(windows.u)
    for a, b in pairwise(windows.bounds):
        clock = (windows.t[a:b] - windows.t[a]) / max(windows.t[b - 1] - windows.t[a], 1e-12)
        for i in range(u.shape[1]):
            cycles = np.geomspace(0.5, max((b - a) / 10, 1.0), SINES)
            wave = np.sin(2 * np.pi * (np.outer(clock, cycles) + rng.uniform(size=SINES))).sum(1)
            low, high = windows.u[:, i].min(), windows.u[:, i].max()
            u[a:b, i] = (low + high) / 2 + (high - low) / 2 * wave / np.abs(wave).max()
    rich = replace(windows, u=u)
    return rich, _states_under(fit, windows, rich)


def _states_under(fit: WindowFit, windows: ShootingWindows, other: ShootingWindows) -> np.ndarray:
    """Return the windows' initial states in a free run under other inputs."""
    x0, record = np.empty_like(fit.x0), windows.record
    for r, (a, b) in enumerate(pairwise(windows.bounds)):
        mine = np.flatnonzero(record == r)
        if mine.size:
            run = free_run(fit.model, other, a, b, fit.x0[mine[0]])
            x0[mine] = np.where(np.isfinite(run.x), run.x, fit.x0[mine[0]])[
                windows.starts[mine] - a
            ]
    return x0


def _shares_left(
    model: PhysicsModel,
    windows: ShootingWindows,
    x0: np.ndarray,
    spread: np.ndarray,
    freedoms: Sequence[ParameterPrior],
) -> np.ndarray:
    """Return the share of every parameter's prior variance that the windows leave."""
    information = information_of(model, windows, x0, spread, [f.name for f in freedoms])
    scale = np.array([f.spread for f in freedoms])
    return np.diag(np.linalg.inv(information * np.outer(scale, scale) + np.eye(len(freedoms))))


def information_of(
    model: PhysicsModel,
    windows: ShootingWindows,
    x0: np.ndarray,
    spread: np.ndarray,
    names: Sequence[str],
) -> np.ndarray:
    """Return the information of windows on parameters, initial states projected out."""
    gram = evaluate(model, windows, x0, tuple(names)).gram
    normal = project(gram, len(names), 1.0 / spread**2, np.zeros_like(x0))
    return normal.hessian.sum(axis=0)
