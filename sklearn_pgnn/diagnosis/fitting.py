"""Fit hypotheses on the windows of a setting; remember what was fitted."""

from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.diagnosis.hypothesis import Cause, Hypothesis, freedoms, held_parameters
from sklearn_pgnn.diagnosis.setting import Setting
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.window_fit import WindowFit, expected_decrease, fit_windows

#: starts that are looked at for two steps, after a glance at all of them
LOOKED_AT = 3
#: the untuned prior is a ground to start from too, for effects of at most so many starts
FEW_STARTS = 4
#: relative decrease at which a first look and a fit from a known minimum end
SCOUT_TOLERANCE = 1e-3
#: steps for the initial states alone, which are nearly linear
PRIOR_STEPS = 8
#: a first look takes every so many windows that about this many samples remain
SCOUT_SAMPLES, SCOUT_WINDOWS = 8000, 3


@dataclass(frozen=True)
class Trial:
    """A hypothesis fitted on all windows.

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
        """Sum of squared residuals in units of the noise."""
        return self.fit.squares

    @property
    def pieces(self) -> np.ndarray:
        """Sum of squared residuals of every piece of every window."""
        return self.fit.evaluation.piece_squares


@dataclass(frozen=True)
class Scouted:
    """A first look at a cause, on some of the windows.

    Parameters
    ----------
    cause : (effect class, target)
        The cause.
    model : PhysicsModel
        The extended model as fitted on those windows.
    left : float
        Squares it leaves there, relative to those without the cause.
    """

    cause: Cause
    model: PhysicsModel
    left: float


class Fitter:
    """Fits hypotheses, each once.

    Parameters
    ----------
    setting : Setting
        The ground of the diagnosis.
    """

    def __init__(self, setting: Setting):
        self.setting = setting
        self._trials: dict[frozenset, Trial] = {}
        self._held_out: dict[frozenset, np.ndarray] = {}
        self._scouted: dict[frozenset, Scouted] = {}
        self._held_names: dict[Cause, tuple[str, ...]] = {}
        self.some = _some_windows(setting)

    def prior(self) -> WindowFit:
        """Fit only the initial states, at the prior's parameters."""
        return self._fit(self.setting.prior, (), None, max_steps=PRIOR_STEPS)

    def base(self) -> Trial:
        """Re-tune the prior within its spread."""
        return self._remember(
            Hypothesis(), lambda: self._fit_hypothesis(Hypothesis(), self.setting.prior, None)
        )

    def base_error(self) -> float:
        """Give the re-tuned prior's error in units of the noise."""
        return float(np.sqrt(self.base().squares / self.setting.n_samples))

    def scout(self, trial: Trial, cause: Cause) -> Scouted:
        """Look at one more cause on some windows, from all the starts the effect proposes."""
        hypothesis = trial.hypothesis.plus(cause)
        if hypothesis.key not in self._scouted:
            self._scouted[hypothesis.key] = self._best_start(trial, hypothesis, cause)
        return self._scouted[hypothesis.key]

    def extend(self, trial: Trial, cause: Cause) -> Trial:
        """Fit a hypothesis with one more cause on all windows."""
        hypothesis = trial.hypothesis.plus(cause)

        def fit():
            return self._fit_hypothesis(hypothesis, self.scout(trial, cause).model, trial)

        return self._remember(hypothesis, fit)

    def reduce(self, trial: Trial, cause: Cause) -> Trial:
        """Fit a hypothesis with one cause less."""
        hypothesis = trial.hypothesis.without(cause)

        def fit():
            start = self._rebuild(hypothesis, trial.fit.model)
            return self._fit_hypothesis(hypothesis, start, trial)

        return self._remember(hypothesis, fit)

    def retry(self, trial: Trial, better: Trial) -> Trial:
        """Fit a hypothesis again from the numbers of a finer one: its own may have got stuck."""
        start = self._rebuild(trial.hypothesis, better.fit.model)
        fit = self._fit_hypothesis(trial.hypothesis, start, better)
        if fit.objective >= trial.fit.objective:
            return trial
        self._held_out.pop(trial.hypothesis.key, None)
        self._trials[trial.hypothesis.key] = Trial(trial.hypothesis, fit)
        return self._trials[trial.hypothesis.key]

    def split(self, trial: Trial, cause: Cause, part: Cause) -> Trial:
        """Fit a hypothesis in which a part of a cause stands as a cause of its own."""
        hypothesis = trial.hypothesis.before(cause, part)
        zero = {cause[0](cause[1]).names()[name]: 0.0 for name in hypothesis.taken_over(cause)}

        def fit():
            start = self._rebuild(hypothesis, trial.fit.model).with_parameters(**zero)
            return self._fit_hypothesis(hypothesis, start, trial)

        return self._remember(hypothesis, fit)

    def _remember(self, hypothesis, fit) -> Trial:
        if hypothesis.key not in self._trials:
            self._trials[hypothesis.key] = Trial(hypothesis, fit())
        known = self._trials[hypothesis.key]
        return known if known.hypothesis == hypothesis else Trial(hypothesis, known.fit)

    def _best_start(self, trial, hypothesis, cause) -> Scouted:
        """Glance at every start, look at the best for two steps, follow the very best."""

        def look(model, **options):
            return self._fit_hypothesis(hypothesis, model, trial, which=self.some, **options)

        glances = [look(model, max_steps=0) for model in self._starts(trial, cause)]
        glances.sort(key=self._expected_objective)
        looks = [look(glance.model, max_steps=2) for glance in glances[:LOOKED_AT]]
        start = min(looks, key=lambda fit: fit.objective)
        best = look(start.model, x0_start=start.x0, tolerance=SCOUT_TOLERANCE)
        return Scouted(cause, best.model, best.squares / trial.pieces[self.some].sum())

    def _starts(self, trial, cause) -> list[PhysicsModel]:
        """Extend the fitted model by every start, and the untuned one by a few."""
        effect, target = cause
        starts = effect.starts(target, self.setting.prior, self.setting.scales)
        grounds = [trial.fit.model]
        if len(starts) <= FEW_STARTS:
            grounds.append(self._rebuild(trial.hypothesis, self.setting.prior))
        extended = [starts[0].apply(ground) for ground in grounds]
        return [_at_start(model, start) for model in extended for start in starts]

    def _expected_objective(self, fit: WindowFit) -> float:
        estimate = self.setting.states.estimate(fit.model)
        expected = estimate.x[self.setting.windows.select(self.some).starts]
        return fit.objective - expected_decrease(fit, expected, estimate.spread)

    def _rebuild(self, hypothesis, values_of: PhysicsModel) -> PhysicsModel:
        """Extend the prior by the causes, with the parameter values of another model."""
        model = self.setting.prior
        for effect, target in hypothesis.causes:
            start = effect.starts(target, model, self.setting.scales)[0]
            model = start.apply(model)
        known = {n: p.value for n, p in values_of.parameters.items() if n in model.parameters}
        return model.with_parameters(**known)

    def _fit_hypothesis(self, hypothesis, model, trial, **options) -> WindowFit:
        prior = self.setting.prior
        held = {name for cause in hypothesis.causes for name in self._held(cause)}
        model = model.with_parameters(**{name: prior.parameters[name].value for name in held})
        free = freedoms(self.setting, hypothesis, model, held)
        return self._fit(model, free, trial, **options)

    def _held(self, cause: Cause) -> tuple[str, ...]:
        """Name the prior's parameters that a cause speaks for, looked up once."""
        if cause not in self._held_names:
            self._held_names[cause] = held_parameters(self.setting.prior, cause)
        return self._held_names[cause]

    def _fit(self, model, free, trial, which=slice(None), **options) -> WindowFit:
        setting = self.setting
        windows = setting.windows.select(which)
        estimate = setting.states.estimate(model)
        expected = estimate.x[windows.starts]
        if trial is not None and "x0_start" not in options:
            options["x0_start"] = _carry_over(trial.fit, model, expected, which)
        return fit_windows(model, windows, free, expected, estimate.spread, **options)

    def held_out(self, trial: Trial, folds: np.ndarray) -> np.ndarray:
        """Give every window's squares under parameters fitted without its fold.

        Parameters
        ----------
        trial : Trial
            The hypothesis, fitted on all windows.
        folds : ndarray of shape (n_windows,)
            Fold of every window.

        Returns
        -------
        ndarray of shape (n_windows, n_pieces, n_outputs)
            Sum of squared residuals of every piece, in units of the noise.
        """
        key = trial.hypothesis.key
        if key not in self._held_out:
            self._held_out[key] = self._cross_validate(trial, folds)
        return self._held_out[key]

    def _cross_validate(self, trial, folds):
        setting, fit = self.setting, trial.fit
        windows = setting.windows
        squares = np.zeros((len(windows), windows.pieces, windows.y.shape[1]))
        estimate = setting.states.estimate(fit.model)
        expected = estimate.x[setting.windows.starts]
        for fold in np.unique(folds):
            inside, outside = folds == fold, folds != fold
            learned = fit_windows(
                fit.model,
                setting.windows.select(outside),
                fit.freedoms,
                expected[outside],
                estimate.spread,
                x0_start=fit.x0[outside],
                tolerance=SCOUT_TOLERANCE,
            )
            judged = fit_windows(
                learned.model,
                setting.windows.select(inside),
                (),
                expected[inside],
                estimate.spread,
                x0_start=fit.x0[inside],
                tolerance=SCOUT_TOLERANCE,
            )
            squares[inside] = piece_squares(setting, judged, inside)
        return squares


