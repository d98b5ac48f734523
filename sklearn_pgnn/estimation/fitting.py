"""Fit hypotheses: sketched on some of the samples, fitted on all; remember what was fitted."""

import itertools
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.held_out import CrossValidation, make_folds
from sklearn_pgnn.estimation.hypothesis import (
    Hypothesis,
    commute,
    freedoms,
    held_parameters,
    without_spread,
)
from sklearn_pgnn.estimation.problem import (
    ROUGH_WINDOWS,
    EstimationProblem,
    Rough,
    rough_windows,
    worst_first,
)
from sklearn_pgnn.estimation.progress import Progress
from sklearn_pgnn.estimation.residuals import HeldOut
from sklearn_pgnn.estimation.sign_ambiguity import turn_poor_windows
from sklearn_pgnn.estimation.spectral_lines import tones_left
from sklearn_pgnn.estimation.unusable import BREAKDOWNS, Ledger, Unusable
from sklearn_pgnn.physics.effect import Effect, Scales
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.simulation.window_fit import (
    WindowFit,
    expected_decrease,
    fit_windows,
    lost_fit,
)
from sklearn_pgnn.simulation.windows import ShootingWindows

#: causes, and the pairs of them whose order matters
Key = tuple[frozenset, frozenset]
#: starts that are followed on a few windows for some steps, after a glance at all of them
FOLLOWED, FOLLOW_STEPS = 4, 5
#: steps before these in which what the starts differ in is held
HELD_STEPS = 2
#: the untuned prior is a ground to start from too, for effects of at most so many starts
FEW_STARTS = 4
#: a glance takes one in so many windows of a subsample, and ends at such a relative decrease
GLANCE, GLANCE_TOLERANCE = 4, 1e-2
#: steps of a first look
LOOK_STEPS = 3
#: relative decrease at which a subsample, and a fit from a known minimum, end; and a fit on all
SUBSAMPLE_TOLERANCE, TOLERANCE = 1e-3, 1e-4
#: least steps with which the accepted hypothesis is fitted on, and where that ends
POLISH_STEPS, POLISH_TOLERANCE = 3, 1e-9
#: steps for the initial states alone, which are nearly linear
PRIOR_STEPS = 8
#: what fits for cross-validation are called where they break down
HELD_OUT = "held out"


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


def objective_of(trial: FittedHypothesis) -> float:
    """Give what a fit has minimised, to sort by."""
    return trial.fit.objective


