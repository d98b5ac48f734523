"""Rivals of a cause: candidates that the records do not refute in its place."""

from sklearn_pgnn.diagnosis.comparison import Comparison
from sklearn_pgnn.diagnosis.ladder import Ladder
from sklearn_pgnn.estimation.equivalence import are_equivalent
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis import Hypothesis, count_parameters, resemble
from sklearn_pgnn.physics.effect import Effect


def _is_same(fitter: HypothesisFitter, rest: Hypothesis, cause: Effect, other: Effect) -> bool:
    """Return whether two one-parameter causes are equivalent in the equations beside others."""
    if not count_parameters(other) == count_parameters(cause) == 1:
        return False
    if any(fitter.models.orders(rest, each) != [rest.plus(each)] for each in (cause, other)):
        return False
    return are_equivalent(fitter.models.extend(rest), cause, other, retuned=False)


def find_rivals(
    compare: Comparison, ladder: Ladder, final: FittedHypothesis, cause: Effect
) -> list[tuple[Effect, float]]:
    """Return the candidates that may replace a cause, and the evidence against each.

    A candidate with more parameters is no rival: the simpler of two is preferred. Nor is one that
    the free run contradicts, being worse than that of the re-tuned prior or of the cause.

    Parameters
    ----------
    compare : Comparison
        Compares hypotheses.
    ladder : Ladder
        Fits candidates.
    final : FittedHypothesis
        The hypothesis that a search accepted.
    cause : Effect
        One of its causes.

    Returns
    -------
    list of (Effect, float)
        The rivals, the nearest first, with the evidence for the cause over each.
    """
    found: dict[Effect, float] = {}
    for trial in ladder.in_place(final, cause):
        (other,) = set(trial.hypothesis.causes) - set(final.hypothesis.causes)
        simple = count_parameters(other) <= count_parameters(cause)
        stands = compare.stands_in_free_run(trial) and not compare.runs_worse(final, trial)
        if simple and stands and not compare.refutes(final, trial):
            found[other] = compare.evidence(trial, final)
    problem, rest = ladder.fitter.problem, final.hypothesis.without(cause)
    for other in ladder.candidates:
        if other != cause and other not in found and rest.allows(other):
            same = _is_same(ladder.fitter, rest, cause, other)
            if same or resemble(problem, final.fit.model, cause, other):
                found[other] = 0.0
    nearest = sorted(found.items(), key=lambda item: item[1])
    return [(same, value) for other, value in nearest for same in (other, *ladder.same[other])]
