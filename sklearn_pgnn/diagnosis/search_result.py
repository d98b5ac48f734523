"""What a search found."""

from dataclasses import dataclass, field, replace

from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis, objective_of
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.squares_left import ShareLeft
from sklearn_pgnn.physics.effect import Effect


@dataclass(frozen=True)
class SearchResult:
    """The result of a search.

    `base` is the re-tuned prior, `steps` the final hypothesis, cause by cause, the most important
    first. For every cause, `rivals` are the candidates that may replace it, and the evidence for
    the cause over each, `evidence` is that for it beside the others, and `outside` the probability
    that what acts in its place is none of the catalogue; the last two are empty where time ran out.
    `alone` is the share of the re-tuned prior's squares that each candidate leaves as the only
    cause. It is `complete` if every cause was tested against the rest.
    """

    base: FittedHypothesis
    steps: list[FittedHypothesis]
    rivals: dict[Effect, list[tuple[Effect, float]]]
    evidence: dict[Effect, float] = field(default_factory=dict)
    outside: dict[Effect, float] = field(default_factory=dict)
    alone: dict[Effect, ShareLeft] = field(default_factory=dict)
    complete: bool = True

    @property
    def final(self) -> FittedHypothesis:
        """The hypothesis that was accepted."""
        return self.steps[-1] if self.steps else self.base


def in_order(
    fitter: HypothesisFitter, base: FittedHypothesis, final: FittedHypothesis
) -> list[FittedHypothesis]:
    """Add the causes of a hypothesis one by one, the most important first."""
    left, steps, trial = list(final.hypothesis.causes), [], base
    while len(left) > 1:
        ready = [c for c in left if not any(part.id in c.shared for part in left)]
        ground = fitter.subsample(trial)
        options = [fitter.converge(fitter.first_fit(ground, cause)) for cause in ready]
        trial = fitter.fit_all(min(options, key=objective_of), trial)
        left.remove(trial.hypothesis.causes[-1])
        steps.append(trial)
    if left:
        causes = (*trial.hypothesis.causes, left[0])
        steps.append(FittedHypothesis(replace(final.hypothesis, causes=causes), final.fit))
    return steps