class Start(NamedTuple):
    """Expected initial states of windows, and how uncertain they are."""

    x0: np.ndarray
    spread: np.ndarray


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
        The fit on all windows that the subsample goes with.
    """

    start: Start
    converged: bool = False
    origin: WindowFit | None = None


class HypothesisFitter:
    """Fits hypotheses, each once.

    Where numbers break down the fit is `lost_fit`: that hypothesis cannot be used, and nothing
    else is touched.

    Parameters
    ----------
    problem : EstimationProblem
        the problem.
    progress : Progress, optional
        Told of every step of a fit.
    """

    def __init__(self, problem: EstimationProblem, progress: Progress | None = None):
        self.problem = problem
        self.progress = Progress() if progress is None else progress
        self.ledger = Ledger()
        self._trials: dict[Key, FittedHypothesis] = {}
        self._subsamples: dict[Key, SubsampleFit] = {}
        self._begun: dict[Key, float] = {}
        self._held_out: dict[Key, tuple[WindowFit, HeldOut]] = {}
        self._held_names: dict[Effect, tuple[str, ...]] = {}
        self._commuting: dict[frozenset, bool] = {}

    @cached_property
    def rough(self) -> Rough:
        """What sketches are made on."""
        return rough_windows(self.problem, self.base().fit.evaluation.squares)

    @cached_property
    def scales(self) -> Scales:
        """The problem's scales, with the tones that the re-tuned prior leaves in the outputs."""
        scales, residual = self.problem.scales, self.base().fit.evaluation.residual
        left = tones_left(self.problem.windows, residual)
        tones = {
            state: tuple(dict.fromkeys((*known, *left))) for state, known in scales.tones.items()
        }
        return replace(scales, tones=tones)

    # -- where numbers break down --------------------------------------------------------------

    @property
    def unusable(self) -> tuple[Unusable, ...]:
        """The suspects that could not be fitted, each with the reason."""
        return self.ledger.entries()

    def _fit_windows(
        self,
        spare: AbstractContextManager,
        model,
        windows: ShootingWindows,
        free,
        start: Start,
        x0,
        **options,
    ) -> WindowFit:
        """Fit a model; where numbers break down give what stands for one that cannot be fitted."""
        fit = lost_fit(model, windows, free, x0)
        with spare:
            fit = fit_windows(
                model,
                windows,
                free,
                *start,
                x0_start=x0,
                each_step=self.progress.tick,
                **options,
            )
        return fit

    def _turn(self, hypothesis, fit: WindowFit, windows: ShootingWindows, start: Start, tolerance):
        with self._spare(hypothesis):
            fit = turn_poor_windows(fit, windows, *start, tolerance, self.progress.tick)
        return fit

    def _spare(self, hypothesis: Hypothesis, *what: str) -> AbstractContextManager:
        """Go on where numbers break down, and note what hypothesis cannot be used."""
        return self.ledger.spare((self.key(hypothesis), *what), *_suspect(hypothesis))

    def _noted(self, hypothesis: Hypothesis, fit: WindowFit) -> WindowFit:
        """Note whether a hypothesis could be fitted."""
        key = (self.key(hypothesis),)
        if fit.usable:
            self.ledger.fitted(key)
        else:
            self.ledger.lost(key, *_suspect(hypothesis), reason=_why(fit))
        return fit

    # -- on all windows ------------------------------------------------------------------------

    @cached_property
    def prior(self) -> WindowFit:
        """Fit only the initial states, at the prior's parameters."""
        model = self.problem.prior
        start = self._start(model)
        return self._fit_windows(
            self._spare(Hypothesis()),
            model,
            self.problem.windows,
            (),
            start,
            start.x0,
            max_steps=PRIOR_STEPS,
        )

    def base(self) -> FittedHypothesis:
        """Re-tune the prior within its spread."""
        key = self.key(Hypothesis())
        if key not in self._trials:
            self._keep(self._fit(Hypothesis(), self.problem.prior, None))
        return self._trials[key]

    def base_error(self) -> float:
        """Give the re-tuned prior's error in units of the noise."""
        return float(np.sqrt(self.base().squares / self.problem.n_samples))

    def fit_all(self, subsample: SubsampleFit, beside: FittedHypothesis) -> FittedHypothesis:
        """Fit a hypothesis on all windows, again where its subsample has become better.

        Parameters
        ----------
        subsample : SubsampleFit
            The hypothesis, and where its parameters start.
        beside : FittedHypothesis
            Another hypothesis on all windows; the initial states start where its are.

        Returns
        -------
        FittedHypothesis
            The hypothesis.
        """
        key, objective = self.key(subsample.hypothesis), subsample.fit.objective
        better = objective < (1.0 - SUBSAMPLE_TOLERANCE) * self._begun.get(key, np.inf)
        if key not in self._trials or better:
            self._begun[key] = objective
            self._keep(self._fit(subsample.hypothesis, subsample.fit.model, beside, subsample))
        return FittedHypothesis(subsample.hypothesis, self._trials[key].fit)

    def retry(self, trial: FittedHypothesis, better: FittedHypothesis) -> FittedHypothesis:
        """Fit a hypothesis again from the numbers of a finer one: its own may have got stuck."""
        self.subsample(trial)
        return self.fit_all(self._derive(self.subsample(better), trial.hypothesis), better)

    def refit(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Fit a hypothesis that was fitted on another problem, from its numbers."""
        self._keep(self._fit(trial.hypothesis, trial.fit.model, trial))
        return FittedHypothesis(trial.hypothesis, self._trials[self.key(trial.hypothesis)].fit)

    def polish(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Fit a hypothesis on to its minimum, also along directions that records hardly see."""
        model, start = trial.fit.model, self._start(trial.fit.model)
        for x0 in (trial.fit.x0, start.x0):
            fit = self._fit_windows(
                self._spare(trial.hypothesis),
                model,
                self.problem.windows,
                trial.fit.freedoms,
                start,
                x0,
                min_steps=POLISH_STEPS,
                max_steps=100,
                tolerance=POLISH_TOLERANCE,
            )
            self._keep(FittedHypothesis(trial.hypothesis, fit))
        return FittedHypothesis(trial.hypothesis, self._trials[self.key(trial.hypothesis)].fit)

    def _keep(self, trial: FittedHypothesis) -> None:
        """Remember a trial unless a better one of the same hypothesis is known."""
        key = self.key(trial.hypothesis)
        if key not in self._trials or trial.fit.objective < self._trials[key].fit.objective:
            self._trials[key] = trial

    def _fit(self, hypothesis, model, beside, subsample=None) -> FittedHypothesis:
        model, free = self._free(hypothesis, model)
        start = self._start(model)
        x0 = start.x0 if beside is None else _carry_over(beside.fit, model, start.x0)
        if subsample is not None:
            x0[self.rough.which] = subsample.fit.x0
        fit = self._fit_windows(
            self._spare(hypothesis),
            model,
            self.problem.windows,
            free,
            start,
            x0,
            states_first=subsample is not None,
            tolerance=TOLERANCE,
        )
        fit = self._turn(hypothesis, fit, self.problem.windows, start, TOLERANCE)
        return FittedHypothesis(hypothesis, self._noted(hypothesis, fit))

    def _start(self, model) -> Start:
        estimate = self.problem.states.estimate(model)
        return Start(estimate.x[self.problem.windows.starts], estimate.spread)

    # -- on some of the samples ----------------------------------------------------------------

    def subsample(self, trial: FittedHypothesis) -> SubsampleFit:
        """SubsampleFit a hypothesis that was fitted on all windows."""
        key = self.key(trial.hypothesis)
        known = self._subsamples.get(key)
        if known is None or known.origin is not trial.fit:
            x0, start = trial.fit.x0[self.rough.which], self._rough_start(trial.fit.model)
            again = self._converge(trial.hypothesis, trial.fit.model, x0, start)
            if known is not None and known.fit.objective < again.fit.objective:
                again = known
            self._subsamples[key] = replace(again, origin=trial.fit)
            self._begun.setdefault(key, again.fit.objective)
        return self._subsamples[key]

    def first_fit(self, subsample: SubsampleFit, cause: Effect) -> SubsampleFit:
        """Take a first look at one more cause, from the best of the effect's starts and places."""
        orders = self.orders(subsample.hypothesis, cause)
        return min(
            (self._first_fit_of(subsample, order, cause) for order in orders), key=objective_of
        )

    def _first_fit_of(
        self, subsample: SubsampleFit, hypothesis: Hypothesis, cause: Effect
    ) -> SubsampleFit:
        key = self.key(hypothesis)
        if key not in self._subsamples:
            ground = subsample.fit
            lost = lost_fit(ground.model, self.rough.windows, ground.freedoms, ground.x0)
            look = SubsampleFit(hypothesis, lost, subsample.start)
            with self._spare(hypothesis):
                look = self._first_fit_from_best_start(subsample, hypothesis, cause)
            self._subsamples[key] = look
        return replace(self._subsamples[key], hypothesis=hypothesis)

    def _first_fit_from_best_start(
        self, subsample: SubsampleFit, hypothesis: Hypothesis, cause: Effect
    ) -> SubsampleFit:
        model = self._best_start(subsample, hypothesis, cause)
        look = self._subsample(hypothesis, model, subsample, max_steps=LOOK_STEPS)
        if look.start is not subsample.start:  # states of its own: they go with its parameters
            look = replace(look, start=self._rough_start(look.fit.model))
        return look

    def key(self, hypothesis: Hypothesis) -> Key:
        """Give what tells hypotheses apart: the causes, and their order where it matters.

        Parameters
        ----------
        hypothesis : Hypothesis
            The hypothesis.

        Returns
        -------
        tuple of frozenset
            Its causes, and the pairs of them that do not commute.
        """
        pairs = itertools.combinations(hypothesis.order, 2)
        ordered = frozenset(pair for pair in pairs if not self._commute(frozenset(pair)))
        return frozenset(hypothesis.causes), ordered

    def _commute(self, pair: frozenset) -> bool:
        if pair not in self._commuting:
            self._commuting[pair] = commute(self.problem.prior, *pair)
        return self._commuting[pair]

    def orders(self, hypothesis: Hypothesis, cause: Effect) -> list[Hypothesis]:
        """Add a cause at every place in the order at which it makes another model.

        Parameters
        ----------
        hypothesis : Hypothesis
            Causes.
        cause : Effect
            One more.

        Returns
        -------
        list of Hypothesis
            The cause last, then before others.
        """
        found: dict[Key, Hypothesis] = {}
        for at in reversed(range(len(hypothesis.order) + 1)):
            placed = hypothesis.plus(cause, at)
            found.setdefault(self.key(placed), placed)
        return list(found.values())

    def converge(self, subsample: SubsampleFit, prune_above: float = np.inf) -> SubsampleFit:
        """Follow a look to its end, or until it is clear that its objective stays prune_above."""
        if subsample.converged or not subsample.fit.usable:
            return subsample
        found = self._converge(
            subsample.hypothesis,
            subsample.fit.model,
            subsample.fit.x0,
            subsample.start,
            evaluation=subsample.fit.evaluation,
            prune_above=prune_above,
        )
        self._subsamples[self.key(subsample.hypothesis)] = found
        return found

    def reduce(self, subsample: SubsampleFit, cause: Effect) -> SubsampleFit:
        """SubsampleFit a hypothesis with one cause less."""
        return self._derive(subsample, subsample.hypothesis.without(cause))

    def split(self, subsample: SubsampleFit, cause: Effect, part: Effect) -> SubsampleFit:
        """SubsampleFit a hypothesis in which a part of a cause stands as a cause of its own."""
        hypothesis = subsample.hypothesis.before(cause, part)
        zero = {cause.names()[name]: 0.0 for name in hypothesis.taken_over(cause)}
        return self._derive(subsample, hypothesis, **zero)

    def exchange(
        self, subsample: SubsampleFit, cause: Effect, others: list[Effect]
    ) -> SubsampleFit:
        """SubsampleFit a hypothesis with some causes in the place of one."""
        hypothesis = subsample.hypothesis.without(cause)
        for place, other in enumerate(others, subsample.hypothesis.order.index(cause)):
            hypothesis = hypothesis.plus(other, place)
        return self._derive(subsample, hypothesis)

    def _derive(self, subsample, hypothesis, **values) -> SubsampleFit:
        """Start from the numbers of another subsample; keep what was known if that is better."""
        model = self._rebuild(hypothesis, subsample).with_parameters(**values)
        found, key = self._subsample(hypothesis, model, subsample), self.key(hypothesis)
        known = self._subsamples.get(key)
        if known is None or found.fit.objective < known.fit.objective:
            self._subsamples[key] = found
        return self.converge(replace(self._subsamples[key], hypothesis=hypothesis))

    def _subsample(self, hypothesis, model, beside: SubsampleFit, **options) -> SubsampleFit:
        start = self._start_beside(model, beside)
        x0 = _carry_over(beside.fit, model, start.x0)
        return self._converge(hypothesis, model, x0, start, **options)

    def _converge(
        self, hypothesis, model, x0, start, *, prune_above=np.inf, **options
    ) -> SubsampleFit:
        model, free = self._free(hypothesis, model)
        windows = self._rough_windows(model)
        fit = self._fit_windows(
            self._spare(hypothesis),
            model,
            windows,
            free,
            start,
            x0,
            tolerance=SUBSAMPLE_TOLERANCE,
            prune_above=prune_above,
            **options,
        )
        fit = self._turn(hypothesis, fit, windows, start, SUBSAMPLE_TOLERANCE)
        converged = "max_steps" not in options and fit.objective <= prune_above
        return SubsampleFit(hypothesis, self._noted(hypothesis, fit), start, converged)

    def _start_beside(self, model, beside: SubsampleFit) -> Start:
        """Take over what is known of the initial states, if they are the same states."""
        other = beside.fit.model
        same = tuple(model.states) == tuple(other.states)
        same = same and unsigned_states(model) == unsigned_states(other)
        return beside.start if same else self._rough_start(model)

    def _rough_start(self, model) -> Start:
        start = self._start(model)
        return Start(start.x0[self.rough.which], start.spread)

    def _rough_windows(self, model) -> ShootingWindows:
        own = len(model.states) > len(self.problem.prior.states)
        return self.rough.stepped if own else self.rough.windows

    def _best_start(self, subsample, hypothesis, cause) -> PhysicsModel:
        """Glance at every start, follow the most promising on a few windows, give the best."""
        models = self._starts(subsample, hypothesis, cause)
        if len(models) == 1:
            return models[0]
        held = _differing(models, cause)
        if len(models) > FOLLOWED:
            glances = [self._glance(hypothesis, model, subsample, held) for model in models]
            models = [glances[place].model for place in _valleys(glances)[:FOLLOWED]]
        looks = [self._follow(hypothesis, model, subsample, held) for model in models]
        return min(looks, key=_promise).model

    def _follow(self, hypothesis, model, subsample, held) -> "_Glance":
        """Take some steps on a few windows, the first without what the starts differ in."""
        nearer = self._glance(hypothesis, model, subsample, held, HELD_STEPS)
        return self._glance(hypothesis, nearer.model, subsample, (), FOLLOW_STEPS)

    def _glance(self, hypothesis, model, subsample, held, steps=0) -> "_Glance":
        """Give the objective that some steps on a few windows promise, and the model there."""
        few, start = _telling(subsample), self._start_beside(model, subsample)
        model, free = self._free(hypothesis, model)
        fit = self._fit_windows(
            suppress(*BREAKDOWNS),  # another start may do
            model,
            self._rough_windows(model).select(few),
            tuple(freedom for freedom in free if freedom.name not in held),
            Start(start.x0[few], start.spread),
            _carry_over(subsample.fit, model, start.x0)[few],
            max_steps=steps,
            tolerance=GLANCE_TOLERANCE,
        )
        return _Glance(
            fit.objective - expected_decrease(fit, start.x0[few], start.spread), fit.model
        )

    def _starts(self, subsample, hypothesis, cause) -> list[PhysicsModel]:
        """Extend the fitted model by every start, and the untuned one by a few."""
        starts = cause.proposals(self.problem.prior, self.scales)
        grounds = (subsample, None) if len(starts) <= FEW_STARTS else (subsample,)
        extended = [self._rebuild(hypothesis, values_of) for values_of in grounds]
        return [_at_start(model, start) for model in extended for start in starts]

    # -- models --------------------------------------------------------------------------------

    def model_of(self, hypothesis: Hypothesis) -> PhysicsModel:
        """Return the prior extended by the causes of a hypothesis, as they start."""
        return self._rebuild(hypothesis, None)

    def _rebuild(self, hypothesis, values_of: FittedHypothesis | None) -> PhysicsModel:
        """Extend the prior by the causes, with the parameter values of another fit."""
        model = self.problem.prior
        for cause in hypothesis.order:
            model = cause.proposals(model, self.problem.scales)[0].apply(model)
        values = {} if values_of is None else values_of.fit.model.parameters
        known = {name: p.value for name, p in values.items() if name in model.parameters}
        return model.with_parameters(**known)

    def _free(self, hypothesis, model):
        """Say what a fit may change; what a cause speaks for stays, and what has no spread."""
        prior = self.problem.prior
        held = {name for cause in hypothesis.causes for name in self.held(cause)}
        held |= without_spread(prior, hypothesis)
        model = model.with_parameters(**{name: prior.parameters[name].value for name in held})
        return model, freedoms(self.problem, hypothesis, model, held)

    def held(self, cause: Effect) -> tuple[str, ...]:
        """Name the prior's parameters that a cause speaks for, looked up once.

        Parameters
        ----------
        cause : Effect
            The cause.

        Returns
        -------
        tuple of str
            Their names.
        """
        if cause not in self._held_names:
            self._held_names[cause] = held_parameters(self.problem.prior, cause)
        return self._held_names[cause]

    # -- held out ------------------------------------------------------------------------------

    @cached_property
    def folds(self) -> np.ndarray:
        """Fold of every window, of shape (n_windows,)."""
        return make_folds(self.problem)

    def held_out(self, trial: FittedHypothesis) -> HeldOut:
        """Return what a hypothesis leaves of records that its parameters have not seen.

        Parameters
        ----------
        trial : FittedHypothesis
            The hypothesis, fitted on all windows.

        Returns
        -------
        HeldOut
            What is left, over windows and in free run.
        """
        key = self.key(trial.hypothesis)
        fit, known = self._held_out.get(key, (None, None))
        if known is None or fit is not trial.fit:
            known = self._cross_validate(trial.hypothesis, trial.fit)
            self._held_out[key] = trial.fit, known
        return known

    def squares_by_output(self, trial: FittedHypothesis) -> np.ndarray:
        """Return the squares that a hypothesis leaves of every output, in units of the noise."""
        residual = trial.fit.evaluation.residual / self.problem.windows.scale
        counts = np.isfinite(residual).sum(axis=0)
        return np.nansum(residual**2, axis=0) + counts * self.problem.resolution**2

    def white_squares(self, trial: FittedHypothesis) -> np.ndarray:
        """Return the white part of the squares that a hypothesis leaves, by output.

        Parameters
        ----------
        trial : FittedHypothesis
            The hypothesis, fitted on all windows.

        Returns
        -------
        ndarray of shape (n_outputs,)
            What neighbouring residuals differ by, as squares in units of the noise.
        """
        windows = self.problem.windows
        residual = trial.fit.evaluation.residual / windows.scale
        step = np.diff(residual, axis=0)
        step[windows.starts[1:] - 1] = np.nan
        counts = np.isfinite(residual).sum(axis=0)
        white = np.nanmean(step**2, axis=0) / 2.0
        return counts * np.maximum(white, self.problem.resolution**2)

    def _cross_validate(self, hypothesis: Hypothesis, fit: WindowFit) -> HeldOut:
        windows, start = self.problem.windows, self._start(fit.model)

        def learn(which: np.ndarray) -> WindowFit:
            return self._fit_windows(
                self._spare(hypothesis, HELD_OUT),
                fit.model,
                windows.select(which),
                fit.freedoms,
                Start(start.x0[which], start.spread),
                fit.x0[which],
                evaluation=fit.evaluation.select(which),
                min_steps=1,
                tolerance=SUBSAMPLE_TOLERANCE,
            )

        def judge(learned: WindowFit, which: np.ndarray) -> WindowFit:
            return self._fit_windows(
                self._spare(hypothesis, HELD_OUT),
                learned.model,
                windows.select(which),
                (),
                Start(start.x0[which], start.spread),
                fit.x0[which],
                tolerance=SUBSAMPLE_TOLERANCE,
            )

        validation = CrossValidation(self.problem, start.x0, start.spread)
        return validation.run(fit, self.folds, learn, judge)


def _suspect(hypothesis: Hypothesis) -> tuple[str, str, str]:
    """Name the cause that a hypothesis adds to others, by effect and target, and the others."""
    if not hypothesis.causes:
        return "", "", ""
    *others, last = hypothesis.causes
    names = " and ".join(f"{each.id} of {each.target}" for each in others)
    return last.id, last.target, f" beside {names}" if names else ""


def _why(fit: WindowFit) -> str:
    """Say why a fit cannot be used, unless an error has said so."""
    lost = np.count_nonzero(~np.isfinite(fit.evaluation.squares))
    return f"its simulation diverges or is made of rounding in {lost} of {len(fit.x0)} windows"


class _Glance(NamedTuple):
    """What a start promises, and where it has led."""

    promise: float
    model: PhysicsModel


def _promise(glance: _Glance) -> float:
    return glance.promise


def _valleys(glances: list[_Glance]) -> list[int]:
    """Order starts by what they promise, those that promise more than their neighbours first."""
    promise = np.array([glance.promise for glance in glances])
    padded = np.concatenate([[np.inf], promise, [np.inf]])
    slope = (padded[:-2] < promise) | (padded[2:] < promise)
    return list(np.lexsort((promise, slope)))


def _differing(models: list[PhysicsModel], cause: Effect) -> tuple[str, ...]:
    """Name the parameters of a cause in which its starts differ."""
    names = cause.names().values()
    return tuple(n for n in names if len({model.parameters[n].value for model in models}) > 1)


def _telling(subsample: SubsampleFit) -> np.ndarray:
    """Give the windows that tell most of what is missing, and as many of all kinds."""
    order = worst_first(subsample.fit.evaluation.squares)
    count = max(order.size // GLANCE, ROUGH_WINDOWS) // 2
    return np.unique(np.concatenate([order[:count], order[:: max(1, order.size // count)]]))


def _at_start(model: PhysicsModel, start) -> PhysicsModel:
    """Put an extended model's new parameters at another start of the effect."""
    own = {name: getattr(start, field) for field, name in start.names().items()}
    return model.with_parameters(**{n: value for n, value in own.items() if value is not None})


def block_squares(problem: EstimationProblem, fit: WindowFit, which=slice(None)) -> np.ndarray:
    """Sum the squared residuals of every block and output, in units of the noise."""
    windows = problem.windows.select(which)
    sums = windows.sum_blocks((fit.evaluation.residual / windows.scale) ** 2)
    sums[~np.isfinite(fit.evaluation.squares)] = np.inf
    return sums


def _carry_over(fit: WindowFit, model: PhysicsModel, expected) -> np.ndarray:
    """Start from fitted initial states where the model has the same state."""
    start, names = expected.copy(), list(fit.model.states)
    turned = set(unsigned_states(model)) ^ set(unsigned_states(fit.model))
    for i, state in enumerate(model.states):
        if state in names and state not in turned:
            start[:, i] = fit.x0[:, names.index(state)]
    return start
