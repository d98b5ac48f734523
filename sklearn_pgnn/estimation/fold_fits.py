"""Fits of one hypothesis for cross-validation: the other folds teach, and a fold is judged."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from sklearn_pgnn.estimation.budgets import COARSER, ROUNDING, SMALL_CHANGE, TOLERANCE
from sklearn_pgnn.estimation.fitted_hypothesis import Start
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.normal_equations import normal_equations
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, prior_precision


def keep_taught(fold: np.ndarray, others: np.ndarray) -> np.ndarray | None:
    """Return the precision with which a fold's fit keeps the other folds' estimates.

    Directions of the parameters keep the others' estimates, except those on which the others have
    less than `SMALL_CHANGE` of the fold's information.
    """
    size = np.sqrt(np.maximum(np.diag(fold + others), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh((fold + others) / np.outer(size, size))
    values = np.maximum(values, ROUNDING)
    whitened = vectors / np.sqrt(values)
    shares, turns = np.linalg.eigh(whitened.T @ (fold / np.outer(size, size)) @ whitened)
    untold = shares > 1.0 / (1.0 + SMALL_CHANGE)
    if not untold.any():
        return None
    along = size[:, None] * (vectors * np.sqrt(values)) @ turns
    return along * np.where(untold, np.maximum(1.0 - shares, 0.0), 1.0 / ROUNDING) @ along.T


@dataclass(frozen=True)
class FoldFits:
    """Fits of a hypothesis on some of the windows, from its fit on all of them.

    `fit_model` takes a model, windows, free parameters, the expected initial states, their starting
    values, and options of `fit_windows`; it returns an unusable fit after a numerical failure.
    """

    problem: EstimationProblem
    fit: WindowFit
    start: Start
    fit_model: Callable[..., WindowFit]

    def learn(self, which: np.ndarray) -> WindowFit:
        """Fit the parameters to some windows, so that they forget the others.

        Where the others are needed to determine a direction of the parameters, it is fitted to
        them, see `keep_taught`.
        """
        fit, forgets = self.fit, SMALL_CHANGE / self.problem.n_samples
        options = {"evaluation": fit.evaluation.select(which), "min_steps": 1}
        taught = self._run(fit.model, which, fit.freedoms, fit.x0[which], forgets, **options)
        precision = self._precision(which)
        if not taught.usable or precision is None:
            return taught
        pairs = zip(fit.freedoms, taught.values, strict=True)
        free = tuple(replace(freedom, centre=float(value)) for freedom, value in pairs)
        options = {"precision": precision}
        there = self._run(taught.model, ~which, free, fit.x0[~which], forgets, **options)
        return replace(taught, model=there.model) if there.usable else taught

    def _precision(self, which: np.ndarray) -> np.ndarray | None:
        """Return the precision with which the other windows keep the parameters of some."""
        others = self._told[which].sum(axis=0) + prior_precision(self.fit.freedoms)
        return keep_taught(self._told[~which].sum(axis=0), others)

    @cached_property
    def _told(self) -> np.ndarray:
        """Information that every window gives of the parameters."""
        return normal_equations(self.fit, *self.start).hessian

    def judge(self, learned: WindowFit, which: np.ndarray) -> WindowFit:
        """Fit the initial states of some windows only, each from the better of two starts."""
        model = learned.model
        fits = [self._run(model, which, (), x0[which]) for x0 in (self.fit.x0, self.start.x0)]
        nearest = np.argmin([each.evaluation.squares for each in fits], axis=0)
        if (nearest == nearest[0]).all():
            return fits[nearest[0]]
        x0 = np.array([each.x0 for each in fits])[nearest, np.arange(nearest.size)]
        (one, other), moved = (each.evaluation for each in fits), np.flatnonzero(nearest)
        known = one.replaced(self.problem.windows.select(which), moved, other, moved)
        return self._run(model, which, (), x0, max_steps=0, evaluation=known)

    def _run(
        self,
        model: PhysicsModel,
        which: np.ndarray,
        free: tuple[ParameterPrior, ...],
        x0: np.ndarray,
        tolerance: float = COARSER * TOLERANCE,
        **options: Any,
    ) -> WindowFit:
        """Fit a model on some of the windows."""
        windows, start = self.problem.windows.select(which), self.start.select(which)
        return self.fit_model(model, windows, free, start, x0, tolerance=tolerance, **options)