def _at_start(model: PhysicsModel, start) -> PhysicsModel:
    """Put an extended model's new parameters at another start of the effect."""
    own = {name: getattr(start, field) for field, name in start.names().items()}
    return model.with_parameters(**{n: value for n, value in own.items() if value is not None})


def piece_squares(setting: Setting, fit: WindowFit, which=slice(None)) -> np.ndarray:
    """Sum the squared residuals of every piece and output, in units of the noise."""
    windows = setting.windows.select(which)
    sums = windows.sum_pieces((fit.evaluation.residual / windows.scale) ** 2)
    sums[~np.isfinite(fit.evaluation.squares)] = np.inf
    return sums


def make_folds(setting: Setting, n_folds: int = 4) -> np.ndarray:
    """Deal the windows into folds: by whole records, or by stretches of a few records.

    Parameters
    ----------
    setting : Setting
        The ground of the diagnosis.
    n_folds : int, default=4
        Number of folds.

    Returns
    -------
    ndarray of shape (n_windows,)
        Fold of every window.
    """
    record = setting.windows.record
    n_records = record.max() + 1
    if n_records >= n_folds:
        return record % n_folds
    order = np.arange(record.size)
    return (order * n_folds // record.size) if n_records == 1 else record


def _some_windows(setting: Setting) -> np.ndarray:
    """Take every k-th window, so that a first look is cheap whatever the length of the record."""
    count = len(setting.windows)
    step = setting.n_samples // SCOUT_SAMPLES
    return np.arange(0, count, max(1, min(step, count // SCOUT_WINDOWS)))


def _carry_over(fit: WindowFit, model: PhysicsModel, expected, which) -> np.ndarray:
    """Start from fitted initial states where the model has the same state."""
    start, names = expected.copy(), list(fit.model.states)
    for i, state in enumerate(model.states):
        if state in names:
            start[:, i] = fit.x0[which, names.index(state)]
    return start
