"""Search for what is missing: forward choice, backward elimination, a held-out decision."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from sklearn_pgnn.diagnosis.fitting import Fitter, Scouted, Trial, make_folds
from sklearn_pgnn.diagnosis.hypothesis import Cause, count_parameters
from sklearn_pgnn.physics.effects import WrongParameter

#: an effect shows itself in at least so many pieces, and the error falls by so many times more than
#: it rises, where it does not show itself in most
FEW, CLEARLY = 3, 10.0
#: smallest error that counts, as a share of an output's range: records may be free of noise
RESOLUTION = 1e-5
#: standard errors by which two fits must differ to be told apart
NOTICED = 2.0
#: suspects that are judged on held-out windows, the best first, before a search ends
JUDGED = 3


@dataclass(frozen=True)
class Rules:
    """When a difference counts; every rule is in units that the record itself gives.

    Parameters
    ----------
    significance : float
        A gain must be so many of its standard errors, taken over pieces of windows.
    share : float
        A cause must explain so much of the error power that is left above the noise; so must
        the finer of two causes explain of what the simpler one leaves.
    whole : float
        A cause must explain so much of all error power, noise included.
    max_causes : int
        Causes named at most.
    """

    significance: float = 3.0
    share: float = 0.15
    whole: float = 0.05
    max_causes: int = 4


@dataclass
class Outcome:
    """What a search found.

    Parameters
    ----------
    base : Trial
        The re-tuned prior.
    steps : list of Trial
        The final hypothesis, cause by cause in their order of importance.
    alternatives : dict
        For every cause, the causes that would do as well in its place.
    noise : ndarray of shape (n_outputs,)
        Noise left by the best fit, in units of the setting's noise.
    tried : dict
        Every cause tried alone, and the error power it leaves relative to the base.
    """

    base: Trial
    steps: list[Trial]
    alternatives: dict[Cause, tuple[Cause, ...]]
    noise: np.ndarray
    tried: dict[Cause, float] = field(default_factory=dict)

    @property
    def final(self) -> Trial:
        """The hypothesis that was accepted."""
        return self.steps[-1] if self.steps else self.base


class Search:
    """Search the causes of a model's error.

    Parameters
    ----------
    fitter : Fitter
        Fits hypotheses.
    suspects : tuple of (effect class, target)
        The causes to think of.
    rules : Rules
        When a difference counts.
    progress : callable
        Called as ``progress(stage, done, total)``.
    """

    def __init__(
        self,
        fitter: Fitter,
        suspects: tuple[Cause, ...],
        rules: Rules,
        progress: Callable[[str, int, int], None],
    ):
        self.fitter = fitter
        self.suspects = suspects
        self.rules = rules
        self.progress = progress
        self.folds = make_folds(fitter.setting)
        self.floor = np.inf

    def run(self) -> Outcome:
        """Find what is missing.

        Returns
        -------
        Outcome
            The accepted hypothesis and all that was weighed against it.
        """
        base = self.fitter.base()
        self._learn_noise(base)
        current, tried = base, {}
        while len(current.hypothesis.causes) < self.rules.max_causes:
            if self.excess(current) < self.rules.whole * current.squares:
                break
            scouted = self._scout(current)
            if current is base:
                tried = {look.cause: look.left for look in scouted}
            trials = self._extend(current, scouted)
            best = self._decide(current, trials)
            if best is None:
                break
            current = self._eliminate(best)
        base = self.fitter.base()
        current = self._split(self._swap(current, tried))
        steps = self._in_order(base, current)
        alternatives = {c: self._alternatives(current, c, tried) for c in current.hypothesis.causes}
        return Outcome(base, steps, alternatives, self._noise(current), tried)

    # -- noise ---------------------------------------------------------------------------------

    def _noise(self, trial: Trial) -> np.ndarray:
        """Estimate the white part of what a fit leaves, from neighbouring residuals."""
        setting = self.fitter.setting
        residual = trial.fit.evaluation.residual / setting.windows.scale
        step = np.diff(residual, axis=0)
        step[setting.windows.starts[1:] - 1] = np.nan
        return np.sqrt(np.nanmean(step**2, axis=0) / 2.0 / self._freedom(trial))

    def _freedom(self, trial: Trial) -> float:
        """Give the share of the samples that the fitted numbers have not used up."""
        setting = self.fitter.setting
        fitted = len(setting.windows) * len(trial.fit.model.states) + trial.fit.values.size
        return max(0.1, 1.0 - fitted / max(setting.n_samples, 1))

    def _learn_noise(self, trial: Trial) -> None:
        """Lower the floor: the squares that would be left if only white noise were."""
        counts = np.isfinite(trial.fit.evaluation.residual).sum(axis=0)
        noise = np.maximum(self._noise(trial), self._resolution())
        self.floor = min(self.floor, float((noise**2 * counts).sum() * self._freedom(trial)))

    def _resolution(self) -> np.ndarray:
        """Give what no simulation is finer than, in units of the noise."""
        setting = self.fitter.setting
        typical = [setting.scales.typical[output] for output in setting.prior.outputs]
        return RESOLUTION * np.array(typical) / setting.windows.scale

    def excess(self, trial: Trial) -> float:
        """Give the squares a fit leaves above the floor."""
        return max(trial.squares - self.floor, 0.0)

    # -- forward -------------------------------------------------------------------------------

    def _scout(self, current: Trial) -> list[Scouted]:
        """Look at every suspect on top of the current hypothesis."""
        left = [c for c in self.suspects if c not in current.hypothesis.causes]
        stage = f"cause {len(current.hypothesis.causes) + 1}"
        found = []
        for done, cause in enumerate(left):
            self.progress(stage, done, len(left))
            found.append(self.fitter.scout(current, cause))
        self.progress(stage, len(left), len(left))
        return sorted((s for s in found if np.isfinite(s.left)), key=lambda s: s.left)

    def _extend(self, current: Trial, scouted: list[Scouted]) -> list[Trial]:
        """Fit the suspects that explain at least half of what the best explains."""
        if not scouted:
            return []
        enough = 1.0 - 0.5 * (1.0 - scouted[0].left)
        trials = []
        for place, look in enumerate(scouted):
            if place < 3 or look.left <= enough:
                trial = self.fitter.extend(current, look.cause)
                if np.isfinite(trial.squares):
                    self._learn_noise(trial)
                    trials.append(trial)
        return trials

    def _decide(self, current: Trial, trials: list[Trial]) -> Trial | None:
        """Give the best trial that proves itself on windows it has not seen."""
        left = list(trials)
        while left and len(trials) - len(left) < JUDGED:
            best = self._simplest_of_the_best(left)
            current = self.fitter.retry(current, best)
            if self._is_gain(current, best):
                return best
            left.remove(best)
        return None

    def _simplest_of_the_best(self, trials: list[Trial]) -> Trial:
        """Give the trial with the fewest parameters among those as good as the best."""
        best = min(trials, key=lambda trial: trial.squares)
        equal = [trial for trial in trials if self._as_good(best, trial)]
        return min(equal, key=lambda trial: (*self._complexity(trial), trial.squares))

    @staticmethod
    def _complexity(trial: Trial) -> tuple:
        """Fewest parameters first; at equal number a wrong number before a missing part."""
        effect, _ = cause = trial.hypothesis.causes[-1]
        return count_parameters(cause), effect is not WrongParameter

    def _as_good(self, best: Trial, other: Trial) -> bool:
        """Tell whether a trial explains as much as the best, but for little."""
        loss = other.squares - best.squares
        return loss <= self.rules.share * self.excess(other) or not self._is_better(other, best)

    def _is_better(self, worse: Trial, better: Trial) -> bool:
        """Tell whether the windows can tell two fits apart, and by more than noise would."""
        noise = self.floor / self.fitter.setting.n_samples
        if worse.squares - better.squares < NOTICED**2 * noise:
            return False
        return _is_fall(worse.pieces, better.pieces, NOTICED)

    def _is_gain(self, before: Trial, after: Trial) -> bool:
        """Decide on windows that the parameters have not seen."""
        worse, better = self._held_out(before), self._held_out(after)
        if not np.all(np.isfinite(better)):
            return False
        gain = worse.sum() - better.sum()
        return bool(
            gain > self.rules.whole * worse.sum()
            and gain > self.rules.share * self.excess(before)
            and _is_fall(worse, better, self.rules.significance)
        )

    def _held_out(self, trial: Trial) -> np.ndarray:
        return self.fitter.held_out(trial, self.folds).sum(axis=-1)

    # -- backward ------------------------------------------------------------------------------

    def _eliminate(self, trial: Trial) -> Trial:
        """Drop causes that are no longer needed, the least needed first."""
        while len(trial.hypothesis.causes) > 1:
            reduced = [self.fitter.reduce(trial, c) for c in trial.hypothesis.causes[:-1]]
            least = min(reduced, key=lambda t: t.squares)
            if self._is_gain(least, trial):
                return trial
            trial = least
        return trial

    def _swap(self, trial: Trial, tried) -> Trial:
        """Put another cause in a cause's place where that is clearly better."""
        if len(trial.hypothesis.causes) < 2:
            return trial
        for cause in trial.hypothesis.causes:
            without = self.fitter.reduce(trial, cause)
            for other in self._worth_a_look(trial, without, cause, tried):
                swapped = self.fitter.extend(without, other)
                self._learn_noise(swapped)
                better = swapped.squares < trial.squares
                if better and _is_fall(trial.pieces, swapped.pieces, self.rules.significance):
                    return self._swap(swapped, tried)
        return trial

    def _split(self, trial: Trial) -> Trial:
        """Let a part of a cause stand on its own where that says the same with fewer numbers."""
        for cause in trial.hypothesis.causes:
            for part in self.suspects:
                if part[0].id in cause[0].shared and part[1] == cause[1]:
                    split = self.fitter.split(trial, cause, part)
                    fewer = split.hypothesis.n_parameters < trial.hypothesis.n_parameters
                    if fewer and np.isfinite(split.squares) and self._as_good(trial, split):
                        return split
        return trial

    def _worth_a_look(self, trial, without, cause, tried):
        """Give the suspects that come near to a cause's part, alone and at a first look."""
        alone = 1.0 - tried.get(cause, 1.0)
        needed = 1.0 - trial.squares / without.squares
        return [
            other
            for other, left in tried.items()
            if other not in trial.hypothesis.causes
            and 1.0 - left > 0.3 * alone
            and 1.0 - self.fitter.scout(without, other).left > 0.8 * needed
        ]

    # -- result --------------------------------------------------------------------------------

    def _alternatives(self, trial: Trial, cause: Cause, tried) -> tuple[Cause, ...]:
        """Give the causes that would explain the records as well in a cause's place."""
        without = self.fitter.reduce(trial, cause)
        if not self._is_better(without, trial):
            return ()
        found = []
        for other in self._worth_a_look(trial, without, cause, tried):
            if count_parameters(other) > count_parameters(cause):
                continue
            swapped = self.fitter.extend(without, other)
            if np.isfinite(swapped.squares) and not self._is_better(swapped, trial):
                found.append((swapped.squares, other))
        return tuple(other for _, other in sorted(found, key=lambda item: item[0]))

    def _in_order(self, base: Trial, final: Trial) -> list[Trial]:
        """Add the causes of the final hypothesis one by one, the most telling first."""
        left, steps, trial = list(final.hypothesis.causes), [], base
        while left:
            if len(left) == 1:
                steps.append(Trial(trial.hypothesis.plus(left[0]), final.fit))
                break
            ready = [c for c in left if not any(part.id in c[0].shared for part, _ in left)]
            options = [self.fitter.extend(trial, cause) for cause in ready]
            trial = min(options, key=lambda t: t.squares)
            left.remove(trial.hypothesis.causes[-1])
            steps.append(trial)
        return steps


def _is_fall(worse: np.ndarray, better: np.ndarray, significance: float) -> bool:
    """Tell whether the error norms of the pieces fall, and not by chance.

    Either their mean fall is so many of its standard errors; or, where an effect shows itself in a
    few pieces only, some fall by more than the noise and hardly any rises.
    """
    fall = (np.sqrt(worse) - np.sqrt(better)).ravel()
    mean = fall.mean()
    error = np.std(fall, ddof=1) / np.sqrt(fall.size) if fall.size > 1 else 0.0
    falls, rises = fall[fall > 0].sum(), -fall[fall < 0].sum()
    few_but_clear = np.count_nonzero(fall > 1.0) >= FEW and falls > CLEARLY * rises
    return bool(mean > 0 and (mean > significance * error or few_but_clear))
