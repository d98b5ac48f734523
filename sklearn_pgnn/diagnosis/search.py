"""Stepwise search for missing causes: moves from hypothesis to hypothesis, the cheap ones first."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from sklearn_pgnn.diagnosis.comparison import Comparison, own_causes
from sklearn_pgnn.diagnosis.ladder import Ladder
from sklearn_pgnn.diagnosis.moves import Moves
from sklearn_pgnn.diagnosis.outside import probability_outside
from sklearn_pgnn.diagnosis.rivals import InPlace, find_rivals, likelier, not_refuted
from sklearn_pgnn.diagnosis.search_result import SearchResult, in_order
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis, is_clearly_less
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.estimation.progress import AFTER_TESTS
from sklearn_pgnn.estimation.same_in_equations import same_causes
from sklearn_pgnn.estimation.shared_part import in_terms_of_the_model
from sklearn_pgnn.estimation.stretches import is_long
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import FURTHER, frequent_first
from sklearn_pgnn.record_quality.wiring import Rewired

#: yields the hypotheses reached by a move that the criterion accepts, the best first
Move = Callable[[FittedHypothesis], Iterator[FittedHypothesis]]


class Search:
    """Search for the causes of a model's error; each step takes the first accepted move.

    `has_structure` returns whether the residuals of a hypothesis depend on anything that was
    recorded; where no cause was found, costly moves are tried only then. `find_law` is called with
    the search where a cause leaves something, and returns whether a formula alone leaves nothing,
    so that the search is over. `given` are causes that the records show by themselves: any positive
    evidence for them is enough. `wiring` has signs, exchanges and units that the records show, each
    as good as the first.
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
        wiring: Rewired | None = None,
    ):
        self.criterion, self.max_causes = criterion, max_causes
        self.has_structure, self.find_law = has_structure, find_law
        self.progress = fitter.progress
        wirings = () if wiring is None else wiring.wirings
        candidates, self.wiring = (*wirings, *candidates), wiring
        self.same = same_causes(fitter.problem.prior, candidates, self.progress.tick)
        self.given = (given | set(wirings[:1])) & set(self.same)
        self._use(fitter, tuple(c for c in frequent_first(self.same) if type(c) not in FURTHER))
        self.current = fitter.base()
        self._visited: dict[Key, float] = {}  # with what was left of each
        self._standing = self.current  # the best hypothesis of which every cause is named
        self._needed = 0.0

    def _use(self, fitter: HypothesisFitter, candidates: tuple[Effect, ...]) -> None:
        """Use a fitter and some candidates for the following moves."""
        self.fitter = fitter
        self.compare = Comparison(fitter, self.criterion, self.given)
        self.ladder = Ladder(fitter, self.criterion, candidates, self.same)
        self.moves = Moves(self.compare, self.ladder)

    def run(self, begin: FittedHypothesis | None = None) -> SearchResult:
        """Find what is missing, or as much of it as the time allows."""
        self.progress.counts = True
        with self.progress.kept():
            if begin is None:
                self._take_given()
            else:
                self.ladder.screen()  # what every candidate leaves alone is told
                self.current = begin
            self._climb_and_prune()
            if len(self.ladder.candidates) < len(self.same):  # those that imitate simpler ones
                self.ladder.widen(frequent_first(self.same))
                self._climb_and_prune()
            return self._result(complete=True)
        return self.so_far()

    def _climb_and_prune(self) -> None:
        self._needed = 0.0  # evidence beside a disturbance: a disturbance stands for later causes
        self._climb_and_simplify()
        self._prune_and_climb()

    def so_far(self) -> SearchResult:
        """Return the best hypothesis so far, without needless causes as far as the time allows."""
        self.progress.counts = False  # a result there must be
        with self.progress.spare_time(AFTER_TESTS):
            if len(self.current.hypothesis.causes) < self.max_causes:  # the best that was begun
                self.current = next(self.moves.add_known(self.current), self.current)
        with self.progress.spare_time(AFTER_TESTS):
            self._drop_untenable()
        with self.progress.kept():
            lost = self.compare.runs_away(self.current)
            if lost or self.compare.refutes(self._standing, self.current):
                self.current = self._standing  # what moves led to may not stand itself
            return self._result(complete=False)
        self.current = self.fitter.base()
        return self._result(complete=False)

    def _drop_untenable(self) -> None:
        """Drop causes that are not named beside the others, given a disturbance where needed."""
        while (fewer := self.moves.drop(self.current)) is not None:
            self.current = fewer
        while (
            fewer := self.moves.drop_disturbed(self.current, self.criterion.to_name)
        ) is not None:
            self.current = self.moves.without_needless(fewer)

    def judge_on(
        self,
        found: SearchResult,
        fitter: HypothesisFitter,
        has_structure: Callable[[FittedHypothesis], bool],
    ) -> SearchResult:
        """Fit the causes that were found, and their rivals, on other records."""
        complete = self.progress.ended is None
        rivals = {other for others in found.rivals.values() for other, _ in others}
        likely = rivals.union(found.final.hypothesis.causes)
        self.progress.counts = False  # a result there must be
        self.progress.begin("all records")
        self.has_structure = has_structure
        self._use(fitter, tuple(cause for cause in self.same if cause in likely))
        self.current = self._standing = fitter.refit_elsewhere(found.final)
        self.progress.counts = True
        with self.progress.kept():
            if complete:
                self.current = self.moves.without_needless(self.current)
                return replace(self._result(complete), alone=found.alone)
        return replace(self.so_far(), alone=found.alone)

    def in_steps_of(self, fitter: HypothesisFitter, found: SearchResult) -> SearchResult:
        """Fit the causes with other integration steps, or special cases that explain as much there.

        A cause that only compensated the integration error is dropped. The rivals of the others
        stay.
        """
        self._use(fitter, self.ladder.candidates)
        self.current = self.moves.without_needless(fitter.polish(fitter.refit(found.final)))
        while (special := next(self.moves.split(self.current), None)) is not None:
            self.current = fitter.polish(special)
        base = fitter.base()
        steps = in_order(fitter, base, in_terms_of_the_model(fitter, self.current))
        rivals = self._same_in_equations(self.current) | found.rivals
        rivals = {cause: rivals[cause] for cause in self.current.hypothesis.causes}
        return replace(found, base=base, steps=steps, rivals=rivals)

    def _climb_and_simplify(self) -> None:
        """Climb until nothing explains as much with fewer parameters: a finer fit may need less."""
        self._climb()
        while (simpler := self._simpler(self.current)) is not None:
            self.current = self._standing = simpler
            self._climb()

    def _prune_and_climb(self) -> None:
        """Drop causes that are not named given a disturbance, and search on from there."""
        self._needed, refused = self.criterion.to_name, {}
        while (pruned := self.moves.pruned(self.current, self._needed)) is not self.current:
            refused[self.fitter.key(self.current.hypothesis)] = self.current.fit.objective
            self._visited = dict(refused)
            self.current = self._standing = pruned
            self._climb_and_simplify()

    def _climb(self) -> None:
        """Go from hypothesis to hypothesis until no move is accepted, or a formula explains all."""
        while (better := self._next(self.current)) is not None:
            self.current = self.moves.begin_anew(better)
            if self.find_law(self):
                break
        else:
            self.current = self._standing  # what moves led to may not stand itself
        self.current = self.fitter.polish(self.current)

    def _simpler(self, current: FittedHypothesis) -> FittedHypothesis | None:
        """Return a hypothesis that explains as much with fewer parameters or fewer causes."""
        fewer = self.moves.drop(current)
        moves = (self.moves.replace, self.moves.split) if current.hypothesis.causes else ()
        return self._first_of(moves, current) if fewer is None else fewer

    def _next(self, current: FittedHypothesis) -> FittedHypothesis | None:
        """Return the hypothesis of the cheapest move that the criterion accepts."""
        self._visited[self.fitter.key(current.hypothesis)] = current.fit.objective
        fewer = self.moves.drop(current)
        if fewer is not None and self._is_new(fewer):
            return fewer
        if fewer is None and not self.compare.refutes(self._standing, current):
            self._standing = current
        return self._first_of(self._moves(current), current, goes_aside=True)

    def _first_of(
        self, moves: Iterable[Move], current: FittedHypothesis, goes_aside: bool = False
    ) -> FittedHypothesis | None:
        """Return the first accepted hypothesis after pruning, if it is new and better.

        If there is none, one that is better only given a disturbance may serve as the next step.
        """
        aside = None
        for better in (better for move in moves for better in move(current)):
            if not self._is_new(better):
                continue
            pruned = self.moves.pruned(better, self._needed)
            if pruned is better or (
                self._is_new(pruned) and self.compare.evidence(current, pruned) > 0.0
            ):
                return pruned
            if goes_aside and aside is None and self._is_new(pruned):
                aside = pruned if self.compare.evidence_disturbed(current, pruned) > 0.0 else None
        return aside

    def _is_new(self, trial: FittedHypothesis) -> bool:
        """Return whether a hypothesis was not visited yet, or only with a clearly worse fit."""
        known = self._visited.get(self.fitter.key(trial.hypothesis), np.inf)
        return is_clearly_less(trial.fit.objective, known)

    def _moves(self, current: FittedHypothesis) -> Iterator[Move]:
        """Yield the moves, the cheap ones first."""
        count = len(current.hypothesis.causes)
        room = self.max_causes - count if self.compare.is_nameable(current) else 0
        if count > 1:
            yield self.moves.replace  # what was found alone may have stood for more
        if room >= 1:
            yield self.moves.add
        if count == 1:
            yield self.moves.replace
        if count:
            yield self.moves.split
        if room >= 1 and self._is_worth_patience(current):
            yield self.moves.add_patiently
            if room >= 2:
                yield self.moves.add_pair
            if count:
                yield self.moves.replace_by_pair
        if self.ladder.has_few_sets(self.max_causes) and self._is_worth_patience(current):
            yield partial(self.moves.any_of_few_sets, most=self.max_causes)

    def _is_worth_patience(self, current: FittedHypothesis) -> bool:
        """Return whether what is left may depend on the records, so that costly moves are tried."""
        if self.compare.runs_away(current):
            return False
        return self.compare.leaves_much(current) or self.has_structure(current)  # cheap one first

    def _take_given(self) -> None:
        """Begin with the causes that the records show by themselves."""
        for cause in self.ladder.candidates:
            if cause in self.given:
                first = self.fitter.first_fit(self.fitter.subsample(self.current), cause)
                further = self.fitter.fit_all(self.fitter.converge(first), self.current)
                self.current = further if further.fit.usable else self.current

    def _result(self, complete: bool) -> SearchResult:
        base = self.fitter.base()
        if complete and self.fitter.predicts_nothing(self.current, self.criterion.smallest_share):
            self.current = base  # what tells no more than carrying on is no explanation
        near = self._put_the_likeliest_first() if complete else {}
        final = self.current
        steps = in_order(self.fitter, base, in_terms_of_the_model(self.fitter, final))
        rivals, beside, outside = self._same_in_equations(final), {}, {}
        for cause, others in near.items():
            beside[cause] = self._evidence_beside(final, cause)
            found = rivals[cause] + find_rivals(self.ladder, final, cause, others)
            rivals[cause] = self.criterion.probable(found, beside[cause])
            outside[cause] = self._outside(final, cause, rivals[cause], beside[cause])
        alone = dict(self.ladder.alone)
        return SearchResult(base, steps, rivals, beside, outside, alone, complete)

    def _put_the_likeliest_first(self) -> dict[Effect, InPlace]:
        """Exchange causes for likelier rivals that are named; return what may replace each.

        What the records show by itself stays. A cause that is improbable beside what cannot be
        named in its place is dropped.
        """
        tried: set[Key] = set()
        while True:
            final, search = self.current, (self.compare, self.ladder)
            causes = final.hypothesis.causes
            near = {cause: not_refuted(*search, final, cause) for cause in causes}
            open_ = [others for cause, others in near.items() if cause not in self.given]
            better = (trial for others in open_ for trial in likelier(self.fitter, final, others))
            named = (self._named_in_place(final, trial, tried) for trial in better)
            exchanged = next((trial for trial in named if trial is not None), None)
            exchanged = exchanged or self._without_the_improbable(final, near)
            if exchanged is None:
                return near
            self.current = exchanged

    def _without_the_improbable(
        self, final: FittedHypothesis, near: dict[Effect, InPlace]
    ) -> FittedHypothesis | None:
        """Return a hypothesis without the cause that is refuted most surely, if one is."""
        least = {cause: min((v for _, v in others), default=0.0) for cause, others in near.items()}
        cause = min(set(least) - self.given, key=least.__getitem__, default=None)
        if cause is None or least[cause] >= -self.criterion.to_refute:
            return None
        without = self._reduced(final, cause)
        return self.moves.without_needless(without) if without.fit.usable else None

    def _named_in_place(
        self, final: FittedHypothesis, trial: FittedHypothesis, tried: set[Key]
    ) -> FittedHypothesis | None:
        """Return a hypothesis without needless causes, if its new one is named; each only once."""
        tried.add(self.fitter.key(final.hypothesis))
        if self.fitter.key(trial.hypothesis) in tried:
            return None
        tried.add(self.fitter.key(trial.hypothesis))
        kept = self.moves.without_needless(self.fitter.polish(trial))
        kept = self.moves.pruned(kept, self._needed)
        return kept if own_causes(final, kept) else None

    def _same_in_equations(self, final: FittedHypothesis) -> dict[Effect, list]:
        """Return for every cause the candidates that are equivalent in the equations."""
        causes = final.hypothesis.causes
        return {cause: [(same, 0.0) for same in self.same[cause]] for cause in causes}

    def _evidence_beside(self, final: FittedHypothesis, cause: Effect) -> float:
        """Return the evidence for a cause beside the others, given a disturbance where needed.

        For long records, disturbances were already considered on the stretches that were searched.
        """
        without = self._reduced(final, cause)
        if cause in self.given or not without.fit.usable:
            return np.inf
        evidence = self.compare.evidence(without, final)
        if is_long(self.fitter.problem) or not self.compare.is_coloured(final):
            return evidence
        return float(np.fmin(evidence, self.compare.evidence_disturbed(without, final)))

    def _outside(
        self,
        final: FittedHypothesis,
        cause: Effect,
        rivals: list[tuple[Effect, float]],
        over_none: float,
    ) -> float:
        """Return the probability that what acts in a cause's place is none of the catalogue."""
        others, values = [rival for rival, _ in rivals], [value for _, value in rivals]
        none = float(self.criterion.probabilities([*values, over_none])[-1])
        without = self._reduced(final, cause)
        if cause in self.given or not without.fit.usable:
            return none
        least = probability_outside(self.fitter, without, final, cause, others)
        return least + (1.0 - least) * none

    def _reduced(self, final: FittedHypothesis, cause: Effect) -> FittedHypothesis:
        """Return a hypothesis without one of its causes, fitted on all windows."""
        return self.fitter.fit_all(self.fitter.reduce(self.fitter.subsample(final), cause), final)
