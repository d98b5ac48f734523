"""Rivals of a cause: candidates that the records do not refute in its place."""

from sklearn_pgnn.diagnosis.comparison import Comparison, own_causes
from sklearn_pgnn.diagnosis.ladder import Ladder
from sklearn_pgnn.diagnosis.outside import is_stand_in
from sklearn_pgnn.estimation.equivalence import are_equivalent
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis, is_clearly_less
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis import Hypothesis, count_parameters, resemble
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.wiring import ReversedTerm
from sklearn_pgnn.physics.model import PhysicsModel

#: hypotheses with another candidate in a cause's place, and how surely the cause is likelier
InPlace = list[tuple[FittedHypothesis, float]]


def not_refuted(
    compare: Comparison, ladder: Ladder, final: FittedHypothesis, cause: Effect
) -> InPlace:
    """Return the hypotheses that may replace the accepted one, by another candidate for a cause.

    A candidate with more parameters is no rival: the simpler of two is preferred. Nor is one that
    the free run contradicts, being worse than that of the re-tuned prior, or surely worse than that
    of the cause, nor one whose states do nothing but begin; nor what says the same of the sign of a
    term.
    """
    found = []
    for trial in ladder.in_place(final, cause):
        (other,) = own_causes(final, trial)
        same = _says_the_same(ladder.fitter.problem.prior, cause, other)
        if same or compare.only_begins(final, trial):
            continue
        simple = count_parameters(other) <= max(1, count_parameters(cause))  # a gain for a unit
        stands = compare.stands_in_free_run(trial) and not compare.runs_surely_worse(final, trial)
        if simple and stands and not compare.refutes(final, trial):
            found.append((trial, compare.separation(trial, final)))
    return found


def _says_the_same(model: PhysicsModel, cause: Effect, other: Effect) -> bool:
    """Return whether one of two causes is the sign of a term, and the other its parameter's."""
    pairs = ((cause, other), (other, cause))
    return any(isinstance(a, ReversedTerm) and a.is_sign_of(model, b) for a, b in pairs)


def likelier(
    fitter: HypothesisFitter, final: FittedHypothesis, near: InPlace
) -> list[FittedHypothesis]:
    """Return those that are likelier than the accepted hypothesis, the likeliest first.

    Of two that held-out records do not tell apart, an effect of the plant comes before one of a
    sensor or of time, and of two of a kind the one that fits all records better.
    """
    better = [(t, v) for t, v in near if v < 0.0 or (v == 0.0 and _is_first(fitter, t, final))]
    return [trial for trial, _ in sorted(better, key=lambda one: (one[1], one[0].fit.objective))]


def _is_first(fitter: HypothesisFitter, trial: FittedHypothesis, final: FittedHypothesis) -> bool:
    """Return whether a hypothesis that the records do not separate from another comes first."""
    (cause,), (other,) = own_causes(trial, final), own_causes(final, trial)
    mine, its = (is_stand_in(fitter.problem.prior, each) for each in (cause, other))
    if mine != its:
        return mine
    is_simple = trial.hypothesis.complexity <= final.hypothesis.complexity
    return is_simple and is_clearly_less(trial.fit.objective, final.fit.objective)


def find_rivals(
    ladder: Ladder, final: FittedHypothesis, cause: Effect, near: InPlace
) -> list[tuple[Effect, float]]:
    """Return the candidates that may replace a cause, and how surely the cause is likelier.

    What is a little likelier than the cause, and could not be named in its place, counts as alike.
    """
    found: dict[Effect, float] = {}
    for trial, value in near:
        (other,) = own_causes(final, trial)
        found[other] = max(value, 0.0)
    problem, rest = ladder.fitter.problem, final.hypothesis.without(cause)
    for other in ladder.candidates:
        if other != cause and other not in found and rest.allows(other):
            same = _is_same(ladder.fitter, rest, cause, other)
            if same or resemble(problem, final.fit.model, cause, other):
                found[other] = 0.0
    return [
        (same, value) for other, value in found.items() for same in (other, *ladder.same[other])
    ]


def _is_same(fitter: HypothesisFitter, rest: Hypothesis, cause: Effect, other: Effect) -> bool:
    """Return whether two one-parameter causes are equivalent in the equations beside others."""
    if not count_parameters(other) == count_parameters(cause) == 1:
        return False
    if any(fitter.models.orders(rest, each) != [rest.plus(each)] for each in (cause, other)):
        return False
    fitted = tuple(name for each in rest.causes for name in each.names().values())
    model = fitter.models.extend(rest)
    return are_equivalent(model, cause, other, retuned=False, beside=fitted)
