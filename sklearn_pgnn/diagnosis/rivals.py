"""What may stand in a cause's place: candidates that the records do not refute."""

from sklearn_pgnn.estimation.fitting import FittedHypothesis
from sklearn_pgnn.estimation.hypothesis import count_parameters, resemble
from sklearn_pgnn.physics.effect import Effect


def find_rivals(search, final: FittedHypothesis, cause: Effect) -> list[tuple[Effect, float]]:
    """Return the candidates that may stand in a cause's place, and the evidence against each.

    What takes more parameters to say is no rival: the simpler of two is taken.

    Parameters
    ----------
    search : Search
        The search.
    final : FittedHypothesis
        The hypothesis that it accepted.
    cause : Effect
        One of its causes.

    Returns
    -------
    list of (Effect, float)
        The rivals, the nearest first, with the evidence for the cause over each.
    """
    found: dict[Effect, float] = {}
    for trial in search.in_place(final, cause):
        (other,) = set(trial.hypothesis.causes) - set(final.hypothesis.causes)
        evidence = search.evidence(trial, final)
        simple = count_parameters(other) <= count_parameters(cause)
        if simple and evidence <= search.criterion.to_refute:
            found[other] = evidence
    problem, rest = search.fitter.problem, final.hypothesis.without(cause)
    for other in search.candidates:
        if rest.allows(other) and resemble(problem, final.fit.model, cause, other):
            found.setdefault(other, 0.0)
    nearest = sorted(found.items(), key=lambda item: item[1])
    return [(same, value) for other, value in nearest for same in (other, *search.same[other])]
