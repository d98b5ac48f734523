"""Fit hypotheses on all windows, and on held-out ones; the results are cached."""

from contextlib import AbstractContextManager
from functools import cached_property
from typing import Any

import numpy as np

from sklearn_pgnn.estimation.budgets import (
    MUCH,
    POLISH_STEPS,
    ROUNDING,
    SMALL_CHANGE,
    STEPS,
    TOLERANCE,
)
from sklearn_pgnn.estimation.criterion import HeldOut, log_likelihood_ratio
from sklearn_pgnn.estimation.disturbed import DisturbedEvidence, Judged
from sklearn_pgnn.estimation.fitted_hypothesis import (
    FittedHypothesis,
    Start,
    carry_over,
    is_clearly_less,
)
from sklearn_pgnn.estimation.fold_fits import FoldFits
from sklearn_pgnn.estimation.held_out import CrossValidation, make_folds
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.hypothesis_models import HypothesisModels, Key
from sklearn_pgnn.estimation.poor_windows import refit_poor_windows
from sklearn_pgnn.estimation.problem import EstimationProblem, in_usual_windows
from sklearn_pgnn.estimation.progress import Progress
from sklearn_pgnn.estimation.squares_left import squares_by_output, white_squares
from sklearn_pgnn.estimation.unusable import FailureLog, Unusable, note_fit, tolerate_failures
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, fit_windows, lost_fit
from sklearn_pgnn.simulation.windows import ShootingWindows

#: name of the fits for cross-validation in reports of failures
HELD_OUT = "held out"
#: and of fits with a parameter held away from its estimate
AWAY = "away from the estimate"
#: and of fits in windows of the usual length
USUAL = "in windows of the usual length"


