"""Successive fits of candidates: from a few steps on few samples to a fit on all windows."""

from collections.abc import Iterable, Sequence
from itertools import combinations
from math import comb

import numpy as np

from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times
from sklearn_pgnn.estimation.budgets import KEPT, SETS
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis, SubsampleFit, objective_of
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.held_out import segments
from sklearn_pgnn.estimation.screening import Screening
from sklearn_pgnn.estimation.squares_left import ShareLeft, share_left
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.simulation.led_states import n_free_states


class Ladder:
    """Fit candidates added to a hypothesis; every rung fits fewer of them on more samples.

    The criterion also limits how far behind the best a candidate may be. `same` has, by candidate,
    the effects that are the same in the equations of the prior, and `alone` the share of the
    re-tuned prior's squares that each candidate leaves as the only cause, as far as known.
    """

    def __init__(
        self,
        fitter: HypothesisFitter,
        criterion: SelectionCriterion,
        candidates: tuple[Effect, ...],
        same: dict[Effect, tuple[Effect, ...]],
    ):
        self.fitter, self.candidates, self.same = fitter, candidates, same
        self.progress = fitter.progress
        self.alone: dict[Effect, ShareLeft] = {}
        self._criterion = criterion
        self._screening: Screening | None = None

    def widen(self, candidates: tuple[Effect, ...]) -> None:
        """Consider more candidates from now on."""
        self.candidates, self._screening = candidates, None

    def first_fits(
        self, current: FittedHypothesis, candidates: Iterable[Effect]
    ) -> list[SubsampleFit]:
        """Fit candidates beside the causes on some samples for some steps, nearest first."""
        allowed = [c for c in candidates if current.hypothesis.allows(c)]
        self.progress.begin(f"cause {len(current.hypothesis.causes) + 1}", 2 * len(allowed))
        return self._first_fits(self.fitter.subsample(current), allowed)

    def _first_fits(self, ground: SubsampleFit, candidates: Sequence[Effect]) -> list[SubsampleFit]:
        fits = []
        self.fitter.prepare_first_fits((ground, cause) for cause in candidates)
        for cause in candidates:
            fits.append(self.fitter.first_fit(ground, cause))
            self._learn(ground, fits[-1])
            self.step(fits[-1])
        return usable(fits)

    def known_fits(self, current: FittedHypothesis) -> list[SubsampleFit]:
        """Return the first fits beside the causes that were made already, nearest first."""
        ground, fitter = self.fitter.subsample(current), self.fitter
        allowed = (c for c in self.candidates if current.hypothesis.allows(c))
        known = (c for c in allowed if np.isfinite(fitter.known_squares(ground, c)))
        return usable([fitter.first_fit(ground, c) for c in known])

    def has_few_sets(self, most: int) -> bool:
        """Return whether there are so few sets of up to so many candidates that all are fitted."""
        count = len(self.candidates)
        return sum(comb(count, n) for n in range(1, min(most, count) + 1)) <= SETS

    def few_sets(self, most: int) -> list[SubsampleFit]:
        """Fit all sets of up to so many candidates, the small ones first.

        A set begins with the best of those with one candidate less, and every one of its candidates
        begins anew beside the others.
        """
        counts = range(1, min(most, len(self.candidates)) + 1)
        sets = [frozenset(c) for n in counts for c in combinations(self.candidates, n)]
        self.progress.begin("all sets", len(sets))
        found = {frozenset[Effect](): self.fitter.subsample(self.fitter.base())}
        for chosen in sets:
            less = [(found[chosen - {c}], c) for c in chosen if chosen - {c} in found]
            fits = [self._begin_anew(*each) for each in less if each[0].hypothesis.allows(each[1])]
            if usable(fits):
                found[chosen] = self.step(usable(fits)[0])
        return list(found.values())[1:]

    def _begin_anew(self, ground: SubsampleFit, cause: Effect) -> SubsampleFit:
        """Fit a cause beside others, and these again from their starts."""
        fit = self.fitter.converge(self.fitter.first_fit(ground, cause))
        for other in ground.hypothesis.causes if fit.fit.usable else ():
            fit = self.fitter.restart(fit, other)
        return fit

    def _learn(self, ground: SubsampleFit, fit: SubsampleFit) -> None:
        """Note what a candidate leaves as the only cause, or what it changes beside others."""
        if ground.hypothesis.causes:
            self.screen().learn(ground, fit)
        else:
            self._note_alone(ground, [fit])

    def converge(self, current: FittedHypothesis, fits: list[SubsampleFit]) -> list[SubsampleFit]:
        """Run fits to convergence, or until the best one refutes them; nearest first."""
        best, found = None, []
        for fit in fits:
            limit = np.inf if best is None else self._limit(best, fit)
            found.append(self.step(self.fitter.converge(fit, limit)))
            if found[-1].fit.usable and (best is None or found[-1].squares < best.squares):
                best = found[-1]
        if not current.hypothesis.causes:
            self._note_alone(self.fitter.subsample(current), found)
        return usable(found)

    def promising(self, ground: SubsampleFit) -> tuple[Effect, ...]:
        """Return the half of the candidates expected to leave least; all if there is no cause yet.

        For candidates already fitted beside the same causes the known value is used if it is lower.
        Candidates without an expectation, since no fit of them could be made, are kept as well.
        """
        if not ground.hypothesis.causes:
            return self.candidates
        screening = self.screen()
        left = {
            cause: min(expected, self.fitter.known_squares(ground, cause))
            for expected, (cause,) in screening.rank(ground)
        }
        ranked = sorted(left, key=lambda cause: left[cause])
        unknown = set(self.candidates) - screening.known
        return (*ranked[: -(-len(ranked) // 2)], *(c for c in self.candidates if c in unknown))

    def screen(self) -> Screening:
        """Return what the candidates change, by their first fits."""
        if self._screening is None:
            self._screening = Screening(self.fitter.windows_of, self.fitter.progress.tick)
            base = self.fitter.subsample(self.fitter.base())
            self.fitter.prepare_first_fits((base, cause) for cause in self.candidates)
            for cause in self.candidates:
                alone = self.fitter.first_fit(base, cause)
                self._note_alone(base, [alone])
                self._screening.learn(base, alone)
        return self._screening

    def in_place(self, current: FittedHypothesis, cause: Effect) -> list[FittedHypothesis]:
        """Return the hypotheses with another candidate in a cause's place, on all windows."""
        without = self.fitter.reduce(self.fitter.subsample(current), cause)
        likely = self.promising(without)
        others = [c for c in likely if c != cause and without.hypothesis.allows(c)]
        self.progress.begin("other causes", 2 * len(others))
        fits = self._first_fits(without, others)
        best, known = self.fitter.subsample(current), self.fitter.is_known
        ends = [self.step(self.fitter.converge(fit, self._limit(best, fit))) for fit in fits]
        near = [
            fit
            for fit in usable(ends)
            if fit.squares <= self._limit(best, fit) or known(fit.hypothesis)
        ]
        self.fitter.prepare_fits(near[: 2 * KEPT], current)
        trials = [self.fitter.fit_all(fit, current) for fit in near[: 2 * KEPT]]
        return [trial for trial in trials if trial.fit.usable]

    def _limit(self, best: SubsampleFit, fit: SubsampleFit) -> float:
        """Return the sum of squares above which a fit can no longer compete with the best one.

        Every value that is free at the start of a window explains about one sample's noise.
        """
        left, windows = (
            [each.fit.evaluation.residual for each in (best, fit)],
            self.fitter.rough.windows,
        )
        window = segments(windows)
        time = np.max([autocorrelation_times(residual, window) for residual in left])
        count = np.isfinite(left[0]).sum()
        reach = self._criterion.to_refute + self._criterion.to_name
        free = [n_free_states(each.fit.model, windows) for each in (best, fit)]
        more = max(free[0] - free[1], 0) * len(windows) / count
        return best.squares * (float(np.exp(min(2.0 * reach * time / count, 10.0))) + more)

    def step(self, fit: SubsampleFit) -> SubsampleFit:
        """Report that a fit is done, and whether it is the best so far."""
        causes = fit.hypothesis.causes
        self.progress.note(fit.times_noise, " and ".join(c.title(c.target) for c in causes))
        self.progress.step()
        return fit

    def _note_alone(self, ground: SubsampleFit, fits: list[SubsampleFit]) -> None:
        """Note the share of the squares that each candidate leaves as the only cause."""
        for fit in fits:
            if len(fit.hypothesis.causes) == 1 and fit.fit.usable and ground.fit.usable:
                (cause,) = fit.hypothesis.causes
                for same in (cause, *self.same[cause]):
                    left = share_left(*(each.fit.evaluation.squares for each in (ground, fit)))
                    self.alone[same] = min(left, self.alone.get(same, left))


def usable(fits: list[SubsampleFit]) -> list[SubsampleFit]:
    """Return the usable fits, those closest to the records first."""
    return sorted((fit for fit in fits if fit.fit.usable), key=objective_of)
