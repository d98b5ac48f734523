"""Comparisons of fitted hypotheses: the criterion, applied to their held-out residuals."""

import numpy as np
from scipy.stats import chi2

from sklearn_pgnn.diagnosis.size import (
    differs_from_none,
    exceeds_rounding,
    leaves_something,
    only_begins,
    overdispersion_along,
    reads_noise_at_limits,
    says_more_than_bounds,
)
from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.wiring import Wiring


class Comparison:
    """Compare fitted hypotheses, whenever it is made; any evidence is enough for given causes."""

    def __init__(
        self,
        fitter: HypothesisFitter,
        criterion: SelectionCriterion,
        given: frozenset[Effect] = frozenset(),
    ):
        self.fitter, self.criterion, self.given = fitter, criterion, given

    # -- of two hypotheses -------------------------------------------------------------------------

    def evidence(self, without: FittedHypothesis, with_: FittedHypothesis) -> float:
        """Return the evidence for the second of two hypotheses over the first.

        It is divided by the overdispersion of the residuals along the causes that only the second
        one has.
        """
        held_out = self.fitter.held_out
        evidence = self.criterion.evidence(held_out(without), held_out(with_))
        return evidence / self._overdispersion(without, with_)

    def separation(self, one: FittedHypothesis, other: FittedHypothesis) -> float:
        """Return how surely the second of two rivals is likelier; the same with opposite sign.

        Nothing is said where the one that windows prefer has the worse free run beyond chance, or
        states that do not pay, see `free_states_pay`.
        """
        pairs = (one, other), (other, one)
        less = max(self._overdispersion(*pair) for pair in pairs)
        before, after = self.fitter.held_out(one), self.fitter.held_out(other)
        told = self.criterion.separation(before, after, less)
        likelier_last = pairs[told < 0.0]
        if told and (self.runs_worse(*likelier_last) or not self.free_states_pay(*likelier_last)):
            return 0.0
        return told

    def evidence_disturbed(self, without: FittedHypothesis, with_: FittedHypothesis) -> float:
        """Return the evidence for the second of two disturbed hypotheses; NaN for none."""
        share = self.criterion.smallest_share
        return self.fitter.evidence_disturbed(without, with_, share)

    def refutes(self, better: FittedHypothesis, worse: FittedHypothesis) -> bool:
        """Return whether the second of two hypotheses is refuted by the first.

        A more complex hypothesis must also pay for the number of candidates it was chosen from,
        explain at least the smallest share more, and fit better where both are fitted. No
        hypothesis refutes another one whose free run is better beyond chance; a hypothesis with
        more added states is refuted if its free run is worse. States that are free at the start of
        every window have to pay, see `free_states_pay`.
        """
        before, after = map(self.fitter.held_out, (worse, better))
        if before.n_added > after.n_added and self.criterion.runs_worse(after, before):
            return True
        takes_more = better.hypothesis.complexity > worse.hypothesis.complexity
        if takes_more and self._fits_as_well(worse, better):
            return False
        if not self.free_states_pay(worse, better):
            return False
        needed = self.criterion.to_name if takes_more else self.criterion.to_refute
        raw = self.criterion.evidence(before, after)
        if not raw > needed or (takes_more and not self.criterion.explains_enough(before, after)):
            return False
        if self.criterion.runs_worse(before, after):
            return False
        return raw / self._overdispersion(worse, better) > needed

    def _fits_as_well(self, simple: FittedHypothesis, complex_: FittedHypothesis) -> bool:
        """Return whether a simpler hypothesis fits all windows as well, but for chance.

        Held out, one sample at which a friction changes its sign too late can speak for numbers
        that are not there.
        """
        worse = simple.fit.objective - complex_.fit.objective
        dispersion = max(complex_.fit.objective / self.fitter.problem.n_samples, 1.0)
        return worse < 2.0 * dispersion * self.criterion.to_refute

    def is_preferred(self, other: FittedHypothesis, current: FittedHypothesis) -> bool:
        """Return whether a hypothesis refutes the current one, or is simpler or likelier.

        If it does not refute the current one, it must not be refuted by it; if the two are equally
        complex, it must have the evidence in its favour, and no worse free run.
        """
        if self.refutes(other, current):
            return True
        if self.refutes(current, other):
            return False
        simple, is_now = other.hypothesis.complexity, current.hypothesis.complexity
        if simple != is_now:
            return simple < is_now
        return self.evidence(current, other) > 0.0 and not self.runs_worse(current, other)

    def names(self, without: FittedHypothesis, with_: FittedHypothesis, n_causes: int = 1) -> bool:
        """Return whether the causes that only the second of two hypotheses has are named.

        Where the prior runs away from the records, less of a divergence is no explanation, even if
        no more than noise is left: loud noise hides all motion within a short window.
        """
        if self.fitter.runs_away(with_):
            return False
        trials = without, with_, self.fitter.base()
        before, after, retuned = (self.fitter.held_out(trial) for trial in trials)
        causes, raw = own_causes(without, with_), self.criterion.evidence(before, after)
        if causes and causes <= self.given:
            is_wire = any(isinstance(cause, Wiring) for cause in causes)
            if is_wire and not self.criterion.explains_enough(before, after):
                return False  # free parameters do as well
            return raw > 0.0 and self.criterion.stands_in_free_run(retuned, after)
        if raw <= n_causes * self.criterion.to_name:
            return False
        less = self._overdispersion(without, with_)
        if not self.criterion.names(before, after, n_causes, less, retuned):
            return False
        alpha, problem = self.criterion.alpha, self.fitter.problem
        if causes and not exceeds_rounding(problem, without, with_, causes):
            return False
        return all(
            differs_from_none(problem, with_, cause, alpha)
            and leaves_something(problem, with_, cause, alpha)
            and says_more_than_bounds(self.fitter, with_, cause)
            and reads_noise_at_limits(problem, with_, cause)
            and not only_begins(problem, with_, cause, alpha)
            for cause in causes
        )

    def names_disturbed(
        self, without: FittedHypothesis, with_: FittedHypothesis, needed: float
    ) -> bool:
        """Return whether the evidence for causes, given a disturbance, exceeds a threshold.

        Evidence that cannot be computed speaks against none.
        """
        if own_causes(without, with_) <= self.given:
            return True
        return not self.evidence_disturbed(without, with_) <= needed

    def _overdispersion(self, without: FittedHypothesis, with_: FittedHypothesis) -> float:
        """Return the overdispersion along the causes that only the second one has, at least 1."""
        left = self.fitter.held_out(with_).windows
        if not np.isfinite(left.squares).all():
            return 1.0
        return overdispersion_along(self.fitter.problem, with_, own_causes(without, with_), left)

    # -- of what one leaves ------------------------------------------------------------------------

    def is_nameable(self, trial: FittedHypothesis) -> bool:
        """Return whether more than white noise is left, by the smallest share that matters.

        This is tested over windows and, where the free run is informative, on the part of the
        free-run error that the uncertainty of the fit does not explain.
        """
        found = self.fitter.held_out(trial)
        squares = found.beyond_uncertainty(self.criterion.alpha)
        in_free_run = found.tells & self._coloured(trial, squares)
        return bool(in_free_run.any()) or self.is_coloured(trial)

    def is_coloured(self, trial: FittedHypothesis) -> bool:
        """Return whether more than white noise is left over windows."""
        return bool(self._coloured(trial, self.fitter.held_out(trial).windows.squares).any())

    def runs_away(self, trial: FittedHypothesis) -> bool:
        """Return whether a hypothesis tells nothing, and leaves more than noise."""
        return self.fitter.runs_away(trial) and self.is_coloured(trial)

    def leaves_what_may_depend(self, trial: FittedHypothesis) -> bool:
        """Return whether more than white noise is left, and no divergence of the model itself."""
        return self.is_nameable(trial) and not self.runs_away(trial)

    def leaves_much(self, trial: FittedHypothesis) -> bool:
        """Return whether far more than white noise is left of some output."""
        left, white = self.fitter.held_out(trial).windows, self.fitter.white_squares(trial)
        return bool((left.squares > MUCH**2 * white).any())

    def _coloured(self, trial: FittedHypothesis, squares: np.ndarray) -> np.ndarray:
        """Return for which outputs the squares exceed white noise by the smallest share."""
        beyond = squares - self.fitter.white_squares(trial)
        return beyond > self.criterion.smallest_share * squares

    def stands_in_free_run(self, trial: FittedHypothesis) -> bool:
        """Return whether the free run, where informative, does not contradict a hypothesis."""
        retuned, found = map(self.fitter.held_out, (self.fitter.base(), trial))
        return self.criterion.stands_in_free_run(retuned, found)

    def runs_worse(self, than: FittedHypothesis, trial: FittedHypothesis) -> bool:
        """Return whether a hypothesis has a worse free run than another one, beyond chance."""
        return self.criterion.runs_worse(*map(self.fitter.held_out, (than, trial)))

    def free_states_pay(self, without: FittedHypothesis, with_: FittedHypothesis) -> bool:
        """Return whether states that are free at the start of every window explain more than noise.

        A free value takes one square of the noise. What the second hypothesis explains with more of
        them has to be more than chance, and its free run better; states that do nothing but begin
        never pay.
        """
        if self.only_begins(without, with_):
            return False
        before, after = self.fitter.held_out(without), self.fitter.held_out(with_)
        values = (after.n_free - before.n_free) * len(self.fitter.problem.windows)
        if values <= 0 or not np.isfinite(before.windows.squares).all():
            return True
        if self.criterion.remembers_in_vain(before, after):
            return False
        noise = np.maximum(after.windows.squares / np.maximum(after.windows.counts, 1.0), 1.0)
        gained = (before.windows.squares - after.windows.squares) / noise
        return bool(gained.sum() > chi2.ppf(1.0 - self.criterion.alpha, values))

    def only_begins(self, without: FittedHypothesis, with_: FittedHypothesis) -> bool:
        """Return whether the states of a cause that only the second has do nothing but begin."""
        causes = own_causes(without, with_)
        problem, alpha = self.fitter.problem, self.criterion.alpha
        return any(only_begins(problem, with_, cause, alpha) for cause in causes)

    def runs_surely_worse(self, than: FittedHypothesis, trial: FittedHypothesis) -> bool:
        """Return whether a free run is worse by more than chance and what its fit's errors add."""
        before, after = self.fitter.held_out(than), self.fitter.held_out(trial)
        added = 0.0 if after.uncertain is None else after.uncertain
        beyond = after.free_run.squares - added > before.free_run.squares
        tells = before.tells | after.tells
        return bool(beyond[tells].any()) and self.criterion.runs_worse(before, after)


def own_causes(without: FittedHypothesis, with_: FittedHypothesis) -> set[Effect]:
    """Return the causes that only the second of two hypotheses has."""
    return set(with_.hypothesis.causes) - set(without.hypothesis.causes)
