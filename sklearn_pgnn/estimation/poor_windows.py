"""Windows whose fit is stuck at initial states that no small step improves.

Where a sensor shows only the magnitude of a state, a trajectory through zero, or near it, can be
fitted with either sign. Where dry friction holds a state at rest, small changes of the initial
state leave it at rest. At the start of a record, the internal state of an actuator with play or a
limit is unknown, and a small change of it may change nothing.
"""

from collections.abc import Iterator

import numpy as np

from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.simulation.led_states import led_states
from sklearn_pgnn.simulation.state_estimate import free_run, unsigned_states
from sklearn_pgnn.simulation.window_fit import EachStep, WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import ShootingWindows


def refit_poor_windows(
    fit: WindowFit,
    windows: ShootingWindows,
    expected: np.ndarray,
    spread: np.ndarray,
    tolerance: float,
    each_step: EachStep = None,
) -> WindowFit:
    """Fit again with other initial states in the windows that may be stuck.

    Fits of models without dry friction and input-driven states, whose outputs show the sign of
    every state, are not changed.
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
    """Windows that may be stuck, and alternative initial states for them."""

    def __init__(self, fit: WindowFit, windows: ShootingWindows, expected: np.ndarray):
        self.fit, self.windows, self.expected = fit, windows, expected
        self.unsigned = unsigned_states(fit.model)
        self.led = np.isin(list(fit.model.states), led_states(fit.model, windows))
        self.which = self._poor()

    def _poor(self) -> np.ndarray:
        """Return windows worse than the median; much worse, if only dry friction may stick.

        With input-driven states, those at the start of a record.
        """
        squares = self.fit.evaluation.squares
        poor = squares > np.median(squares)
        if self.unsigned:
            return np.flatnonzero(poor)
        sticks = bool(dry_friction(self.fit.model).rows) & (squares > MUCH**2 * np.median(squares))
        return np.flatnonzero(sticks | (self._starts_a_record() & poor & self.led.any()))

    def _starts_a_record(self) -> np.ndarray:
        """Return whether a window is the first of its record."""
        return self.windows.starts == self.windows.bounds[self.windows.record]

    def __iter__(self) -> Iterator[np.ndarray]:
        """Start from expected states, and from the end of the previous window; with other signs.

        Input-driven states start a record at either end of their range, and between; from the end
        of the previous window they start as fitted, and as if they had forgotten their start.
        """
        reached = [self._reached()]
        if self.led.any():
            reached.append(np.where(self.led, self.expected[self.which], reached[0]))
        if not self.unsigned:
            yield self.expected[self.which]
            yield from reached
            if self.led.any():
                yield from self._led_elsewhere()
            return
        x0, states = self.fit.x0[self.which], list(self.fit.model.states)
        velocities = [state for state in self.unsigned if state in self.fit.model.slope_pairs]
        turn = np.where(np.isin(states, self.unsigned), -1.0, 1.0)
        yield turn * x0
        yield np.where(np.isin(states, velocities), -1.0, 1.0) * x0
        for place in reached:
            yield place
            yield turn * place

    def _led_elsewhere(self) -> Iterator[np.ndarray]:
        """Start with the input-driven states low, high, and in the middle."""
        low, high = (end(self.fit.evaluation.x0, axis=0) for end in (np.min, np.max))
        for place in (low, high, (low + high) / 2):
            yield np.where(self.led, place, self.expected[self.which])

    def _reached(self) -> np.ndarray:
        """Return the end states of the previous windows; where there is none, the fitted states."""
        fit, windows = self.fit, self.windows
        starts, ends, reached = windows.starts, windows.starts + windows.lengths, fit.x0.copy()
        first = self._starts_a_record()
        for w in self.which:
            if not first[w] and ends[w - 1] == starts[w]:
                begun = fit.evaluation.x0[w - 1]
                before = free_run(fit.model, windows, starts[w - 1], starts[w] + 1, begun)
                reached[w, ~self.led] = before.x[-1, ~self.led]
        return reached[self.which]
