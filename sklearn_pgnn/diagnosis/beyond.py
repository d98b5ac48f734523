"""Decide whether the catalogue's causes will do, or a formula says it better."""

from dataclasses import replace

from sklearn_pgnn.diagnosis.search import Outcome, Search
from sklearn_pgnn.diagnosis.unexplained import (
    MissingPart,
    Proposal,
    channels,
    describe,
    is_known,
    propose,
)
from sklearn_pgnn.estimation.fitting import Trial
from sklearn_pgnn.simulation.window_fit import WindowFit

#: what a formula may leave above the noise, as a share of what the best single cause leaves, to be
#: taken for the law itself: one that leaves more is no better than names
LEFT = 0.1


class Beyond:
    """Look for what the catalogue does not know, where its causes leave something or are many.

    Attributes
    ----------
    fit : WindowFit or None
        The fit of the formula that was accepted.
    """

    def __init__(self):
        self.fit: WindowFit | None = None
        self._ground: WindowFit | None = None
        self._alone: Proposal | None = None

    def is_enough(self, search: Search, current: Trial) -> bool:
        """Tell whether a formula alone leaves only noise, with fewer numbers than more causes.

        Parameters
        ----------
        search : Search
            The search.
        current : Trial
            Causes that leave more.

        Returns
        -------
        bool
            Whether further causes are needless.
        """
        alone = self._of_the_prior(search)
        if alone is None or alone.n_parameters > len(current.hypothesis.causes):
            return False
        return search.judge.is_at_noise(alone.trial)

    def judge(self, search: Search, outcome: Outcome) -> tuple[Outcome, MissingPart | None]:
        """Say what is still believed of an outcome, and what has no name.

        A formula for what the re-tuned prior lacks takes the place of the causes if it leaves
        little, and explains more than they or as much with fewer parameters. A formula for what
        they leave stands beside them.

        Parameters
        ----------
        search : Search
            The search.
        outcome : Outcome
            What it found.

        Returns
        -------
        outcome : Outcome
            What is still believed of it.
        part : MissingPart or None
            What has no name.
        """
        final, problem = outcome.final, search.fitter.problem
        enough = search.judge.is_at_noise(final)
        if not search.suspects or (enough and len(outcome.steps) < 2):
            return outcome, None
        alone = self._of_the_prior(search)
        if alone is not None and outcome.steps and _says_more(search, alone, outcome):
            self.fit = alone.trial.fit
            return replace(outcome, steps=[], alternatives={}), describe(problem, alone)
        if enough:
            return outcome, None
        beside = _best(search, final) if outcome.steps else alone
        if beside is not None and _matters(search, outcome, beside):
            self.fit = beside.trial.fit
            return outcome, describe(problem, beside)
        return outcome, None

    def _of_the_prior(self, search: Search) -> Proposal | None:
        """Give the best formula for what the re-tuned prior lacks, unless it is a known law."""
        base = search.fitter.base()
        if self._ground is not base.fit:
            best = _best(search, base)
            known = best is not None and is_known(search.fitter.problem.prior, best.effect)
            self._ground, self._alone = base.fit, None if known else best
        return self._alone


def _best(search: Search, ground: Trial) -> Proposal | None:
    """Give the formula with the fewest terms among those as good as the best, of all channels."""
    problem, progress, found = search.fitter.problem, search.fitter.progress, []
    places = channels(problem.prior)
    progress.begin("formula", len(places))
    for channel in places:
        with search.fitter.ledger.spare((ground.hypothesis, channel), "formula", channel):
            found += propose(problem, ground, channel, progress.tick)
        progress.step()
    if not found:
        return None
    best = min(found, key=lambda p: p.trial.squares)
    equal = [p for p in found if search.judge.as_good(best.trial, p.trial)]
    return min(equal, key=lambda p: (p.n_parameters, p.trial.squares))


def _says_more(search: Search, alone: Proposal, outcome: Outcome) -> bool:
    """Tell whether a formula is the law, and says more than the causes or takes fewer numbers."""
    final = outcome.final
    if not (_is_law(search, alone.trial, outcome) and search.judge.as_good(final, alone.trial)):
        return False
    fewer = alone.n_parameters < final.hypothesis.n_parameters
    return fewer or not search.judge.as_good(alone.trial, final)


def _is_law(search: Search, formula: Trial, outcome: Outcome) -> bool:
    """Tell whether a formula leaves noise, or hardly any of what the best single cause leaves."""
    best = min(outcome.tried.values(), default=1.0) * outcome.base.squares
    hardly = search.judge.excess(formula) <= LEFT * max(best - search.judge.floor, 0.0)
    return hardly or search.judge.is_at_noise(formula)


def _matters(search: Search, outcome: Outcome, beside: Proposal) -> bool:
    """Tell whether a formula explains a part of all that the prior lacks, and not by chance."""
    gain = search.judge.excess(outcome.final) - search.judge.excess(beside.trial)
    large = gain > search.judge.rules.share * search.judge.excess(outcome.base)
    new = large and not search.judge.as_good(beside.trial, outcome.final)
    return new and search.judge.is_gain(outcome.final, beside.trial)
