"""Windows fitted with the wrong sign, where a sensor shows the magnitude of a state only.

A way through zero, or near it, can be fitted in two ways then, and no small step leads from the one
to the other.
"""

from collections.abc import Callable, Iterator

import numpy as np

from sklearn_pgnn.simulation.state_estimate import free_run, unsigned_states
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import ShootingWindows


def turn_poor_windows(
    fit: WindowFit,
    windows: ShootingWindows,
    expected: np.ndarray,
    spread: np.ndarray,
    tolerance: float,
    each_step: Callable[[], None] | None = None,
) -> WindowFit:
    """Fit again with other initial states in the windows that are worse than the median.

    Fits of models whose outputs show the sign of every state stay as they are.

    Parameters
    ----------
    fit : WindowFit
        A fit.
    windows : ShootingWindows
        Its windows.
    expected : ndarray of shape (n_windows, n_states)
        Expected initial states.
    spread : ndarray of shape (n_states,)
        How uncertain they are.
    tolerance : float
        Relative decrease of the objective at which a fit ends.
    each_step : callable, optional
        See `fit_windows`.

    Returns
    -------
    WindowFit
        The better fit.
    """
    unsigned, squares = unsigned_states(fit.model), fit.evaluation.squares
    poor = np.flatnonzero(squares > np.median(squares))
    if not unsigned or not poor.size or not fit.usable:
        return fit
    x0, least = fit.x0.copy(), squares[poor]
    for begin in _other_starts(fit, windows, poor, unsigned):
        tried = fit_windows(
            fit.model,
            windows.select(poor),
            (),
            expected[poor],
            spread,
            x0_start=begin,
            tolerance=tolerance,
            each_step=each_step,
        )
        better = tried.evaluation.squares < least
        x0[poor[better]] = tried.x0[better]
        least = np.minimum(least, tried.evaluation.squares)
    again = fit_windows(
        fit.model,
        windows,
        fit.freedoms,
        expected,
        spread,
        x0_start=x0,
        tolerance=tolerance,
        each_step=each_step,
    )
    return min(fit, again, key=lambda each: each.objective)


def _other_starts(fit, windows, which, unsigned) -> Iterator[np.ndarray]:
    """Turn initial states, or their velocities only; or begin where the windows before lead."""
    x0, states = fit.x0[which], list(fit.model.states)
    velocities = [state for state in unsigned if state in fit.model.slope_pairs]
    turn = np.where(np.isin(states, unsigned), -1.0, 1.0)
    yield turn * x0
    yield np.where(np.isin(states, velocities), -1.0, 1.0) * x0
    starts, ends, reached = windows.starts, windows.starts + windows.lengths, x0.copy()
    for row, w in enumerate(which):
        if starts[w] != windows.bounds[windows.record[w]] and ends[w - 1] == starts[w]:
            before = free_run(fit.model, windows, starts[w - 1], starts[w] + 1, fit.x0[w - 1])
            reached[row] = before.x[-1]
    yield reached
    yield turn * reached
