"""When a difference between fits counts: noise, held-out gains, and what is as good."""

from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.estimation.fitting import HypothesisFitter, SubsampleFit, Trial, make_folds
from sklearn_pgnn.estimation.hypothesis import Cause
from sklearn_pgnn.estimation.problem import HARDLY

#: an effect shows itself in at least so many pieces, and the error falls by so many times more than
#: it rises, where it does not show itself in most
FEW, CLEARLY = 3, 10.0
#: smallest error that counts, as a share of an output's range: records may be free of noise
RESOLUTION = 1e-5
#: standard errors by which two fits must differ to be told apart
NOTICED = 2.0
#: standard errors by which a cause must help that the records show by themselves
LIKELY = 0.5


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


class Judge:
    """Compare fits.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fits hypotheses.
    rules : Rules
        When a difference counts.
    shown : frozenset of (effect class, target), default=frozenset()
        Causes that the records show by themselves: they need no proof, only to do no harm.

    Attributes
    ----------
    floor : float
        The squares that would be left if only white noise were, as low as any fit so far says.
    folds : ndarray of shape (n_windows,)
        Fold of every window, for what is held out.
    """

    def __init__(
        self, fitter: HypothesisFitter, rules: Rules, shown: frozenset[Cause] = frozenset()
    ):
        self.fitter, self.rules, self.shown = fitter, rules, shown
        self.folds = make_folds(fitter.problem)
        self.floor = np.inf

    # -- noise ---------------------------------------------------------------------------------

    def noise(self, trial: Trial) -> np.ndarray:
        """Estimate the white part of what a fit leaves, from neighbouring residuals."""
        problem = self.fitter.problem
        residual = trial.fit.evaluation.residual / problem.windows.scale
        step = np.diff(residual, axis=0)
        step[problem.windows.starts[1:] - 1] = np.nan
        return np.sqrt(np.nanmean(step**2, axis=0) / 2.0 / self._freedom(trial))

    def _freedom(self, trial: Trial) -> float:
        """Give the share of the samples that the fitted numbers have not used up."""
        problem = self.fitter.problem
        fitted = len(problem.windows) * len(trial.fit.model.states) + trial.fit.values.size
        return max(0.1, 1.0 - fitted / max(problem.n_samples, 1))

    def learn_noise(self, trial: Trial) -> None:
        """Lower the floor: the squares that would be left if only white noise were."""
        counts = np.isfinite(trial.fit.evaluation.residual).sum(axis=0)
        noise = np.maximum(self.noise(trial), self._resolution())
        self.floor = min(self.floor, float((noise**2 * counts).sum() * self._freedom(trial)))

    def _resolution(self) -> np.ndarray:
        """Give what no simulation is finer than, in units of the noise."""
        problem = self.fitter.problem
        typical = [problem.scales.typical[output] for output in problem.prior.outputs]
        return RESOLUTION * np.array(typical) / problem.windows.scale

    def excess(self, trial: Trial) -> float:
        """Give the squares a fit leaves above the floor."""
        return max(trial.squares - self.floor, 0.0)

    def is_at_noise(self, trial: Trial) -> bool:
        """Tell whether a fit leaves hardly more than noise."""
        return self.excess(trial) < self.rules.whole * trial.squares

    # -- on some of the samples ----------------------------------------------------------------

    def may_gain(self, before: SubsampleFit, after: SubsampleFit) -> bool:
        """Tell whether a sketch explains half of what counts as a gain, at least."""
        above = max(before.squares - self._rough_floor(), 0.0)
        enough = max(self.rules.whole * before.squares, self.rules.share * above)
        return before.squares - after.squares > enough / 2

    def may_simplify(self, before: SubsampleFit, after: SubsampleFit) -> bool:
        """Tell whether a sketch has fewer parameters, and is not clearly worse."""
        return n_parameters(after) < n_parameters(before) and not self.is_beaten(after, before)

    def is_beaten(self, worse: SubsampleFit, better: SubsampleFit) -> bool:
        """Tell whether a sketch is so much worse that no closer look can make it as good."""
        loss = worse.squares - better.squares
        floor = self._rough_floor()
        large = loss > max(2 * self.rules.share * (worse.squares - floor), HARDLY**2 * floor)
        return large and is_fall(worse.pieces, better.pieces, self.rules.significance)

    def _rough_floor(self) -> float:
        """Give the floor's part that falls to the samples of a sketch."""
        windows = self.fitter.rough.windows
        seen = windows.sum_blocks(np.isfinite(windows.y).astype(float)).sum()
        return float(self.floor * seen / self.fitter.problem.n_samples)

    # -- on all windows ------------------------------------------------------------------------

    def is_simpler(self, before: Trial, after: Trial) -> bool:
        """Tell whether a trial explains as much with fewer parameters, and says what is shown."""
        fewer = n_parameters(after) < n_parameters(before)
        fewer = fewer and not self._new(after, before) & self.shown
        return fewer and np.isfinite(after.squares) and self.as_good(before, after)

    def says_it_better(self, trial: Trial, other: Trial) -> bool:
        """Tell whether a trial explains as much with fewer numbers, or clearly more."""
        if self.is_simpler(trial, other):
            return True
        if n_parameters(other) != n_parameters(trial) and self.as_good(other, trial):
            return False
        falls = is_fall(trial.pieces, other.pieces, self.rules.significance)
        return other.squares < trial.squares and falls

    def as_good(self, best: Trial, other: Trial) -> bool:
        """Tell whether a trial explains as much as the best, but for little.

        Parameters
        ----------
        best, other : Trial
            Two hypotheses, fitted on all windows.

        Returns
        -------
        bool
            Whether the other leaves hardly more than the best.
        """
        loss = self.fair(other).sum() - self.fair(best).sum()
        return loss <= self.rules.share * self.excess(other) or not self.is_better(other, best)

    def is_better(self, worse: Trial, better: Trial) -> bool:
        """Tell whether two fits differ by more than chance and the simulation's own accuracy."""
        noise = self.floor / self.fitter.problem.n_samples
        many, few = self.fair(worse), self.fair(better)
        if many.sum() - few.sum() < max(NOTICED**2 * noise, HARDLY**2 * self.floor):
            return False
        return is_fall(many, few, NOTICED)

    def fair(self, trial: Trial) -> np.ndarray:
        """Give the squares of every piece, with what the states of effects' own explain by chance.

        Every window's initial value of such a state is one number more that is fitted to it.

        Parameters
        ----------
        trial : Trial
            A hypothesis, fitted on all windows.

        Returns
        -------
        ndarray of shape (n_windows, n_pieces)
            The squares.
        """
        return trial.pieces + self._by_chance(trial)

    def _by_chance(self, trial: Trial, more: int = 0) -> float:
        """Give the squares of a piece that initial values of added states, and more, explain."""
        problem = self.fitter.problem
        added = len(trial.fit.model.states) - len(problem.prior.states) + more
        return added * self.floor / problem.n_samples / problem.windows.pieces

    # -- held out ------------------------------------------------------------------------------

    def is_gain(self, before: Trial, after: Trial) -> bool:
        """Decide on windows that the parameters have not seen.

        Parameters
        ----------
        before, after : Trial
            A hypothesis, and one that says more.

        Returns
        -------
        bool
            Whether what it says more lowers the error enough, and not by chance.
        """
        worse, better = self._held_out(before), self._held_out(after)
        if not np.isfinite(better).all():
            return False
        if not np.isfinite(worse).all():
            return True
        new = self._new(before, after)
        if new and new <= self.shown:
            return self._is_clear(worse, better, LIKELY)
        return self._is_enough(worse, better, self.excess(before)) and all(
            self._outdoes_offset(before, after, target)
            for target in self._remembering(before, after)
        )

    def _is_enough(self, worse: np.ndarray, better: np.ndarray, above: float) -> bool:
        """Tell whether errors fall by a part of all, by one of what is no noise, and clearly."""
        gain = worse.sum() - better.sum()
        least = max(self.rules.whole * worse.sum(), self.rules.share * above)
        return bool(gain > least) and self._is_clear(worse, better)

    def _outdoes_offset(self, before: Trial, after: Trial, target: str) -> bool:
        """Tell whether errors are less than with an offset in every window, alone or beside it."""
        offset = self._held_out(before, target)
        if not np.isfinite(offset).all() or self._is_clear(offset, self._held_out(after)):
            return True
        both, above = self._held_out(after, target), offset.sum() - self.floor
        return bool(np.isfinite(both).all()) and self._is_enough(offset, both, above)

    def _remembering(self, before: Trial, after: Trial) -> set[str]:
        """Name the targets of new causes that have a memory."""
        return {cause[1] for cause in self._new(before, after) if self.remembers(cause)}

    @staticmethod
    def _new(before: Trial, after: Trial) -> set[Cause]:
        """Give the causes that a hypothesis has more."""
        return set(after.hypothesis.causes) - set(before.hypothesis.causes)

    def remembers(self, cause: Cause) -> bool:
        """Tell whether a cause has a memory, free at the start of a window."""
        effect, target = cause
        prior = self.fitter.problem.prior
        return len(effect(target).apply(prior).states) > len(prior.states)

    def _is_clear(self, worse: np.ndarray, better: np.ndarray, significance=None) -> bool:
        """Tell whether errors fall in the mean, or, where a few are huge, in proportion."""
        significance = self.rules.significance if significance is None else significance
        if is_fall(worse, better, significance):
            return True
        seen = (worse > 0) & (better > 0)
        return _mean_in_errors(np.log(worse[seen] / better[seen])) > significance

    def _held_out(self, trial: Trial, offset: str | None = None) -> np.ndarray:
        squares = self.fitter.held_out(trial, self.folds, offset).sum(axis=-1)
        return squares + self._by_chance(trial, offset is not None)


