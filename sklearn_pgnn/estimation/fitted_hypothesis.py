"""Fitted hypotheses, on all windows and on some of the samples."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.simulation.window_fit import WindowFit


class Start(NamedTuple):
    """Expected initial states of windows, and how uncertain they are.

    Parameters
    ----------
    x0 : ndarray of shape (n_windows, n_states)
        Expected initial states.
    spread : ndarray of shape (n_states,)
        How far each may be off.
    """

    x0: np.ndarray
    spread: np.ndarray

    def select(self, which) -> "Start":
        """Return what is known of some of the windows."""
        return Start(self.x0[which], self.spread)


@dataclass(frozen=True)
class FittedHypothesis:
    """A hypothesis fitted on windows.

    Parameters
    ----------
    hypothesis : Hypothesis
        What is said to be missing.
    fit : WindowFit
        The extended model and its residuals.
    """

    hypothesis: Hypothesis
    fit: WindowFit

    @property
    def squares(self) -> float:
        """Sum of squared residuals in units of the noise; infinite if it cannot be fitted."""
        return self.fit.squares if self.fit.usable else np.inf

    @property
    def blocks(self) -> np.ndarray:
        """Sum of squared residuals of every block of every window."""
        return self.fit.evaluation.block_squares


@dataclass(frozen=True)
class SubsampleFit(FittedHypothesis):
    """A hypothesis fitted on some of the samples, see `rough_windows`.

    Parameters
    ----------
    start : Start
        What is known of the initial states.
    converged : bool, default=False
        Whether the fit has come to its end.
    origin : WindowFit, optional
        The fit on all windows whose hypothesis it is.
    """

    start: Start
    converged: bool = False
    origin: WindowFit | None = None


def objective_of(trial: FittedHypothesis) -> float:
    """Return what a fit has minimised, to sort by."""
    return trial.fit.objective


def carry_over(fit: WindowFit, model: PhysicsModel, expected: np.ndarray) -> np.ndarray:
    """Return initial states of another model: fitted ones where it has the same state.

    Parameters
    ----------
    fit : WindowFit
        A fit.
    model : PhysicsModel
        The other model.
    expected : ndarray of shape (n_windows, n_states)
        Its expected initial states.

    Returns
    -------
    ndarray of shape (n_windows, n_states)
        Where its initial states may start.
    """
    start, names = expected.copy(), list(fit.model.states)
    turned = set(unsigned_states(model)) ^ set(unsigned_states(fit.model))
    for i, state in enumerate(model.states):
        if state in names and state not in turned:
            start[:, i] = fit.x0[:, names.index(state)]
    return start
