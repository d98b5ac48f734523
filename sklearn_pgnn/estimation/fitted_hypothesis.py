"""Hypotheses fitted on all windows or on some of the samples."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.budgets import COARSER, TOLERANCE
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.simulation.window_fit import WindowFit


class Start(NamedTuple):
    """Expected initial states (n_windows, n_states), and their standard deviation (n_states,)."""

    x0: np.ndarray
    spread: np.ndarray

    def select(self, which: np.ndarray) -> "Start":
        """Return the expected initial states of some of the windows."""
        return Start(self.x0[which], self.spread)


@dataclass(frozen=True)
class FittedHypothesis:
    """A hypothesis fitted on windows."""

    hypothesis: Hypothesis
    fit: WindowFit

    @property
    def squares(self) -> float:
        """Sum of squared residuals in units of the noise; infinite if it cannot be fitted."""
        return self.fit.squares if self.fit.usable else np.inf

    @property
    def times_noise(self) -> float:
        """Root mean square residual in units of the noise; infinite if it cannot be fitted."""
        return self.fit.times_noise


@dataclass(frozen=True)
class SubsampleFit(FittedHypothesis):
    """A hypothesis fitted on some samples, its fit on all, and what no fit fell below."""

    start: Start
    converged: bool = False
    origin: WindowFit | None = None
    stays_above: float = -np.inf


def is_clearly_less(objective: float, other: float) -> bool:
    """Return whether a fit's error is less than another one's by more than its tolerance.

    >>> is_clearly_less(90.0, 100.0), is_clearly_less(99.99, 100.0)
    (True, False)
    """
    return objective < (1 - COARSER * TOLERANCE) * other


def objective_of(trial: FittedHypothesis) -> float:
    """Return the minimised objective of a fit, to sort by."""
    return trial.fit.objective


def carry_over(
    fit: WindowFit, before: np.ndarray, model: PhysicsModel, expected: np.ndarray
) -> np.ndarray:
    """Return initial states of another model: fitted ones where it has the same state.

    Where an output shows another quantity, the deviation from the expected value is kept.
    """
    start, names = expected.copy(), list(fit.model.states)
    turned = set(unsigned_states(model)) ^ set(unsigned_states(fit.model))
    otherwise = _shown_otherwise(fit.model, model)
    for i, state in enumerate(model.states):
        if state in names and state not in turned:
            place = names.index(state)
            start[:, i] = fit.x0[:, place]
            if state in otherwise:
                start[:, i] += expected[:, i] - before[:, place]
    return start


def _shown_otherwise(one: PhysicsModel, other: PhysicsModel) -> set[str]:
    """Return the states that two models measure by different outputs, with their velocities."""
    changed = [name for name in one.outputs if one.outputs[name] != other.outputs[name]]
    shown = [model.outputs[name].free_symbols for model in (one, other) for name in changed]
    states = set(map(str, set().union(*shown)))
    return states | {v for v, position in one.slope_pairs.items() if position in states}
