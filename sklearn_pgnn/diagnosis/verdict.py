"""The verdict in two parts: what is missing, and what is left."""

from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.diagnosis.search_result import SearchResult
from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter


@dataclass(frozen=True)
class Remaining:
    """The residuals that the extended model leaves.

    Parameters
    ----------
    kind : {"noise", "disturbance", "structure"}
        White noise; coloured noise or an external disturbance, which depend on nothing that was
        recorded; or structure, which does.
    times_noise : dict of str to float
        Held-out error of every output over windows, as a multiple of its white part.
    depends_on : tuple of str
        States, inputs and the time that structure depends on, the most important first.
    runs_away : bool, default=False
        Whether the model tells nothing about any output: over windows the prior runs away from the
        records, and no output is predicted better than is possible without a model.

    Examples
    --------
    >>> Remaining("structure", {"position": 3.2}, depends_on=("v",)).kind
    'structure'
    """

    kind: str
    times_noise: dict[str, float]
    depends_on: tuple[str, ...] = ()
    runs_away: bool = False


def describe_remaining(
    fitter: HypothesisFitter,
    final: FittedHypothesis,
    structure: Structure | None,
    smallest_share: float,
) -> Remaining:
    """Describe the residuals that a hypothesis leaves.

    Parameters
    ----------
    fitter : HypothesisFitter
        The fitter of the hypothesis.
    final : FittedHypothesis
        The hypothesis that was accepted.
    structure : Structure or None
        Whether what is left depends on anything recorded; None if that was not tested.
    smallest_share : float
        Smallest share of an output's squares that counts.

    Returns
    -------
    Remaining
        What is left.
    """
    left, white = fitter.squares_by_output(final), fitter.white_squares(final)
    times = np.sqrt(fitter.held_out(final).windows.squares / white)
    named = dict(zip(fitter.problem.prior.outputs, times.tolist(), strict=True))
    white_only = bool((left - white <= smallest_share * left).all())
    runs_away = not white_only and fitter.runs_away(final)
    if structure is not None and structure.is_significant:
        return Remaining("structure", named, structure.depends_on, runs_away)
    return Remaining("noise" if white_only else "disturbance", named, (), runs_away)


def verdict_of(result: SearchResult, remaining: Remaining, has_formula: bool) -> str:
    """Return the verdict.

    Parameters
    ----------
    result : SearchResult
        The causes and their rivals.
    remaining : Remaining
        What they leave.
    has_formula : bool
        Whether a formula describes what they leave.

    Returns
    -------
    {"model_adequate", "cause_named", "ambiguous", "unexplained"}
        The verdict: *unexplained* only where something depends on what was recorded and nothing
        could be named, where the model runs away from the records, or where more than noise is left
        and the search did not come to its end.
    """
    if result.steps:
        return "ambiguous" if any(result.rivals.values()) else "cause_named"
    if remaining.runs_away or (not result.complete and remaining.kind != "noise"):
        return "unexplained"
    return "unexplained" if has_formula or remaining.kind == "structure" else "model_adequate"
