r"""Initial states for free runs: fitted to as much of a record's beginning as makes them certain.

A free run repeats an error of its initial state all along, a lightly damped or an unstable machine
most of all. The state is fitted to the first :math:`n` samples. With their residuals' power
:math:`\phi_n` in units of the noise, their information :math:`H_n` and the spread :math:`\Sigma` of
its estimate, its covariance and the power of the outputs' errors that follow are

.. math:: C_n = (H_n / \phi_n + \Sigma^{-1})^{-1}, \qquad
          e_n = \mathrm{mean}_k\ \frac{\partial y_k}{\partial x_0} C_n
          \left(\frac{\partial y_k}{\partial x_0}\right)^T / \sigma^2 .

The number of samples is doubled until :math:`e_n` does not matter beside the noise or no longer
falls, and only as long as the model follows them: the start is not to make up for a wrong model.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import StateEstimator, free_run
from sklearn_pgnn.simulation.uncertainty import propagated_variance
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import ShootingWindows

#: powers in units of the noise: of errors that are negligible, and of what a model follows
NEGLIGIBLE, FOLLOWED = 0.01, 4.0
#: spread of a state that is known, as a share of that of its estimate
KNOWN = 1e-6


def fit_starts(
    model: PhysicsModel,
    windows: ShootingWindows,
    states: StateEstimator,
    begun: np.ndarray | None = None,
    last: int | None = None,
) -> np.ndarray:
    """Return initial states by record, up to the last: as given, as settled, else fitted.

    Settled states begin at the first input, or where others found that every record has `begun`.
    """
    estimate, found = states.estimate(model), []
    for record, told in enumerate(states.told[:last]):
        own = _of_record(windows, record)
        settled = _settled(model, own.u[0] if begun is None else begun[record], begun is None)
        read = set(zip(map(str, model.outputs.values()), own.y[0].tolist(), strict=True))
        given = {**settled, **{s: value for s, value in told.items() if (s, value) not in read}}
        found.append(
            _fitted(model, own, estimate.x[windows.bounds[record]], estimate.spread, given)
        )
    return np.array(found)


def _fitted(
    model: PhysicsModel,
    record: ShootingWindows,
    expected: np.ndarray,
    spread: np.ndarray,
    given: Mapping[str, float],
) -> np.ndarray:
    """Return the initial state of one record."""
    fixed = np.array([state in given for state in model.states])
    expected = np.array(
        [given.get(s, e) for s, e in zip(model.states, expected.tolist(), strict=True)]
    )
    spread = np.where(fixed, KNOWN * spread, spread)
    best, least = expected, math.inf
    for part in () if fixed.all() else _beginnings(record):
        fit = fit_windows(model, part, (), expected[None], spread, x0_start=best[None])
        power = _power(fit) if fit.usable else math.inf
        doubt = _doubt(fit, record, spread, power) if math.isfinite(power) else math.inf
        is_first = best is expected and fit.usable
        if is_first or (doubt < least and power < FOLLOWED):
            best, least = fit.x0[0], doubt
        if doubt > least or not (NEGLIGIBLE < least < math.inf and power < FOLLOWED):
            break
    return np.where(fixed, expected, best)


def _settled(model: PhysicsModel, values: np.ndarray, are_inputs: bool) -> dict[str, float]:
    """Return the states that inputs settle, from the first inputs or from initial states."""
    names = list(model.inputs if are_inputs else model.states)
    return {
        state: float(values[names.index(followed if are_inputs else state)])
        for state, followed in model.settled.items()
        if followed in model.inputs
    }


def _of_record(windows: ShootingWindows, record: int) -> ShootingWindows:
    """Return one record with its first window alone."""
    a, b = windows.bounds[record : record + 2].tolist()
    first = windows.lengths[np.searchsorted(windows.starts, a)]
    return replace(
        windows,
        t=windows.t[a:b],
        u=windows.u[a:b],
        y=windows.y[a:b],
        bounds=np.array([0, b - a]),
        starts=np.array([0]),
        lengths=np.array([first]),
        threads=1,
    )


def _beginnings(record: ShootingWindows) -> Iterator[ShootingWindows]:
    """Yield longer and longer beginnings of a record, the last being all of it."""
    length, whole = int(record.lengths[0]), record.t.size
    while True:
        yield replace(record, lengths=np.array([min(length, whole)]))
        if length >= whole:
            return
        length *= 2


def _power(fit: WindowFit) -> float:
    """Return the power of residuals, in units of the noise and not less."""
    count = np.isfinite(fit.evaluation.residual).sum() - fit.x0.size
    return max(1.0, float(fit.evaluation.squares.sum()) / max(count, 1))


def _doubt(fit: WindowFit, record: ShootingWindows, spread: np.ndarray, power: float) -> float:
    """Return the power of a free run's errors that come from its initial state."""
    states, seen = len(spread), np.isfinite(record.y)
    gram = fit.evaluation.gram[0]
    told = gram[:states, :states] / power * np.outer(spread, spread) + np.eye(states)
    if not np.isfinite(told).all():
        return math.inf
    covariance = np.linalg.pinv(told, hermitian=True) * np.outer(spread, spread)
    run = free_run(fit.model, record, 0, record.t.size, fit.x0[0], ())
    variance = propagated_variance(np.asarray(run.sensitivities), covariance)
    mean = float(np.mean((variance / record.scale**2)[seen]))
    return mean if math.isfinite(mean) else math.inf
