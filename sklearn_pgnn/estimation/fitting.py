"""Fit hypotheses in stages: from the best start, on some of the samples, on all windows."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from sklearn_pgnn.estimation.budgets import COARSER, STEPS, TOLERANCE
from sklearn_pgnn.estimation.fits_ahead import FitsAhead
from sklearn_pgnn.estimation.fitted_hypothesis import (
    FittedHypothesis,
    Start,
    SubsampleFit,
    carry_over,
    is_clearly_less,
    objective_of,
)
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.estimation.problem import (
    EstimationProblem,
    Subsample,
    on_one_thread,
    subsample_windows,
)
from sklearn_pgnn.estimation.progress import Progress
from sklearn_pgnn.estimation.residuals import HeldOut
from sklearn_pgnn.estimation.spectral_lines import ripples_left, tones_left
from sklearn_pgnn.estimation.starts import best_start
from sklearn_pgnn.estimation.stretches import is_long
from sklearn_pgnn.estimation.window_fitter import WindowFitter
from sklearn_pgnn.physics.effect import Effect, Scales
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.simulation.window_fit import WindowFit, lost_fit
from sklearn_pgnn.simulation.windows import ShootingWindows


class HypothesisFitter(WindowFitter):
    """Fits hypotheses, each once, and cheaply before it is fitted on all windows."""

    def __init__(self, problem: EstimationProblem, progress: Progress | None = None):
        super().__init__(problem, progress)
        self._subsamples: dict[Key, SubsampleFit] = {}
        self._begun: dict[Key, float] = {}
        #: long records keep the threads of this process busy by themselves
        self._ahead = FitsAhead(1 if is_long(problem) else problem.n_processes)

    def on_one_thread(self) -> "HypothesisFitter":
        """Return a fitter for another process, which has fitted nothing yet."""
        alone = HypothesisFitter(on_one_thread(self.problem))
        windows = replace(self.rough.windows, threads=1)
        alone.rough, alone.scales = replace(self.rough, windows=windows), self.scales
        return alone

    @cached_property
    def rough(self) -> Subsample:
        """The samples of first fits."""
        return subsample_windows(self.problem, self.base().fit.evaluation.residual)

    @cached_property
    def scales(self) -> Scales:
        """The problem's scales, with the spectral lines in the re-tuned prior's residuals."""
        scales, windows, fit = self.problem.scales, self.problem.windows, self.base().fit
        left = tones_left(windows, fit.evaluation.residual)
        x = self.problem.states.estimate(fit.model).x
        ripples = ripples_left(windows, fit, x, self.rough.which)
        return replace(
            scales,
            tones={state: _joined(known, left) for state, known in scales.tones.items()},
            ripples={
                state: _joined(known, ripples.get(state, ()))
                for state, known in scales.ripples.items()
            },
        )

    # -- on all windows ------------------------------------------------------------------------

    def fit_all(self, subsample: SubsampleFit, base: FittedHypothesis) -> FittedHypothesis:
        """Fit a hypothesis on all windows, again if its fit on the subsample has improved."""
        hypothesis = subsample.hypothesis
        if not self._is_due(subsample):
            return self._known(hypothesis)
        key, task = self.key(hypothesis), HypothesisFitter.fit_and_validate
        made = self._ahead.take(task, key, subsample, base)
        if made is None:
            trial = self._from_subsample(subsample, base)
        else:
            fit, held_out = made.result
            trial = FittedHypothesis(hypothesis, fit)
            self.failures.absorb(made.failures, key)
            self._validated[key] = fit, held_out, made.failures
        self._begun[key] = subsample.fit.objective
        self._keep(trial)
        return self.refit_from_held_out(self._known(hypothesis))

    def _is_due(self, subsample: SubsampleFit) -> bool:
        """Return whether a hypothesis was not fitted on all windows, or from worse values."""
        key = self.key(subsample.hypothesis)
        better = is_clearly_less(subsample.fit.objective, self._begun.get(key, np.inf))
        return key not in self._trials or better

    def _from_subsample(self, subsample: SubsampleFit, base: FittedHypothesis) -> FittedHypothesis:
        known = self.rough.which, subsample.fit.x0
        return self._fit(subsample.hypothesis, subsample.fit.model, base.fit, known)

    def fit_and_validate(
        self, subsample: SubsampleFit, base: FittedHypothesis
    ) -> tuple[WindowFit, HeldOut]:
        """Return a fit on all windows, and its residuals on those that are held out."""
        trial = self._from_subsample(subsample, base)
        return trial.fit, self._cross_validate(trial.hypothesis, trial.fit)

    def prepare_fits(self, subsamples: Iterable[SubsampleFit], base: FittedHypothesis) -> None:
        """Let other processes fit hypotheses on all windows for `fit_all`, if this saves time."""
        due = filter(self._is_due, subsamples)
        asked = {self.key(each.hypothesis): (each, base) for each in due}
        self._ahead.make(self, HypothesisFitter.fit_and_validate, asked)

    def refit_from(self, trial: FittedHypothesis, better: FittedHypothesis) -> FittedHypothesis:
        """Fit a hypothesis again from the values of a finer one: its own fit may be stuck."""
        self.subsample(trial)
        return self.fit_all(self._derive(self.subsample(better), trial.hypothesis), better)

    # -- on some of the samples ----------------------------------------------------------------

    def subsample(self, trial: FittedHypothesis) -> SubsampleFit:
        """Fit a hypothesis on some of the samples that was fitted on all windows."""
        key = self.key(trial.hypothesis)
        known = self._subsamples.get(key)
        if known is None or known.origin is not trial.fit:
            x0, start = trial.fit.x0[self.rough.which], self._rough_start(trial.fit.model)
            again = self._to_end(trial.hypothesis, trial.fit.model, x0, start)
            if known is not None and known.fit.objective < again.fit.objective:
                again = known
            self._subsamples[key] = replace(again, origin=trial.fit)
            self._begun.setdefault(key, again.fit.objective)
        return self._subsamples[key]

    def first_fit(self, subsample: SubsampleFit, cause: Effect) -> SubsampleFit:
        """Fit one more cause for some steps, from the best of its starts and positions."""
        orders = self.models.orders(subsample.hypothesis, cause)
        if not orders:
            return self._lost(subsample.hypothesis.plus(cause), subsample)
        fits = [self._first_fit(subsample, order, cause) for order in orders]
        return min(fits, key=objective_of)

    def known_squares(self, subsample: SubsampleFit, cause: Effect) -> float:
        """Return the error of a hypothesis with one more cause; infinite if it was not fitted."""
        orders = self.models.orders(subsample.hypothesis, cause)
        known = (self._subsamples.get(self.key(order)) for order in orders)
        return min((each.squares for each in known if each is not None), default=np.inf)

    def _first_fit(
        self, subsample: SubsampleFit, hypothesis: Hypothesis, cause: Effect
    ) -> SubsampleFit:
        key = self.key(hypothesis)
        if key not in self._subsamples:
            made = self._ahead.take(HypothesisFitter.fit_from_starts, key, subsample)
            if made is None:
                found = self.fit_from_starts(subsample, hypothesis, cause)
            else:
                found = made.result
                self.failures.absorb(made.failures, key)
            self._subsamples[key] = found
        return replace(self._subsamples[key], hypothesis=hypothesis)

    def prepare_first_fits(self, pairs: Iterable[tuple[SubsampleFit, Effect]]) -> None:
        """Let other processes compute the fits that `first_fit` will return, if this saves time."""
        if self._ahead.n_processes == 1:
            return
        asked = {}
        for subsample, cause in pairs:
            for hypothesis in self.models.orders(subsample.hypothesis, cause):
                asked[self.key(hypothesis)] = subsample, hypothesis, cause
        asked = {key: fit for key, fit in asked.items() if key not in self._subsamples}
        if asked:
            self.scales  # noqa: B018  computed here, so that no single fit takes the time for it
        self._ahead.make(self, HypothesisFitter.fit_from_starts, asked)

    def _lost(self, hypothesis: Hypothesis, base: SubsampleFit) -> SubsampleFit:
        """Return the placeholder for a hypothesis that cannot be fitted."""
        known = base.fit
        lost = lost_fit(known.model, self.rough.windows, known.freedoms, known.x0)
        return SubsampleFit(hypothesis, lost, base.start)

    def restart(self, subsample: SubsampleFit, cause: Effect) -> SubsampleFit:
        """Fit a hypothesis again, one of its causes from its starts, with the others present.

        An earlier fit of this cause may also have compensated for causes that were added later.
        """
        without, fits = self.reduce(subsample, cause), [subsample]
        for hypothesis in self.models.orders(without.hypothesis, cause):
            key = self.key(hypothesis)
            known = self._subsamples.pop(key, None)
            fits.append(self.converge(self._first_fit(without, hypothesis, cause)))
            if known is not None and not fits[-1].fit.objective < known.fit.objective:
                self._subsamples[key] = known
        return min(fits, key=objective_of)

    def fit_from_starts(
        self, subsample: SubsampleFit, hypothesis: Hypothesis, cause: Effect
    ) -> SubsampleFit:
        """Fit one more cause for some steps, from the best of its starts."""
        with self._tolerate(hypothesis):
            model = best_start(self, subsample, hypothesis, cause)
            found = self._from(subsample, hypothesis, model, max_steps=STEPS)
            if found.start is subsample.start:
                return found
            # its own states depend on its parameters
            return replace(found, start=self._rough_start(found.fit.model))
        return self._lost(hypothesis, subsample)

    def converge(self, subsample: SubsampleFit, prune_above: float = np.inf) -> SubsampleFit:
        """Continue a hypothesis's fit to its minimum, or until it cannot fall below a limit."""
        known = subsample.converged or prune_above <= subsample.stays_above
        if known or not subsample.fit.usable:
            return subsample
        found = self._to_end(
            subsample.hypothesis,
            subsample.fit.model,
            subsample.fit.x0,
            subsample.start,
            evaluation=subsample.fit.evaluation,
            prune_above=prune_above,
        )
        if not (found.converged or found.fit.objective < subsample.fit.objective):
            found = replace(found, stays_above=prune_above)
        self._subsamples[self.key(subsample.hypothesis)] = found
        return found

    # -- hypotheses from others ----------------------------------------------------------------

    def reduce(self, subsample: SubsampleFit, cause: Effect) -> SubsampleFit:
        """Fit a hypothesis without one of its causes."""
        return self._derive(subsample, subsample.hypothesis.without(cause))

    def split(self, subsample: SubsampleFit, cause: Effect, part: Effect) -> SubsampleFit:
        """Fit a hypothesis in which a part of a cause is a separate cause."""
        hypothesis = subsample.hypothesis.before(cause, part)
        zero = {cause.names()[name]: 0.0 for name in hypothesis.taken_over(cause)}
        return self._derive(subsample, hypothesis, **zero)

    def exchange(
        self, subsample: SubsampleFit, cause: Effect, others: list[Effect]
    ) -> SubsampleFit:
        """Fit a hypothesis with some causes in place of one."""
        hypothesis = subsample.hypothesis.without(cause)
        for place, other in enumerate(others, subsample.hypothesis.order.index(cause)):
            hypothesis = hypothesis.plus(other, place)
        return self._derive(subsample, hypothesis)

    def _derive(
        self, subsample: SubsampleFit, hypothesis: Hypothesis, **values: float
    ) -> SubsampleFit:
        """Fit a hypothesis from the values of another; keep the known fit if that is better."""
        if not self.models.is_possible(hypothesis):
            return self._lost(hypothesis, subsample)
        model = self.models.extend(hypothesis, subsample.fit.model).with_parameters(**values)
        found, key = self._from(subsample, hypothesis, model), self.key(hypothesis)
        known = self._subsamples.get(key)
        if known is None or found.fit.objective < known.fit.objective:
            self._subsamples[key] = found
        return self.converge(replace(self._subsamples[key], hypothesis=hypothesis))

    def _from(
        self, base: SubsampleFit, hypothesis: Hypothesis, model: PhysicsModel, **options: Any
    ) -> SubsampleFit:
        """Fit a model, its initial states starting from those of another hypothesis."""
        start = self.start_from(model, base)
        x0 = carry_over(base.fit, base.start.x0, model, start.x0)
        return self._to_end(hypothesis, model, x0, start, **options)

    def _to_end(
        self,
        hypothesis: Hypothesis,
        model: PhysicsModel,
        x0: np.ndarray,
        start: Start,
        *,
        prune_above: float = np.inf,
        **options: Any,
    ) -> SubsampleFit:
        model, free = self.models.free(hypothesis, model)
        windows, tolerance = self.windows_of(model), COARSER * TOLERANCE
        fit = self.fit_model(
            self._tolerate(hypothesis),
            model,
            windows,
            free,
            start,
            x0,
            tolerance=tolerance,
            prune_above=prune_above,
            **options,
        )
        is_whole = "max_steps" not in options
        if is_whole or unsigned_states(model):
            fit = self._refit_poor(hypothesis, fit, windows, start, tolerance)
        converged = is_whole and fit.objective <= prune_above
        return SubsampleFit(hypothesis, self._noted(hypothesis, fit), start, converged)

    def start_from(self, model: PhysicsModel, base: SubsampleFit) -> Start:
        """Return the expected initial states of a model; another one's for equal outputs."""
        other = base.fit.model
        same = tuple(model.states) == tuple(other.states)
        same = same and model.outputs == other.outputs
        return base.start if same else self._rough_start(model)

    def _rough_start(self, model: PhysicsModel) -> Start:
        return self._start(model).select(self.rough.which)

    def windows_of(self, model: PhysicsModel) -> ShootingWindows:
        """Return the windows of a subsample; in finer steps for a model with states of its own."""
        own = len(model.states) > len(self.problem.prior.states)
        return self.rough.stepped if own else self.rough.windows


def _joined(some: tuple[float, ...], others: tuple[float, ...]) -> tuple[float, ...]:
    """Return the values of two tuples, each once."""
    return tuple(dict.fromkeys((*some, *others)))
