"""Windows that got stuck at initial states from which no small step leads on.

Where a sensor shows the magnitude of a state only, a way through zero, or near it, can be fitted
with either sign. Where dry friction holds a state at rest, it stays there however the initial state
is moved a little.
"""

from collections.abc import Callable, Iterator

import numpy as np

from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.simulation.led_states import led_states
from sklearn_pgnn.simulation.source import dry_states
from sklearn_pgnn.simulation.state_estimate import free_run, unsigned_states
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import ShootingWindows


def refit_poor_windows(
    fit: WindowFit,
    windows: ShootingWindows,
    expected: np.ndarray,
    spread: np.ndarray,
    tolerance: float,
    each_step: Callable[[], None] | None = None,
) -> WindowFit:
    """Fit again with other initial states in the windows that may be stuck.

    Fits of models without dry friction whose outputs show the sign of every state stay as they are.

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
    starts = _OtherStarts(fit, windows, expected)
    if not starts.which.size or not fit.usable:
        return fit
    poor, squares = starts.which, fit.evaluation.squares
    x0, least = fit.x0.copy(), squares[poor]
    for begin in starts:
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
    if squares[poor].sum() - least.sum() <= tolerance * fit.objective:
        return fit
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


class _OtherStarts:
    """Windows that may be stuck, and other initial states of theirs to begin from."""

    def __init__(self, fit: WindowFit, windows: ShootingWindows, expected: np.ndarray):
        self.fit, self.windows, self.expected = fit, windows, expected
        self.unsigned = unsigned_states(fit.model)
        self.which = self._poor()

    def _poor(self) -> np.ndarray:
        """Return windows worse than the median; by far, if it is but friction that may stick."""
        squares = self.fit.evaluation.squares
        if self.unsigned:
            return np.flatnonzero(squares > np.median(squares))
        if any(dry_states(self.fit.model)):
            return np.flatnonzero(squares > MUCH**2 * np.median(squares))
        return np.array([], dtype=int)

    def __iter__(self) -> Iterator[np.ndarray]:
        """Begin where expected, and where the windows before lead; with the other signs."""
        reached = self._reached()
        if not self.unsigned:
            yield self.expected[self.which]
            yield reached
            return
        x0, states = self.fit.x0[self.which], list(self.fit.model.states)
        velocities = [state for state in self.unsigned if state in self.fit.model.slope_pairs]
        turn = np.where(np.isin(states, self.unsigned), -1.0, 1.0)
        yield turn * x0
        yield np.where(np.isin(states, velocities), -1.0, 1.0) * x0
        yield reached
        yield turn * reached

    def _reached(self) -> np.ndarray:
        """Return where the windows before lead; where there is none, what was fitted."""
        fit, windows = self.fit, self.windows
        starts, ends, reached = windows.starts, windows.starts + windows.lengths, fit.x0.copy()
        own = ~np.isin(list(fit.model.states), led_states(fit.model, windows))
        for w in self.which:
            if starts[w] != windows.bounds[windows.record[w]] and ends[w - 1] == starts[w]:
                begun = fit.evaluation.x0[w - 1]
                before = free_run(fit.model, windows, starts[w - 1], starts[w] + 1, begun)
                reached[w, own] = before.x[-1, own]
        return reached[self.which]
