"""Decide whether the catalogue's causes suffice, or a formula explains more."""

from dataclasses import replace

from sklearn_pgnn.diagnosis.comparison import Comparison
from sklearn_pgnn.diagnosis.search import Search
from sklearn_pgnn.diagnosis.search_result import SearchResult
from sklearn_pgnn.diagnosis.unexplained import (
    Proposal,
    library_size,
    propose,
    propose_again,
    tells_time,
)
from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.criterion import SelectionCriterion, explained_share
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.estimation.likely_places import likely_places
from sklearn_pgnn.estimation.same_in_equations import same_causes
from sklearn_pgnn.physics.effects import FURTHER
from sklearn_pgnn.physics.places import places_of
from sklearn_pgnn.simulation.window_fit import WindowFit


class FormulaSelection:
    """Look for a formula where the catalogue's causes leave something."""

    def __init__(self) -> None:
        self._known: dict[Key, tuple[WindowFit, Proposal | None]] = {}

    def is_law(self, search: Search) -> bool:
        """Return whether a formula with no more parameters leaves noise where causes leave more.

        A formula that is only a sum of candidates does not count: the search finds those.
        """
        if not search.compare.is_nameable(search.current):
            return False
        alone = self._alone(search)
        if (
            alone is None
            or alone.trial.hypothesis.n_parameters > search.current.hypothesis.n_parameters
        ):
            return False
        return not (search.compare.is_nameable(alone.trial) or _has_names(search, alone))

    def choose(
        self, search: Search, result: SearchResult, has_structure: bool
    ) -> tuple[SearchResult, Proposal | None]:
        """Return the part of a search's result that is kept, and the accepted formula.

        A formula for what the re-tuned prior lacks replaces the causes if it leaves no structure,
        and either refutes them or explains the same with fewer parameters and no more terms than
        there are causes, while no subset of the causes does; a formula for what the causes leave
        is added to them.
        """
        final, causes = result.final, result.final.hypothesis.causes
        if not (causes or has_structure):
            return result, None
        asked = has_structure or search.compare.leaves_much(final) or self.is_law(search)
        asked = asked or any(type(cause) in FURTHER for cause in causes)  # they imitate laws
        if len(causes) > 1 or asked:
            alone = self._alone(search)
            if alone and (not causes or _takes_the_place(search, alone, result.steps)):
                return replace(result, steps=[], rivals={}), alone
        if causes and has_structure:
            return result, self._best(search, final)
        return result, None

    @staticmethod
    def on_other_records(
        search: Search, ground: FittedHypothesis, proposal: Proposal
    ) -> Proposal | None:
        """Return a formula re-fitted on other records, or None where they do not name it."""
        fitter = search.fitter
        fitter.progress.begin("formula")
        again = propose_again(fitter.problem, ground, proposal, fitter.progress.tick)
        return again if again is not None and _is_named(search, ground, again) else None

    def _alone(self, search: Search) -> Proposal | None:
        """Return the best formula for what the re-tuned prior lacks."""
        return self._best(search, search.fitter.base())

    def _best(self, search: Search, ground: FittedHypothesis) -> Proposal | None:
        key = search.fitter.key(ground.hypothesis)
        if key not in self._known or self._known[key][0] is not ground.fit:
            self._known[key] = ground.fit, _best_formula(search, ground)
        return self._known[key][1]


def _best_formula(search: Search, ground: FittedHypothesis) -> Proposal | None:
    """Return the formula with the most evidence net of the price of its terms, if it is named."""
    problem, progress, found = search.fitter.problem, search.fitter.progress, []
    places = places_of(problem.prior)
    likely = likely_places(problem, ground, places)
    progress.begin("formula", len(likely))
    timed = not tells_time(problem, ground)
    for channel in likely:
        with search.fitter.failures.tolerate((ground.hypothesis, channel), "formula", channel):
            found += propose(problem, ground, channel, progress.tick, timed)
        progress.step()
    if not found:
        return None
    criterion, held_out = _with_library(search, len(places)), search.fitter.held_out

    def score(proposal: Proposal) -> float:
        """Return the evidence for a formula less the price of its terms."""
        evidence = criterion.evidence(held_out(ground), held_out(proposal.trial))
        return evidence - len(proposal.effect.terms) * criterion.to_name

    best = max(found, key=score)
    return best if _is_named(search, ground, best) else None


def _has_names(search: Search, proposal: Proposal) -> bool:
    """Return whether every term of a formula is the same as some candidate."""
    formula = proposal.effect
    terms = [replace(formula, terms=(term,), coefficients=(1.0,)) for term in formula.terms]
    known = same_causes(search.fitter.problem.prior, (*search.ladder.candidates, *terms))
    return not any(term in known for term in terms)


def _is_named(search: Search, ground: FittedHypothesis, proposal: Proposal) -> bool:
    """Return whether a formula's terms meet the rule, with the whole library as candidates."""
    criterion = _with_library(search, len(places_of(search.fitter.problem.prior)))
    compare = Comparison(search.fitter, criterion)
    return compare.names(ground, proposal.trial, len(proposal.effect.terms))


def _with_library(search: Search, n_places: int) -> SelectionCriterion:
    """Return the criterion with the library's terms at every place as candidates."""
    terms = library_size(search.fitter.problem.prior)
    return replace(search.criterion, n_candidates=n_places * terms)


def _takes_the_place(search: Search, formula: Proposal, steps: list[FittedHypothesis]) -> bool:
    """Return whether a formula explains all, and as much more simply or clearly more.

    The causes are given as hypotheses to which they are added one by one. A formula that leaves
    structure, or much, and not far less than they do, does not replace them: named causes are
    easier to read. Nor is it simpler if some of the causes explain as much with no more parameters.
    Each of its terms is chosen from a library, as a cause is from the catalogue.
    """
    trial, final = formula.trial, steps[-1]
    if search.compare.refutes(final, trial):
        return False
    left, less = (search.fitter.held_out(each).windows for each in (final, trial))
    explained = explained_share(left, less)
    compare = search.compare
    if explained < 1.0 - 1.0 / MUCH**2 and (
        compare.leaves_much(trial) or (compare.is_nameable(trial) and search.has_structure(trial))
    ):
        return False
    n_terms, count = len(formula.effect.terms), trial.hypothesis.n_parameters
    if count < final.hypothesis.n_parameters and n_terms <= len(final.hypothesis.causes):
        as_simple = (step for step in steps if step.hypothesis.n_parameters <= count)
        if all(search.compare.refutes(trial, step) for step in as_simple):
            return True
    more = explained >= search.criterion.smallest_share
    return more and search.compare.refutes(trial, final)