def is_fall(worse: np.ndarray, better: np.ndarray, significance: float) -> bool:
    """Tell whether the error norms of the pieces fall, and not by chance.

    Either their mean fall is so many of its standard errors; or, where an effect shows itself in a
    few pieces only, some fall by more than the noise and hardly any rises.

    Parameters
    ----------
    worse, better : ndarray
        Squared errors of the pieces, in units of the noise.
    significance : float
        Standard errors that count.

    Returns
    -------
    bool
        Whether they fall.
    """
    fall = (np.sqrt(worse) - np.sqrt(better)).ravel()
    falls, rises = fall[fall > 0].sum(), -fall[fall < 0].sum()
    few_but_clear = np.count_nonzero(fall > 1.0) >= FEW and falls > CLEARLY * rises
    mean = _mean_in_errors(fall)
    return bool(mean > significance or (mean > 0 and few_but_clear))


def _mean_in_errors(values: np.ndarray) -> float:
    """Give the mean in units of its standard error."""
    mean, error = values.mean(), np.std(values) / np.sqrt(max(values.size - 1, 1))
    if error > 0:
        return float(mean / error)
    return np.inf * np.sign(mean) if mean != 0 else 0.0


def n_parameters(trial: Trial) -> int:
    """Count the parameters that the causes of a hypothesis add."""
    return trial.hypothesis.n_parameters
