"""Fitted hypotheses, on all windows and on some of the samples."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.budgets import COARSER, TOLERANCE
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
    def times_noise(self) -> float:
        """Root mean square residual in units of the noise; infinite if it cannot be fitted."""
        if not self.fit.usable:
            return np.inf
        evaluation = self.fit.evaluation
        return float(np.sqrt(evaluation.squares.sum() / np.isfinite(evaluation.residual).sum()))


@dataclass(frozen=True)
class SubsampleFit(FittedHypothesis):
    """A hypothesis fitted on some of the samples, see `subsample_windows`.

    Parameters
    ----------
    start : Start
        What is known of the initial states.
    converged : bool, default=False
        Whether the fit has come to its end.
    origin : WindowFit, optional
        The fit on all windows whose hypothesis it is.
    stays_above : float, default=-inf
        Limit below which no further fit of it came.
    """

    start: Start
    converged: bool = False
    origin: WindowFit | None = None
    stays_above: float = -np.inf


def is_clearly_less(objective: float, other: float) -> bool:
    """Return whether what a fit leaves is less than what another does by more than its tolerance.

    Examples
    --------
    >>> is_clearly_less(90.0, 100.0), is_clearly_less(99.99, 100.0)
    (True, False)
    """
    return objective < (1 - COARSER * TOLERANCE) * other


def objective_of(trial: FittedHypothesis) -> float:
    """Return what a fit has minimised, to sort by."""
    return trial.fit.objective


def carry_over(
    fit: WindowFit, before: np.ndarray, model: PhysicsModel, expected: np.ndarray
) -> np.ndarray:
    """Return initial states of another model: fitted ones where it has the same state.

    What an output shows otherwise keeps its distance from what is expected.

    Parameters
    ----------
    fit : WindowFit
        A fit.
    before : ndarray of shape (n_windows, n_states)
        Its expected initial states.
    model : PhysicsModel
        The other model.
    expected : ndarray of shape (n_windows, n_states)
        Those of the other model.

    Returns
    -------
    ndarray of shape (n_windows, n_states)
        Where its initial states may start.
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
    """Return the states that two models show in different outputs, with their velocities."""
    changed = [name for name in one.outputs if one.outputs[name] != other.outputs[name]]
    shown = [model.outputs[name].free_symbols for model in (one, other) for name in changed]
    states = set(map(str, set().union(*shown)))
    return states | {v for v, position in one.slope_pairs.items() if position in states}
