"""Places where what a hypothesis leaves may act: of many, those where any input explains most."""

import numpy as np

from sklearn_pgnn.estimation.budgets import KEPT, ROUNDING, SAMPLES, STRETCHES
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.simulation.added_response import AddedResponse, Addition, gains_at
from sklearn_pgnn.simulation.windows import ShootingWindows

#: most corners of a hidden input in a window. More follow a faster one, and take longer
CORNERS = 20
#: numbers of states and samples whose transitions are found. More show more of a rare event
STATES = 4 * SAMPLES


def likely_places(
    problem: EstimationProblem, trial: FittedHypothesis, names: tuple[str, ...]
) -> tuple[str, ...]:
    r"""Return the places where a hidden input explains most of what a hypothesis leaves.

    In every window of its own the input is a polygon of at most `CORNERS` corners, the columns of
    :math:`C`; it explains the squares :math:`\|C C^+ r\|^2` of the residuals :math:`r`.
    """
    if len(names) <= KEPT or trial.fit.model.opaque_functions:
        return names
    fit = trial.fit
    some = windows_looked_at(problem.windows, fit.evaluation.squares, len(fit.model.states))
    windows = problem.windows.select(some)
    response = AddedResponse(fit.model, windows, fit.evaluation.x0[some])
    if not (some.size and response.is_finite):
        return names
    residual = response.without_states(fit.evaluation.residual[..., None])
    polygons = _polygons(windows)
    explained = {}
    for name in names:
        gains = gains_at(response, name)
        columns = [Addition(tuple((i, g * each) for i, g in gains)) for each in polygons]
        explained[name] = _explained(windows, response.to(columns), residual)
    best = sorted(names, key=lambda name: -explained[name])[:KEPT]
    return tuple(name for name in names if name in best)


def windows_looked_at(windows: ShootingWindows, squares: np.ndarray, n_states: int) -> np.ndarray:
    """Return the windows of which transitions are found: fewer of a model with many states."""
    known = np.flatnonzero(np.isfinite(squares))
    size = int(windows.lengths[known].sum()) * n_states
    return known[:: max(1, min(size // STATES, known.size // STRETCHES))]


def _polygons(windows: ShootingWindows) -> np.ndarray:
    """Return an input with one corner in every window, a row for each corner."""
    count = int(min(CORNERS, windows.lengths.max()))
    found = np.zeros((count, windows.t.size))
    for a, n in zip(windows.starts, windows.lengths, strict=True):
        along = np.linspace(0.0, count - 1.0, n)
        found[:, a : a + n] = np.maximum(0.0, 1.0 - np.abs(along - np.arange(count)[:, None]))
    return found


def _explained(windows: ShootingWindows, columns: np.ndarray, residual: np.ndarray) -> float:
    """Return the squares that columns explain, window by window."""
    ends = np.cumsum(windows.lengths)[:-1]
    total = 0.0
    for part, left in zip(np.split(columns, ends), np.split(residual, ends), strict=True):
        basis, sizes, _ = np.linalg.svd(part.reshape(left.size, -1), full_matrices=False)
        told = basis[:, sizes > ROUNDING * sizes[0]].T @ left.ravel()
        total += float(told @ told)
    return total
