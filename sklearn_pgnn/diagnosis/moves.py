"""Moves from a hypothesis to others: add, drop, replace and split causes."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import combinations

from sklearn_pgnn.diagnosis.comparison import Comparison, own_causes
from sklearn_pgnn.diagnosis.ladder import Ladder, usable
from sklearn_pgnn.estimation.budgets import KEPT, PAIRS
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis, SubsampleFit
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import WrongParameter


class Moves:
    """Moves from a hypothesis; most yield the hypotheses that the criterion accepts, best first."""

    def __init__(self, compare: Comparison, ladder: Ladder):
        self.compare, self.ladder = compare, ladder
        self.fitter, self.progress = ladder.fitter, ladder.progress

    # -- fewer causes ------------------------------------------------------------------------------

    def pruned(self, trial: FittedHypothesis, needed: float) -> FittedHypothesis:
        """Return a hypothesis without the causes that have too little evidence given a disturbance.

        Causes that are then no longer named are dropped, too.
        """
        while (fewer := self.drop_disturbed(trial, needed)) is not None:
            trial = self.without_needless(fewer)
        return trial

    def without_needless(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Drop causes until each is named beside the others."""
        while (fewer := self.drop(trial)) is not None:
            trial = fewer
        return trial

    def drop_disturbed(self, current: FittedHypothesis, needed: float) -> FittedHypothesis | None:
        """Drop the least needed cause given a disturbance, if more than white noise is left."""
        if not self.compare.is_coloured(current):
            return None
        return self.drop(current, partial(self.compare.names_disturbed, needed=needed))

    def drop(
        self,
        current: FittedHypothesis,
        is_named: Callable[[FittedHypothesis, FittedHypothesis], bool] | None = None,
    ) -> FittedHypothesis | None:
        """Drop the least needed cause, unless it is named beside the others."""
        is_named = self.compare.names if is_named is None else is_named
        if not current.hypothesis.causes:
            return None
        self.progress.begin("needless causes", len(current.hypothesis.causes))
        ground = self.fitter.subsample(current)
        reduced = usable([self.fitter.reduce(ground, c) for c in current.hypothesis.causes])
        self.fitter.prepare_fits(reduced, current)
        for subsample in reduced:
            without = self.fitter.fit_all(subsample, current)
            if without.fit.usable and not is_named(without, current):
                return without
        return None

    # -- more causes -------------------------------------------------------------------------------

    def add(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Add the best candidate; only the better half of the first fits is run to convergence."""
        fits = self.ladder.first_fits(current, self.ladder.candidates)
        yield from self._choose(current, self.ladder.converge(current, fits[: -(-len(fits) // 2)]))

    def add_patiently(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Add the best candidate; every first fit is run to convergence."""
        fits = self.ladder.first_fits(current, self.ladder.candidates)
        yield from self._choose(current, self.ladder.converge(current, fits))

    def add_known(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Add the best of the candidates that were fitted on some samples beside the causes."""
        fits = self.ladder.known_fits(current)
        yield from self._choose(current, self.ladder.converge(current, fits[:KEPT])[:1])

    def add_pair(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Add the best of the pairs of candidates that are expected to explain most together."""
        self.progress.begin("pairs", 2 * PAIRS)
        ground = self.fitter.subsample(current)
        ranked = self.ladder.screen().rank(ground, 2)
        allowed = [pair for _, pair in ranked if ground.hypothesis.plus(pair[0]).allows(pair[1])]
        fits = [self.ladder.step(fit) for fit in self._first_fits_of_pairs(ground, allowed[:PAIRS])]
        yield from self._choose(current, self.ladder.converge(current, usable(fits)), n_causes=2)

    def _first_fits_of_pairs(
        self, ground: SubsampleFit, pairs: Sequence[tuple[Effect, ...]]
    ) -> list[SubsampleFit]:
        """Fit every pair on some samples, starting with the cause that leaves less by itself."""
        fitter = self.fitter
        fitter.prepare_first_fits((ground, cause) for pair in pairs for cause in pair)
        alone = [usable([fitter.first_fit(ground, cause) for cause in pair]) for pair in pairs]
        both = [(fits[0], fits[1].hypothesis.causes[-1]) for fits in alone if len(fits) == 2]
        fitter.prepare_first_fits(both)
        return [fitter.first_fit(fit, other) for fit, other in both]

    def _choose(
        self, current: FittedHypothesis, fits: list[SubsampleFit], n_causes: int = 1
    ) -> Iterator[FittedHypothesis]:
        """Yield the named finalists; the simplest of those not refuted by another comes first."""
        self.fitter.prepare_fits(fits[:KEPT], current)
        trials = [self.fitter.fit_all(fit, current) for fit in fits[:KEPT]]
        while trials := [trial for trial in trials if trial.fit.usable]:
            best = self._simplest_of_the_best(trials)
            if self.compare.names(self.fitter.refit_from(current, best), best, n_causes):
                yield best
            trials.remove(best)

    def _simplest_of_the_best(self, trials: list[FittedHypothesis]) -> FittedHypothesis:
        """Return the simplest hypothesis among those that no other one refutes."""
        best = trials[0]
        for trial in trials[1:]:
            if self.compare.evidence(best, trial) > 0.0:
                best = trial
        left = [
            trial
            for trial in trials
            if not any(self.compare.refutes(other, trial) for other in trials if other is not trial)
        ]
        return min(
            left or [best],
            key=lambda trial: (*trial.hypothesis.complexity, -self.compare.evidence(best, trial)),
        )

    # -- other causes ------------------------------------------------------------------------------

    def replace(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Replace a cause by another candidate where that is preferred, the likeliest first.

        With a candidate that explains as much, another cause may become unnecessary.
        """
        for cause in current.hypothesis.causes:
            others = self.ladder.in_place(current, cause)
            for other in sorted(others, key=lambda trial: self.compare.evidence(trial, current)):
                if other.hypothesis.complexity < current.hypothesis.complexity:
                    other = self.fitter.refit_from(other, current)  # its own fit may have got stuck
                if self.compare.is_preferred(other, current) and self._is_needed(other, current):
                    yield other
                    return
                simpler = None if self.compare.refutes(current, other) else self.drop(other)
                if simpler is None or self.compare.refutes(current, simpler):
                    continue
                if self._is_needed(simpler, current):
                    yield simpler
                    return

    def _is_needed(self, other: FittedHypothesis, current: FittedHypothesis) -> bool:
        """Return whether a hypothesis has a cause that the current one lacks, and it is named."""
        own = own_causes(current, other)
        if not own:
            return False
        (new,) = own
        reduced = self.fitter.reduce(self.fitter.subsample(other), new)
        without = self.fitter.fit_all(reduced, other)
        return not without.fit.usable or self.compare.names(without, other)

    def replace_by_pair(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Replace a cause by the best of the promising pairs where these refute the cause."""
        ground = self.fitter.subsample(current)
        for cause in current.hypothesis.causes:
            without = self.fitter.fit_all(self.fitter.reduce(ground, cause), current)
            pairs = self.add_pair(without) if without.fit.usable else ()
            yield from (pair for pair in pairs if self.compare.refutes(pair, current))

    def any_of_few_sets(self, current: FittedHypothesis, most: int) -> Iterator[FittedHypothesis]:
        """Take the preferred one of all sets of few candidates in which every cause is named."""
        best = current
        for subsample in self.ladder.few_sets(most):
            trial = self.fitter.fit_all(subsample, current)
            if trial.fit.usable and self.compare.is_preferred(trial, best):
                best = best if self.drop(trial) is not None else trial
        if best is not current:
            yield best

    def split(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Replace a cause by its special cases where these explain as much with less complexity."""
        ground = self.fitter.subsample(current)
        apart = [a for c in current.hypothesis.causes for a in self._apart(ground, c)]
        fewer = [
            a for a in usable(apart) if a.hypothesis.n_parameters < current.hypothesis.n_parameters
        ]
        for subsample in sorted(fewer, key=lambda a: a.hypothesis.n_parameters):
            split = self.fitter.fit_all(subsample, current)
            if split.fit.usable and self.compare.is_preferred(split, current):
                yield split

    def _apart(self, ground: SubsampleFit, cause: Effect) -> list[SubsampleFit]:
        """Fit a cause together with a part of it, and its special cases in its place."""
        others = [c for c in self.ladder.candidates if c not in ground.hypothesis.causes]
        kin = [c for c in others if c.target == cause.target]
        found = [self.fitter.split(ground, cause, c) for c in kin if c.id in cause.shared]
        held = self.fitter.held(cause)
        special = [c for c in kin if c.id in cause.generalises]
        special += [c for c in others if isinstance(c, WrongParameter) and c.target in held]
        for count in range(1, len(special) + 1):
            for parts in combinations(special, count):
                found.append(self.fitter.exchange(ground, cause, list(parts)))
        return found

    def begin_anew(self, current: FittedHypothesis) -> FittedHypothesis:
        """Fit earlier causes again from their starts: they may have absorbed the last one."""
        earlier = current.hypothesis.causes[:-1]
        if not earlier:
            return current
        ground = self.fitter.subsample(current)
        for cause in earlier:
            ground = self.fitter.restart(ground, cause)
        again = self.fitter.fit_all(ground, current)
        return again if again.fit.objective < current.fit.objective else current
