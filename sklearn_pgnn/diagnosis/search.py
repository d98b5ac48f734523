"""Search for what is missing: moves from hypothesis to hypothesis, the cheap ones first."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from sklearn_pgnn.diagnosis.rivals import find_rivals
from sklearn_pgnn.diagnosis.search_result import SearchResult, in_order
from sklearn_pgnn.diagnosis.size import overdispersion_along
from sklearn_pgnn.estimation.budgets import BETTER, KEPT, MUCH, PAIRS
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_hypothesis import (
    FittedHypothesis,
    SubsampleFit,
    is_clearly_less,
    objective_of,
)
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis import same_causes
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.estimation.progress import TimeIsUp
from sklearn_pgnn.estimation.residuals import Residuals
from sklearn_pgnn.estimation.screening import Screening
from sklearn_pgnn.estimation.share_left import ShareLeft, share_left
from sklearn_pgnn.estimation.stretches import is_long
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import WrongParameter

#: yields the hypotheses that a move leads to and the criterion accepts, the best first
Move = Callable[[FittedHypothesis], Iterator[FittedHypothesis]]


class Search:
    """Search the causes of a model's error, by the first move that the criterion accepts.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fits hypotheses.
    candidates : tuple of Effect
        The causes to think of.
    criterion : SelectionCriterion
        When a cause is named.
    max_causes : int
        Causes named at most.
    has_structure : callable
        Whether what a hypothesis leaves depends on anything that was recorded; where no cause was
        found, dear moves are tried only then.
    find_law : callable
        Called with the search where a cause leaves something; whether a formula alone leaves
        nothing, so that the search is over.
    given : frozenset of Effect, default=frozenset()
        Causes that the records show by themselves: any evidence for them will do.
    """

    def __init__(
        self,
        fitter: HypothesisFitter,
        candidates: tuple[Effect, ...],
        criterion: SelectionCriterion,
        max_causes: int,
        has_structure: Callable[[FittedHypothesis], bool],
        find_law: Callable[["Search"], bool],
        given: frozenset[Effect] = frozenset(),
    ):
        self.fitter, self.criterion, self.max_causes = fitter, criterion, max_causes
        self.same = same_causes(fitter.problem.prior, candidates)
        self.candidates = tuple(self.same)
        self.given = given & set(self.candidates)
        self.has_structure, self.find_law = has_structure, find_law
        self.progress = fitter.progress
        self.current = fitter.base()
        self._alone: dict[Effect, ShareLeft] = {}
        self._visited: dict[Key, float] = {}  # with what was left of each
        self._standing = self.current  # the best hypothesis of which every cause is named
        self._screening: Screening | None = None
        self._least = np.inf

    def run(self) -> SearchResult:
        """Find what is missing, or as much of it as the time allows.

        Returns
        -------
        SearchResult
            The accepted hypothesis and what may stand in its causes' places.
        """
        self.progress.counts = True
        with suppress(TimeIsUp):
            self._take_given()
            self._climb()
            while (simpler := self._simpler(self.current)) is not None:  # a finer fit may need less
                self.current = self._standing = simpler
                self._climb()
            self.current = self._pruned(self.current, self.criterion.to_name)
            return self._result(complete=True)
        return self.so_far()

    def so_far(self) -> SearchResult:
        """Return the best hypothesis so far of which every cause is named, if there is any."""
        self.progress.counts = False  # a result there must be
        self.current = self._without_needless(self.current)
        return self._result(complete=False)

    def judge_on(
        self,
        found: SearchResult,
        fitter: HypothesisFitter,
        has_structure: Callable[[FittedHypothesis], bool],
    ) -> SearchResult:
        """Fit what was found, and what may stand in its place, on other records.

        Parameters
        ----------
        found : SearchResult
            What was found.
        fitter : HypothesisFitter
            Fits hypotheses on these records.
        has_structure : callable
            As above, of these records.

        Returns
        -------
        SearchResult
            The causes that these records name; complete if all was, and the time suffices.
        """
        complete = self.progress.ended is None
        rivals = {other for others in found.rivals.values() for other, _ in others}
        likely = rivals.union(found.final.hypothesis.causes)
        self.candidates = tuple(cause for cause in self.same if cause in likely)
        self.progress.counts = False  # a result there must be
        self.progress.begin("all records")
        self.fitter, self.has_structure, self._screening = fitter, has_structure, None
        self.current = fitter.refit_elsewhere(found.final)
        self.progress.counts = True
        with suppress(TimeIsUp):
            if complete:
                self.current = self._without_needless(self.current)
            return replace(self._result(complete), alone=found.alone)
        return replace(self.so_far(), alone=found.alone)

    def in_steps_of(self, fitter: HypothesisFitter, found: SearchResult) -> SearchResult:
        """Fit what was found in other integration steps, or special cases that say the same there.

        What may stand in the place of the causes stays.
        """
        self.fitter, self._screening = fitter, None
        self.current = fitter.polish(fitter.refit(found.final))
        while (special := next(self._split(self.current), None)) is not None:
            self.current = fitter.polish(special)
        base = fitter.base()
        steps = in_order(fitter, base, self.current)
        rivals = {cause: found.rivals.get(cause, []) for cause in _causes(self.current)}
        return replace(found, base=base, steps=steps, rivals=rivals)

    def _climb(self) -> None:
        """Go from hypothesis to hypothesis until no move is accepted, or a formula says it all."""
        while (better := self._next(self.current)) is not None:
            self.current = self._begin_anew(better)
            if self.find_law(self):
                break
        else:
            self.current = self._standing  # what moves led to may not stand itself
        self.current = self.fitter.polish(self.current)

    def _simpler(self, current: FittedHypothesis) -> FittedHypothesis | None:
        """Return what says the same simpler, or without a cause that is not needed."""
        fewer = self._drop(current)
        moves = (self._replace, self._split) if current.hypothesis.causes else ()
        return self._first_of(moves, current) if fewer is None else fewer

    def _next(self, current: FittedHypothesis) -> FittedHypothesis | None:
        """Return what the cheapest move leads to that the criterion accepts."""
        self._visited[self.fitter.key(current.hypothesis)] = current.fit.objective
        fewer = self._drop(current)
        if fewer is not None and self._is_new(fewer):
            return fewer
        if fewer is None and not self.refutes(self._standing, current):
            self._standing = current
        return self._first_of(self._moves(current), current, goes_aside=True)

    def _first_of(
        self, moves: Iterable[Move], current: FittedHypothesis, goes_aside: bool = False
    ) -> FittedHypothesis | None:
        """Return what stands of the first accepted move's hypothesis, if it is new and better.

        Where none is, what is better beside a disturbance only may be a way on.
        """
        aside = None
        for better in (better for move in moves for better in move(current)):
            if not self._is_new(better):
                continue
            pruned = self._pruned(better, needed=0.0)
            if pruned is better or (self._is_new(pruned) and self.evidence(current, pruned) > 0.0):
                return pruned
            if goes_aside and aside is None and self._is_new(pruned):
                aside = pruned if self._evidence_disturbed(current, pruned) > 0.0 else None
        return aside

    def _is_new(self, trial: FittedHypothesis) -> bool:
        """Return whether no moves have gone on from a hypothesis, or from a fit that got stuck."""
        known = self._visited.get(self.fitter.key(trial.hypothesis), np.inf)
        return is_clearly_less(trial.fit.objective, known)

    def _moves(self, current: FittedHypothesis) -> Iterator[Move]:
        """Yield the moves, the cheap ones first."""
        count = len(current.hypothesis.causes)
        room = self.max_causes - count if self.is_nameable(current) else 0
        if count > 1:
            yield self._replace  # what was found alone may have stood for more
        if room >= 1:
            yield self._add
        if count == 1:
            yield self._replace
        if count:
            yield self._split
        if room >= 1 and (self.has_structure(current) or self.leaves_much(current)):
            yield self._add_patiently
            if room >= 2:
                yield self._add_pair
            if count:
                yield self._replace_by_pair

    def is_nameable(self, trial: FittedHypothesis) -> bool:
        """Return whether more than white noise is left, by the smallest share worth a name.

        It is asked over windows, and in free run where that says anything.
        """
        found = self.fitter.held_out(trial)
        in_free_run = found.tells & self._coloured(trial, found.free_run)
        return bool(in_free_run.any()) or self._is_coloured(trial)

    def _is_coloured(self, trial: FittedHypothesis) -> bool:
        """Return whether more than white noise is left over windows."""
        return bool(self._coloured(trial, self.fitter.held_out(trial).windows).any())

    def _coloured(self, trial: FittedHypothesis, left: Residuals) -> np.ndarray:
        """Return of which outputs more than white noise is left, by the smallest share."""
        beyond = left.squares - self.fitter.white_squares(trial)
        return beyond > self.criterion.smallest_share * left.squares

    def leaves_much(self, trial: FittedHypothesis) -> bool:
        """Return whether far more than white noise is left of some output."""
        left, white = self.fitter.held_out(trial).windows, self.fitter.white_squares(trial)
        return bool((left.squares > MUCH**2 * white).any())

    def stands_in_free_run(self, trial: FittedHypothesis) -> bool:
        """Return whether the free run, where it says anything, does not speak against it."""
        retuned, found = map(self.fitter.held_out, (self.fitter.base(), trial))
        return self.criterion.stands_in_free_run(retuned, found)

    # -- moves ---------------------------------------------------------------------------------

    def _pruned(self, trial: FittedHypothesis, needed: float) -> FittedHypothesis:
        """Drop what has too little evidence beside a disturbance, and what has no name then."""
        while (fewer := self._drop_disturbed(trial, needed)) is not None:
            trial = self._without_needless(fewer)
        return trial

    def _without_needless(self, trial: FittedHypothesis) -> FittedHypothesis:
        """Drop causes until each has a name beside the others."""
        while (fewer := self._drop(trial)) is not None:
            trial = fewer
        return trial

    def _drop_disturbed(self, current: FittedHypothesis, needed: float) -> FittedHypothesis | None:
        """Drop the cause that is needed least beside a disturbance, if more than noise is left."""
        if not self._is_coloured(current):
            return None
        return self._drop(current, partial(self._stands_disturbed, needed))

    def _drop(self, current: FittedHypothesis, is_named=None) -> FittedHypothesis | None:
        """Drop the cause that is needed least, unless the others leave it a name."""
        is_named = self._names if is_named is None else is_named
        if not current.hypothesis.causes:
            return None
        self.progress.begin("needless causes", len(current.hypothesis.causes))
        ground = self.fitter.subsample(current)
        reduced = [self.fitter.reduce(ground, cause) for cause in _causes(current)]
        for subsample in sorted(_usable(reduced), key=objective_of)[:KEPT]:
            without = self.fitter.fit_all(subsample, current)
            if without.fit.usable and not is_named(without, current):
                return without
        return None

    def _add(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Add the best candidate: the more promising half is fitted, the better half of it on."""
        fits = self._first_fits(current, self._promising(self.fitter.subsample(current)))
        yield from self._choose(current, self._converge(current, fits[: -(-len(fits) // 2)]))

    def _add_patiently(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Add the best candidate, every first fit being followed to its end."""
        fits = self._first_fits(current, self.candidates)
        yield from self._choose(current, self._converge(current, fits))

    def _add_pair(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Add the best of the pairs that are expected to explain most together."""
        self.progress.begin("pairs", 2 * PAIRS)
        ground, fits = self.fitter.subsample(current), []
        ranked = self._screen().rank(ground, 2)
        allowed = [pair for _, pair in ranked if ground.hypothesis.plus(pair[0]).allows(pair[1])]
        for pair in allowed[:PAIRS]:
            alone = _usable([self.fitter.first_fit(ground, cause) for cause in pair])
            if len(alone) == 2:
                other = alone[1].hypothesis.causes[-1]
                fits.append(self._step(self.fitter.first_fit(alone[0], other)))
        yield from self._choose(current, self._converge(current, _usable(fits)), n_causes=2)

    def _replace_by_pair(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Put the best of the promising pairs in a cause's place where that refutes the cause."""
        ground = self.fitter.subsample(current)
        for cause in _causes(current):
            without = self.fitter.fit_all(self.fitter.reduce(ground, cause), current)
            pairs = self._add_pair(without) if without.fit.usable else ()
            yield from (pair for pair in pairs if self.refutes(pair, current))

    def _replace(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Put another candidate in a cause's place where that refutes it, or says it simpler.

        Beside a candidate that says the same another cause may be needless.
        """
        for cause in current.hypothesis.causes:
            for other in self.in_place(current, cause):
                if other.hypothesis.complexity < current.hypothesis.complexity:
                    other = self.fitter.retry(other, current)  # its own fit may have got stuck
                if self._is_preferred(other, current) and self._is_needed(other, current):
                    yield other
                    return
                simpler = None if self.refutes(current, other) else self._drop(other)
                if simpler is None or self.refutes(current, simpler):
                    continue
                if self._is_needed(simpler, current):
                    yield simpler
                    return

    def _is_needed(self, other: FittedHypothesis, current: FittedHypothesis) -> bool:
        """Return whether a hypothesis has a cause that another one has not, and it is named."""
        own = _own(current, other)
        if not own:
            return False
        (new,) = own
        reduced = self.fitter.reduce(self.fitter.subsample(other), new)
        without = self.fitter.fit_all(reduced, other)
        return not without.fit.usable or self._names(without, other)

    def _split(self, current: FittedHypothesis) -> Iterator[FittedHypothesis]:
        """Put a cause's special cases in its place where that says the same simpler."""
        ground = self.fitter.subsample(current)
        apart = [a for c in current.hypothesis.causes for a in self._apart(ground, c)]
        fewer = [
            a for a in _usable(apart) if a.hypothesis.n_parameters < current.hypothesis.n_parameters
        ]
        for subsample in sorted(fewer, key=lambda a: a.hypothesis.n_parameters):
            split = self.fitter.fit_all(subsample, current)
            if split.fit.usable and self._is_preferred(split, current):
                yield split

    def _take_given(self) -> None:
        """Begin with the causes that the records show by themselves."""
        for cause in self.candidates:
            if cause in self.given:
                first = self.fitter.first_fit(self.fitter.subsample(self.current), cause)
                further = self.fitter.fit_all(self.fitter.converge(first), self.current)
                self.current = further if further.fit.usable else self.current

    def _begin_anew(self, current: FittedHypothesis) -> FittedHypothesis:
        """Fit earlier causes from their starts again: they may have stood for the last one too."""
        earlier = current.hypothesis.causes[:-1]
        if not earlier:
            return current
        ground = self.fitter.subsample(current)
        for cause in earlier:
            ground = self.fitter.restart(ground, cause)
        again = self.fitter.fit_all(ground, current)
        return again if again.fit.objective < current.fit.objective else current

    # -- the ladder ----------------------------------------------------------------------------

    def _promising(self, ground: SubsampleFit) -> tuple[Effect, ...]:
        """Return the half of the candidates that are expected to leave least; all of them alone.

        Those of which nothing is expected, since they could not be fitted alone, go on as well.
        """
        if not ground.hypothesis.causes:
            return self.candidates
        screening = self._screen()
        ranked = [cause for _, (cause,) in screening.rank(ground)]
        unknown = set(self.candidates) - screening.known
        return (*ranked[: -(-len(ranked) // 2)], *(c for c in self.candidates if c in unknown))

    def _screen(self) -> Screening:
        """Return what the candidates change, as their first fits alone tell."""
        if self._screening is None:
            self._screening = Screening.of(self.fitter, self.candidates)
            base = self.fitter.subsample(self.fitter.base())
            self._note_alone(base, [self.fitter.first_fit(base, c) for c in self.candidates])
        return self._screening

    def _first_fits(self, current: FittedHypothesis, candidates) -> list[SubsampleFit]:
        """Fit candidates beside the causes on some samples for some steps, nearest first."""
        allowed = [c for c in candidates if current.hypothesis.allows(c)]
        self.progress.begin(f"cause {len(current.hypothesis.causes) + 1}", 2 * len(allowed))
        ground = self.fitter.subsample(current)
        fits = []
        for cause in allowed:
            fits.append(self.fitter.first_fit(ground, cause))
            if not current.hypothesis.causes:
                self._note_alone(ground, fits[-1:])
            self._step(fits[-1])
        return _usable(fits)

    def _converge(self, current, fits: list[SubsampleFit]) -> list[SubsampleFit]:
        """Follow fits to their end, or until the best one refutes them; nearest first."""
        best, found = np.inf, []
        for fit in fits:
            found.append(self._step(self.fitter.converge(fit, self._limit(current, best))))
            best = min(best, found[-1].squares)
        if not current.hypothesis.causes:
            self._note_alone(self.fitter.subsample(current), found)
        return _usable(found)

    def _limit(self, trial: FittedHypothesis, squares: float) -> float:
        """Return the squares on some samples above which no evidence can come into reach."""
        rough, windows = self.fitter.rough, self.fitter.problem.windows
        times = np.maximum(self.fitter.held_out(trial).windows.times / rough.factor, 1.0)
        count = float(rough.windows.lengths.sum() * windows.y.shape[1] / times.max())
        reach = self.criterion.to_refute + self.criterion.to_name
        return squares * float(np.exp(min(2.0 * reach / count, 10.0)))

    def _choose(self, current, fits: list[SubsampleFit], n_causes=1) -> Iterator[FittedHypothesis]:
        """Yield the finalists that are named, first the simplest of those that none refutes."""
        trials = [self.fitter.fit_all(fit, current) for fit in fits[:KEPT]]
        while trials := [trial for trial in trials if trial.fit.usable]:
            best = self._simplest_of_the_best(trials)
            if self._names(self.fitter.retry(current, best), best, n_causes):
                yield best
            trials.remove(best)

    def _simplest_of_the_best(self, trials: list[FittedHypothesis]) -> FittedHypothesis:
        """Return the hypothesis with the fewest parameters among those that the best leaves."""
        best = trials[0]
        for trial in trials[1:]:
            if self.evidence(best, trial) > 0.0:
                best = trial
        left = [trial for trial in trials if not self.refutes(best, trial)]
        return min(
            left, key=lambda trial: (*trial.hypothesis.complexity, -self.evidence(best, trial))
        )

    def in_place(self, current, cause: Effect) -> list[FittedHypothesis]:
        """Return what may stand in a cause's place, fitted on all windows."""
        without = self.fitter.reduce(self.fitter.subsample(current), cause)
        likely = self._promising(without)
        others = [c for c in likely if c != cause and without.hypothesis.allows(c)]
        self.progress.begin("other causes", 2 * len(others))
        fits = _usable([self._step(self.fitter.first_fit(without, other)) for other in others])
        limit = self._limit(current, self.fitter.subsample(current).squares)
        near = [self._step(self.fitter.converge(fit, limit)) for fit in fits]
        known = self.fitter.is_known
        near = [f for f in _usable(near) if f.squares <= limit or known(f.hypothesis)]
        trials = [self.fitter.fit_all(fit, current) for fit in near[: 2 * KEPT]]
        return [trial for trial in trials if trial.fit.usable]

    def _apart(self, ground: SubsampleFit, cause: Effect) -> list[SubsampleFit]:
        """Fit a cause beside a part of it, and its special cases without it."""
        others = [c for c in self.candidates if c not in ground.hypothesis.causes]
        kin = [c for c in others if c.target == cause.target]
        found = [self.fitter.split(ground, cause, c) for c in kin if c.id in cause.shared]
        held = self.fitter.held(cause)
        special = [c for c in kin if c.id in cause.generalises]
        special += [c for c in others if isinstance(c, WrongParameter) and c.target in held]
        for count in range(1, len(special) + 1):
            for parts in combinations(special, count):
                found.append(self.fitter.exchange(ground, cause, list(parts)))
        return found

    # -- the criterion -------------------------------------------------------------------------

    def evidence(self, without: FittedHypothesis, with_: FittedHypothesis) -> float:
        """Return the evidence for the second of two hypotheses over the first.

        It counts less where residuals are larger along the causes that only the second one has.
        """
        held_out = self.fitter.held_out
        evidence = self.criterion.evidence(held_out(without), held_out(with_))
        return evidence / self._overdispersion(without, with_)

    def refutes(self, better: FittedHypothesis, worse: FittedHypothesis) -> bool:
        """Return whether the second of two hypotheses is refuted by the first.

        One that takes more to say pays for the candidates it was chosen from.
        """
        more, less = better.hypothesis.complexity, worse.hypothesis.complexity
        needed = self.criterion.to_name if more > less else self.criterion.to_refute
        return self._exceeds(worse, better, needed)

    def _exceeds(self, without: FittedHypothesis, with_: FittedHypothesis, needed: float) -> bool:
        """Return whether the evidence exceeds a number; the overdispersion only lessens it."""
        raw = self.criterion.evidence(*map(self.fitter.held_out, (without, with_)))
        return raw > needed and raw / self._overdispersion(without, with_) > needed

    def _overdispersion(self, without: FittedHypothesis, with_: FittedHypothesis) -> float:
        left = self.fitter.held_out(with_).windows
        if not np.isfinite(left.squares).all():
            return 1.0
        return overdispersion_along(self.fitter.problem, with_, _own(without, with_), left)

    def _names(self, without, with_, n_causes=1) -> bool:
        trials = without, with_, self.fitter.base()
        before, after, retuned = (self.fitter.held_out(trial) for trial in trials)
        causes, raw = _own(without, with_), self.criterion.evidence(before, after)
        if causes and causes <= self.given:
            return raw > 0.0
        if raw <= n_causes * self.criterion.to_name:
            return False
        less = self._overdispersion(without, with_)
        return self.criterion.names(before, after, n_causes, less, retuned)

    def _stands_disturbed(self, needed: float, without, with_) -> bool:
        """Return whether the evidence for a cause beside a disturbance exceeds a number."""
        if _own(without, with_) <= self.given:
            return True
        return self._evidence_disturbed(without, with_) > needed

    def _evidence_disturbed(self, without: FittedHypothesis, with_: FittedHypothesis) -> float:
        """Return the evidence for the second of two hypotheses beside disturbances."""
        share = self.criterion.smallest_share
        return self.fitter.evidence_disturbed(without, with_, share)

    def _is_preferred(self, other: FittedHypothesis, current: FittedHypothesis) -> bool:
        """Return whether a hypothesis refutes another one, or is simpler and not refuted."""
        if self.refutes(other, current):
            return True
        simpler = other.hypothesis.complexity < current.hypothesis.complexity
        return simpler and not self.refutes(current, other)

    # -- result --------------------------------------------------------------------------------

    def _step(self, fit: SubsampleFit) -> SubsampleFit:
        self._tell_best(fit)
        self.progress.step()
        return fit

    def _tell_best(self, fit: SubsampleFit) -> None:
        """Note a fit that leaves clearly less than any before, in units of the noise."""
        left = fit.times_noise
        if left < BETTER * self._least:
            self._least = left
            names = " and ".join(cause.title(cause.target) for cause in _causes(fit))
            self.progress.note(f"{left:.2f} times the noise left with {names}")

    def _note_alone(self, ground: SubsampleFit, fits: list[SubsampleFit]) -> None:
        """Note the share of the squares that every candidate leaves alone."""
        for fit in fits:
            if fit.fit.usable and ground.fit.usable:
                cause = fit.hypothesis.causes[-1]
                for same in (cause, *self.same[cause]):
                    left = share_left(*(each.fit.evaluation.squares for each in (ground, fit)))
                    self._alone[same] = min(left, self._alone.get(same, left))

    def _result(self, complete: bool) -> SearchResult:
        base, final = self.fitter.base(), self.current
        steps = in_order(self.fitter, base, final)
        rivals = {cause: [(same, 0.0) for same in self.same[cause]] for cause in _causes(final)}
        beside = {}
        if complete:
            for cause in _causes(final):
                rivals[cause] += find_rivals(self, final, cause)
                beside[cause] = self._evidence_beside(final, cause)
        return SearchResult(base, steps, rivals, beside, dict(self._alone), complete)

    def _evidence_beside(self, final: FittedHypothesis, cause: Effect) -> float:
        """Return the evidence for a cause beside the others, and beside a disturbance if need be.

        Long records have answered for disturbances on the stretches that were searched.
        """
        reduced = self.fitter.reduce(self.fitter.subsample(final), cause)
        without = self.fitter.fit_all(reduced, final)
        if cause in self.given or not without.fit.usable:
            return np.inf
        evidence = self.evidence(without, final)
        if is_long(self.fitter.problem) or not self._is_coloured(final):
            return evidence
        return min(evidence, self._evidence_disturbed(without, final))


def _causes(trial: FittedHypothesis) -> tuple[Effect, ...]:
    return trial.hypothesis.causes


def _own(without: FittedHypothesis, with_: FittedHypothesis) -> set[Effect]:
    """Return the causes that only the second of two hypotheses has."""
    return set(_causes(with_)) - set(_causes(without))


def _usable(fits: list[SubsampleFit]) -> list[SubsampleFit]:
    """Return the fits that could be made, the nearest first."""
    return sorted((fit for fit in fits if fit.fit.usable), key=objective_of)