class WindowFitter:
    """Fits hypotheses on all windows of a problem; one that fails gets `lost_fit` alone."""

    def __init__(self, problem: EstimationProblem, progress: Progress | None = None):
        self.problem = problem
        self.progress = Progress() if progress is None else progress
        self.models, self.failures = HypothesisModels(problem), FailureLog()
        self._trials: dict[Key, FittedHypothesis] = {}
        self._held_out: dict[Key, tuple[WindowFit, HeldOut]] = {}
        self._validated: dict[Key, tuple[WindowFit, HeldOut, FailureLog]] = {}  # not yet asked for

    def key(self, hypothesis: Hypothesis) -> Key:
        """Return the identity of a hypothesis, see `HypothesisModels.key`."""
        return self.models.key(hypothesis)

    def held(self, cause: Effect) -> tuple[str, ...]:
        """Return the names of the prior's parameters that a cause covers."""
        return self.models.held(cause)

    # -- numerical failures --------------------------------------------------------------------

    @property
    def unusable(self) -> tuple[Unusable, ...]:
        """The candidates that could not be fitted, each with the reason."""
        return self.failures.entries()

    def fit_model(
        self,
        tolerate: AbstractContextManager,
        model: PhysicsModel,
        windows: ShootingWindows,
        free: tuple[ParameterPrior, ...],
        start: Start,
        x0: np.ndarray,
        **options: Any,
    ) -> WindowFit:
        """Fit a model; after a numerical failure return the placeholder for an unusable fit."""
        with tolerate:
            return fit_windows(
                model,
                windows,
                free,
                *start,
                x0_start=x0,
                each_step=self.progress.tick,
                **options,
            )
        return lost_fit(model, windows, free, x0)

    def _refit_poor(
        self,
        hypothesis: Hypothesis,
        fit: WindowFit,
        windows: ShootingWindows,
        start: Start,
        tolerance: float,
    ) -> WindowFit:
        """Return the better of a fit and one from other starts in windows that may be stuck."""
        with self._tolerate(hypothesis):
            fit = refit_poor_windows(fit, windows, *start, tolerance, self.progress.tick)
        return fit

    def _tolerate(self, hypothesis: Hypothesis, *what: str) -> AbstractContextManager:
        """Continue after numerical failures, and record the unusable hypothesis."""
        return tolerate_failures(self.failures, self.key(hypothesis), hypothesis, *what)

    def _noted(self, hypothesis: Hypothesis, fit: WindowFit) -> WindowFit:
        """Record whether a hypothesis could be fitted."""
        return note_fit(self.failures, self.key(hypothesis), hypothesis, fit)

    # -- on all windows ------------------------------------------------------------------------

    @cached_property
    def prior(self) -> WindowFit:
        """The prior at its parameters, only the initial states being fitted."""
        model = self.problem.prior
        start = self._start(model)
        tolerate, windows = self._tolerate(Hypothesis()), self.problem.windows
        return self.fit_model(tolerate, model, windows, (), start, start.x0, max_steps=2 * STEPS)

    def base(self) -> FittedHypothesis:
        """Return the prior, re-tuned within its spread."""
        key = self.key(Hypothesis())
        if key not in self._trials:
            self._keep(self._fit(Hypothesis(), self.problem.prior))
        return self._trials[key]

    def refit(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Fit a hypothesis that was fitted on the same windows of another problem."""
        self._keep(self._fit(trial.hypothesis, trial.fit.model, trial.fit))
        return self._known(trial.hypothesis)

    def refit_elsewhere(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Fit a hypothesis that was fitted on other records, until all parameters converge."""
        tolerance = SMALL_CHANGE**2 / self.problem.n_samples
        self._keep(self._fit(trial.hypothesis, trial.fit.model, tolerance=tolerance))
        return self._known(trial.hypothesis)

    def refit_two_steps(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Return the result of two steps from a hypothesis at the minimum of another problem."""
        fit = trial.fit
        moved = self.fit_model(
            self._tolerate(trial.hypothesis),
            fit.model,
            self.problem.windows,
            fit.freedoms,
            self._start(fit.model),
            fit.x0,
            min_steps=2,
            max_steps=2,
        )
        return FittedHypothesis(trial.hypothesis, moved)

    def polish(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Continue a fit to its minimum, also along directions that records hardly determine."""
        for x0 in (trial.fit.x0, self._start(trial.fit.model).x0):
            self._keep(self.polished(trial, trial.fit.model, trial.fit.freedoms, x0))
        return self._known(trial.hypothesis)

    def polished(
        self,
        trial: FittedHypothesis,
        model: PhysicsModel,
        free: tuple[ParameterPrior, ...],
        x0: np.ndarray,
    ) -> FittedHypothesis:
        """Return a hypothesis fitted to its minimum from a model, with some free parameters."""
        fit = self.fit_model(
            self._tolerate(trial.hypothesis),
            model,
            self.problem.windows,
            free,
            self._start(model),
            x0,
            min_steps=STEPS,
            max_steps=POLISH_STEPS,
            tolerance=ROUNDING,
        )
        return FittedHypothesis(trial.hypothesis, fit)

    def is_known(self, hypothesis: Hypothesis) -> bool:
        """Return whether a hypothesis was fitted on all windows."""
        return self.key(hypothesis) in self._trials

    def rise(self, trial: FittedHypothesis, name: str, value: float, small: float) -> float:
        """Return the rise of the objective with one parameter held and the others fitted."""
        fit = trial.fit
        (own,) = (freedom for freedom in fit.freedoms if freedom.name == name)
        held = self.objective_with(
            trial,
            fit.model.with_parameters(**{name: value}),
            self.problem.windows,
            tuple(freedom for freedom in fit.freedoms if freedom is not own),
            tolerance=small / fit.objective if fit.objective > 0 else TOLERANCE,
        )
        return held + ((value - own.centre) / own.spread) ** 2 - fit.objective

    def objective_with(
        self,
        trial: FittedHypothesis,
        model: PhysicsModel,
        windows: ShootingWindows,
        free: tuple[ParameterPrior, ...],
        **more: Any,
    ) -> float:
        """Return the objective of a fit with other values, windows or freedoms, fitted again."""
        start, tolerate = self._start(model), self._tolerate(trial.hypothesis, AWAY)
        again = self.fit_model(
            tolerate, model, windows, free, start, trial.fit.x0, max_steps=STEPS, **more
        )
        return again.objective

    def _keep(self, trial: FittedHypothesis) -> None:
        """Store a trial unless a better one of the same hypothesis is known."""
        key = self.key(trial.hypothesis)
        if key not in self._trials or trial.fit.objective < self._trials[key].fit.objective:
            self._trials[key] = trial

    def _known(self, hypothesis: Hypothesis) -> FittedHypothesis:
        """Return the best fit of a hypothesis, with its causes in the requested order."""
        return FittedHypothesis(hypothesis, self._trials[self.key(hypothesis)].fit)

    def _fit(
        self,
        hypothesis: Hypothesis,
        model: PhysicsModel,
        base: WindowFit | None = None,
        known: tuple[np.ndarray, np.ndarray] | None = None,
        tolerance: float = TOLERANCE,
    ) -> FittedHypothesis:
        """Fit a model, with initial states from another fit, or known ones in some windows.

        If some are known, the first step changes the initial states only.
        """
        model, free = self.models.free(hypothesis, model)
        start, windows = self._start(model), self.problem.windows
        x0 = start.x0.copy()
        if base is not None:
            shows_the_same = base.model.outputs == model.outputs  # no distance is kept then
            before = start if shows_the_same else self._start(base.model)
            x0 = carry_over(base, before.x0, model, start.x0)
        if known is not None:
            which, there = known
            x0[which] = there
        fit = self.fit_model(
            self._tolerate(hypothesis),
            model,
            windows,
            free,
            start,
            x0,
            states_first=known is not None,
            tolerance=tolerance,
        )
        fit = self._refit_poor(hypothesis, fit, windows, start, tolerance)
        return FittedHypothesis(hypothesis, self._noted(hypothesis, fit))

    def _start(self, model: PhysicsModel) -> Start:
        """Return the expected initial states of all windows."""
        return Start(*self.problem.states.expected_starts(model, self.problem.windows))

    # -- held out ------------------------------------------------------------------------------

    @cached_property
    def folds(self) -> np.ndarray:
        """Fold of every window, of shape (n_windows,)."""
        return make_folds(self.problem)

    def held_out(self, trial: FittedHypothesis) -> HeldOut:
        """Return the residuals of a hypothesis on records its parameters were not fitted to.

        Among several fits of a hypothesis the one with the smallest error counts: another may have
        been stuck with some records held out.
        """
        key = self.key(trial.hypothesis)
        fit, known = self._held_out.get(key, (None, None))
        if known is None or fit is not trial.fit:
            found = self._validate(trial)
            if known is None or log_likelihood_ratio(known.windows, found.windows) > 0.0:
                known = found
            self._held_out[key] = trial.fit, known
        return known

    def _validate(self, trial: FittedHypothesis) -> HeldOut:
        """Return the held-out residuals of a fit, cached or computed now."""
        key = self.key(trial.hypothesis)
        known = self._validated.pop(key, None)
        if known is None or known[0] is not trial.fit:
            return self._cross_validate(trial.hypothesis, trial.fit)
        _, held_out, failures = known
        self.failures.absorb(failures, key, HELD_OUT)
        return held_out

    def evidence_disturbed(
        self, without: FittedHypothesis, with_: FittedHypothesis, smallest_share: float
    ) -> float:
        """Return the evidence for the second of two hypotheses, each with a disturbance."""
        less, more = (
            Judged(self.key(trial.hypothesis), trial, self.held_out(trial))
            for trial in (without, with_)
        )
        return self._disturbed.evidence(less, more, smallest_share, self.progress.tick)

    @cached_property
    def _disturbed(self) -> DisturbedEvidence:
        return DisturbedEvidence(self.problem, self.folds)

    def refit_from_held_out(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Return a better fit of a hypothesis if its held-out fits show that it is stuck.

        Parameters fitted to other windows cannot have a smaller error than those fitted to all of
        them, unless the latter are not at the minimum.
        """
        found, left = self.held_out(trial), self.squares_by_output(trial).sum()
        if found.x0 is None or not is_clearly_less(found.windows.squares.sum(), left):
            return trial
        known = np.arange(len(found.x0)), found.x0
        for model in found.learned:
            self._keep(self._fit(trial.hypothesis, model, known=known))
        return self._known(trial.hypothesis)

    def squares_by_output(self, trial: FittedHypothesis) -> np.ndarray:
        """Return the squared residuals of a hypothesis by output, in units of the noise."""
        return squares_by_output(self.problem, trial.fit)

    def runs_away(self, trial: FittedHypothesis) -> bool:
        """Return whether a hypothesis tells nothing, where the re-tuned prior runs away.

        A prior runs away that predicts no output better over windows than its mean does, in windows
        of fewer samples than usual no better than is possible without a model. What predicts none
        better than that only ends it.
        """
        of_prior = self.held_out(self.base()).windows.squares
        is_lost = not (of_prior < self.problem.squares_of_no_use).any()
        return is_lost and self._tells_nothing(trial)

    def predicts_nothing(self, trial: FittedHypothesis, smallest_share: float) -> bool:
        """Return whether a hypothesis tells no more of any output than carrying on does.

        It does so over the windows of the fit, over windows of the usual length, where it leaves
        more than twice the noise, and in free run, which tells no more than the outputs' mean.
        """
        if self.held_out(trial).tells.any() or not self._tells_nothing(trial, smallest_share):
            return False
        if (usual := in_usual_windows(self.problem)) is None:
            return not _leaves_little(self.problem, trial.fit)
        model = trial.fit.model
        start = Start(*usual.states.expected_starts(model, usual.windows))
        tolerate = self._tolerate(trial.hypothesis, USUAL)
        fit = self.fit_model(tolerate, model, usual.windows, (), start, start.x0)
        if not fit.usable:
            return True
        least = (1.0 - smallest_share) * usual.squares_without_model
        return not (_leaves_little(usual, fit) or (squares_by_output(usual, fit) < least).any())

    def _tells_nothing(self, trial: FittedHypothesis, smallest_share: float = 0.0) -> bool:
        """Return whether no output is told better over windows than is possible without a model."""
        least = (1.0 - smallest_share) * self.problem.squares_without_model
        return not bool((self.held_out(trial).windows.squares < least).any())

    def white_squares(self, trial: FittedHypothesis) -> np.ndarray:
        """Return the white part of the squared residuals of a hypothesis, by output."""
        return white_squares(self.problem, trial.fit)

    def _cross_validate(self, hypothesis: Hypothesis, fit: WindowFit) -> HeldOut:
        """Return the residuals of a fit on windows that its parameters were not fitted to."""

        def fit_some(*arguments: Any, **options: Any) -> WindowFit:
            return self.fit_model(self._tolerate(hypothesis, HELD_OUT), *arguments, **options)

        start = self._start(fit.model)
        some = FoldFits(self.problem, fit, start, fit_some)
        return CrossValidation(self.problem, *start).run(fit, self.folds, some.learn, some.judge)


def _leaves_little(problem: EstimationProblem, fit: WindowFit) -> bool:
    """Return whether a fit leaves no more than about twice the noise of any output."""
    left, white = squares_by_output(problem, fit), white_squares(problem, fit)
    return bool((left <= MUCH**2 * white).all())
