"""The verdict in two parts: what is missing, and what is left."""

import math
from dataclasses import dataclass, field

import numpy as np

from sklearn_pgnn.diagnosis.outside import OPEN
from sklearn_pgnn.diagnosis.search_result import SearchResult
from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.simulation.uncertainty import Rounded

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


@dataclass(frozen=True, repr=False)
class Remaining(Rounded):
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
    in_free_run : dict of str to float
        Held-out error in free run that the errors of the fit do not explain, as a multiple of the
        noise, of the outputs whose free run is informative.

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
    in_free_run: dict[str, float] = field(default_factory=dict)

    @property
    def is_much(self) -> bool:
        """Whether more than twice the noise of some output is left, and not only white noise."""
        over_windows = self.times_noise if self.kind != "noise" else {}
        left = (*over_windows.values(), *self.in_free_run.values())
        return any(not times <= MUCH for times in left)


def describe_remaining(
    fitter: HypothesisFitter,
    final: FittedHypothesis,
    structure: Structure | None,
    criterion: SelectionCriterion,
) -> Remaining:
    """Describe the residuals that a hypothesis leaves; None for a structure that was not tested."""
    left, white = fitter.squares_by_output(final), fitter.white_squares(final)
    found, share = fitter.held_out(final), criterion.smallest_share
    nothing = fitter.predicts_nothing(final, share)
    kind, law = "disturbance", Structure()
    if structure is not None and structure.is_significant:
        kind, law = "structure", structure
    elif (left - white <= share * left).all():
        kind = "noise"
    over_windows = _times_noise(fitter, found.windows.squares, found.windows.counts)
    unexplained = np.maximum(found.beyond_uncertainty(criterion.alpha), 0.0)
    counts = np.where(found.tells, found.free_run.counts, 0.0)
    in_free_run = _times_noise(fitter, unexplained, counts)
    return Remaining(kind, over_windows, law, nothing, in_free_run)


def _times_noise(
    fitter: HypothesisFitter, squares: np.ndarray, counts: np.ndarray
) -> dict[str, float]:
    """Return the root mean square of every output that is counted."""
    each = zip(fitter.problem.prior.outputs, squares.tolist(), counts.tolist(), strict=True)
    return {output: math.sqrt(total / n) for output, total, n in each if n > 0.0}


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
