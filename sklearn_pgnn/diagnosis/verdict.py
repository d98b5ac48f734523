"""The verdict in two parts: what is missing, and what is left."""

from dataclasses import dataclass, field

import numpy as np

from sklearn_pgnn.diagnosis.outside import OPEN
from sklearn_pgnn.diagnosis.search_result import SearchResult
from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter

#: the verdicts with their titles, those that ask for something to be done first
VERDICTS = {
    "cause_named": "Cause named",
    "ambiguous": "Several causes fit",
    "unexplained": "Not explained",
    "provisional": "Provisional",
    "predicts_nothing": "Model predicts nothing",
    "nothing_found": "No cause found",
    "model_adequate": "Model adequate",
}


@dataclass(frozen=True)
class Remaining:
    """The residuals that the extended model leaves.

    Parameters
    ----------
    kind : {"noise", "disturbance", "structure"}
        White noise; coloured noise or an external disturbance, which depend on nothing that was
        recorded; or structure, which does.
    times_noise : dict of str to float
        Held-out error of every output over windows, as a multiple of its noise.
    law : Structure
        The law without a name that explains most of a structure: its place, its share of what is
        left, its memory, and the states, inputs and the time that it depends on.
    predicts_nothing : bool, default=False
        Whether over windows no output is predicted better than is possible without a model, by
        carrying on as at their start.

    Examples
    --------
    >>> law = Structure("v", share=0.9, memory=0.2, depends_on=("F",))
    >>> Remaining("structure", {"position": 3.2}, law).is_much
    True
    """

    kind: str
    times_noise: dict[str, float]
    law: Structure = field(default_factory=Structure)
    predicts_nothing: bool = False

    @property
    def is_much(self) -> bool:
        """Whether more than twice the noise of some output is left, and not only white noise."""
        return self.kind != "noise" and any(
            not times <= MUCH for times in self.times_noise.values()
        )


def describe_remaining(
    fitter: HypothesisFitter,
    final: FittedHypothesis,
    structure: Structure | None,
    smallest_share: float,
) -> Remaining:
    """Describe the residuals that a hypothesis leaves; None for a structure that was not tested."""
    left, white = fitter.squares_by_output(final), fitter.white_squares(final)
    found = fitter.held_out(final).windows
    times = np.sqrt(found.squares / np.where(found.counts > 0, found.counts, np.nan))
    named = dict(zip(fitter.problem.prior.outputs, times.tolist(), strict=True))
    white_only = bool((left - white <= smallest_share * left).all())
    nothing = fitter.predicts_nothing(final, smallest_share)
    if structure is not None and structure.is_significant:
        return Remaining("structure", named, structure, nothing)
    return Remaining("noise" if white_only else "disturbance", named, Structure(), nothing)


def verdict_of(result: SearchResult, remaining: Remaining, has_formula: bool) -> str:
    """Return the verdict, one of `VERDICTS`.

    A search that did not finish has tested nothing against the rest: it calls a model adequate
    where only noise is left, and is provisional otherwise.
    """
    if remaining.predicts_nothing and not (result.steps or has_formula):
        return "predicts_nothing"
    if not result.complete and (result.steps or remaining.kind != "noise"):
        return "provisional"
    if result.steps:
        is_open = any(result.rivals.values()) or any(p >= OPEN for p in result.outside.values())
        return "ambiguous" if is_open else "cause_named"
    if has_formula or remaining.kind == "structure":
        return "unexplained"
    return "nothing_found" if remaining.is_much else "model_adequate"
