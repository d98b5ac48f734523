"""The results of a diagnosis: causes with sizes, parameters, and the gain of the extension."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.diagnosis.outside import OPEN
from sklearn_pgnn.diagnosis.search import Search
from sklearn_pgnn.diagnosis.search_result import SearchResult
from sklearn_pgnn.diagnosis.size import likelihood_intervals, onset_interval
from sklearn_pgnn.estimation.budgets import DRAWS
from sklearn_pgnn.estimation.candidate import Candidate
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.residuals import HeldOut, Residuals
from sklearn_pgnn.estimation.squares_left import block_squares
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.differences import parsed
from sklearn_pgnn.physics.effects.rates import worded_for
from sklearn_pgnn.physics.effects.targets import parts
from sklearn_pgnn.readings import reading
from sklearn_pgnn.simulation.uncertainty import Estimate, Rounded, estimate_of
from sklearn_pgnn.simulation.window_fit import WindowFit


class Rival(NamedTuple):
    """A candidate that explains the records in place of a named cause.

    Parameters
    ----------
    effect : str
        Id of the effect in the catalogue.
    target : str
        What it acts on.
    probability : float
        Probability that it is the cause; NaN where the search did not finish.

    Examples
    --------
    >>> Rival("sensor_bias", "position", 0.2).probability
    0.2
    """

    effect: str
    target: str
    probability: float


class Tried(NamedTuple):
    """A candidate, and the error that remains with it as the only cause.

    Parameters
    ----------
    effect : str
        Id of the effect in the catalogue.
    target : str
        The state in whose rate it acts, or the input, output or parameter.
    left, low, high : float
        Remaining share of the re-tuned prior's error power, with its 95 % interval.

    Examples
    --------
    >>> tried = [Tried("leak", "h", 4.0, 3.8, 4.2), Tried("input_gain", "pump", 1.1, 1.0, 1.2)]
    >>> min(tried, key=lambda one: one.left).effect
    'input_gain'
    """

    effect: str
    target: str
    left: float
    low: float
    high: float


@dataclass(frozen=True)
class NamedCause:
    """A named cause of the model's error.

    Parameters
    ----------
    effect : str
        Id of the effect in the catalogue.
    target : str
        What it acts on.
    parameters : dict of str to Estimate
        Its physical parameters.
    gain : float
        Reduction of the held-out error relative to the model without this cause [%].
    confused_with : tuple of Rival
        Candidates that the records do not refute in its place, with their probabilities.
    summary, check : str
        A description of the cause, and how to check it on the rig.
    equivalent : tuple of Candidate
        Those in `confused_with` that are equivalent in the equations: no record separates them.
    probability : float
        Probability that this is the cause, rather than another one of the catalogue or none; NaN
        where that was not tested.
    tested : bool
        Whether the cause was tested against the rest of the catalogue; otherwise, after a search
        that did not finish, it is provisional.
    outside : float
        Probability that it is none of the catalogue; with those of the cause and of its rivals it
        sums to 1. Much that is left beside it, or a law without a name that explains as much,
        raises it.
    onset : Estimate or None
        The time in the record from which on it acts, where it begins within a record [s]; its
        interval is infinite where time was up.

    Examples
    --------
    >>> size = Estimate(0.40, 0.38, 0.42, "N")
    >>> cause = NamedCause("coulomb_friction", "v", {"level": size}, 3.5, ())
    >>> cause
    <NamedCause coulomb_friction on v: level 0.4 N, probability 1>
    """

    effect: str
    target: str
    parameters: dict[str, Estimate]
    gain: float
    confused_with: tuple[Rival, ...]
    summary: str = ""
    check: str = ""
    equivalent: tuple[Candidate, ...] = ()
    probability: float = 1.0
    tested: bool = True
    outside: float = 0.0
    onset: Estimate | None = None

    @property
    def is_open(self) -> bool:
        """Whether the records do not separate the cause from others, with a name or without."""
        return bool(self.confused_with) or self.outside >= OPEN

    def __repr__(self) -> str:
        sizes = (f"{name} {e.value:.4g} {e.unit}".rstrip() for name, e in self.parameters.items())
        words = [*sizes, f"probability {self.probability:.3g}" if self.tested else "provisional"]
        if self.confused_with:
            words.append(f"confused with {len(self.confused_with)}")
        return f"<NamedCause {self.effect} on {self.target}: {', '.join(words)}>"

    def _repr_html_(self) -> str:
        return reading("cause_html")(self)

    def _repr_latex_(self) -> str | None:
        return reading("cause_latex")(self)


@dataclass(frozen=True, repr=False)
class RetunedParameter(Rounded):
    """A parameter of the prior after re-tuning.

    Parameters
    ----------
    prior, value, low, high : float
        Prior value, estimate and its 95 % interval [unit]. For a parameter that was held, because
        the records cannot determine it beside the causes, the interval is its bounds.
    unit : str
        Its unit.
    changed : bool
        Whether the interval excludes the prior value.

    Examples
    --------
    >>> mass = RetunedParameter(prior=2.0, value=2.2, low=2.1, high=2.3, unit="kg", changed=True)
    >>> print(f"{mass.prior:g} to {mass.value:g} {mass.unit}")
    2 to 2.2 kg
    """

    prior: float
    value: float
    low: float
    high: float
    unit: str
    changed: bool


@dataclass(frozen=True, repr=False)
class Gain(Rounded):
    """The held-out error of an output over windows, for the three models.

    Parameters
    ----------
    prior, refitted, extended : float
        Root mean square error of the prior, the re-tuned prior and the extended model.
    noise : float
        The noise of the records, the same that a first look estimates.
    explained_share, low, high : float
        Share of the prior's error power above the noise that the last model removes, with its
        95 % interval from bootstrapped windows.
    unit : str
        Unit of the errors.
    free_run_refitted, free_run_extended, free_run_formula : float
        Root mean square error in free run, over held-out records, or over the stretches that were
        held out.
    formula : float, default=nan
        Root mean square error of the model with the causes and the formula; not a number where
        there is no formula.

    Examples
    --------
    >>> gain = Gain(0.5, 0.3, 0.1, 0.1, explained_share=1.0, low=0.98, high=1.0, unit="m")
    >>> gain.extended / gain.noise
    1.0
    """

    prior: float
    refitted: float
    extended: float
    noise: float
    explained_share: float
    low: float
    high: float
    unit: str = ""
    free_run_refitted: float = math.nan
    free_run_extended: float = math.nan
    free_run_formula: float = math.nan
    formula: float = math.nan


def name_causes(
    search: Search, result: SearchResult, errors: Mapping[str, float]
) -> tuple[NamedCause, ...]:
    """Describe the causes of the accepted hypothesis, the most important first."""
    steps = pairwise((result.base, *result.steps))
    return tuple(_named(search, result, pair, errors) for pair in steps)


def _named(
    search: Search,
    result: SearchResult,
    steps: tuple[FittedHypothesis, FittedHypothesis],
    errors: Mapping[str, float],
) -> NamedCause:
    """Describe the cause that the second of two steps has, and the first has not."""
    fitter, cause = search.fitter, steps[1].hypothesis.causes[-1]
    mine, *theirs, outside = _probabilities(search, result, cause, steps)
    summary, check = worded_for(fitter.problem.prior, cause)
    others = zip(result.rivals[cause], theirs, strict=True)
    onset = _onset(fitter, result.final, cause)
    said = cause.summarise(result.final.fit.model) or summary
    if onset is not None and math.isfinite(onset.low):
        said = f"{said.removesuffix('.')} (onset between {onset.low:.5g} and {onset.high:.5g} s)."
    return NamedCause(
        effect=cause.id,
        target=cause.target,
        parameters=_estimates(fitter, result.final, cause, errors),
        gain=_gain_percent(*map(fitter.held_out, steps)),
        confused_with=tuple(Rival(other.id, other.target, p) for (other, _), p in others),
        summary=said,
        check=check,
        probability=mine,
        tested=result.complete,
        outside=outside,
        onset=onset,
    )


def _onset(fitter: HypothesisFitter, trial: FittedHypothesis, cause: Effect) -> Estimate | None:
    """Return the time from which on a cause acts, if that is within a record."""
    since = parsed(parts(cause.target)[1])[1]
    if since is None or not trial.fit.usable:
        return None
    low, high = -math.inf, math.inf
    with fitter.progress.spare_time():
        low, high = onset_interval(fitter, trial, parts(cause.target)[1])
    return Estimate(since, low, high, "s")


def _probabilities(
    search: Search,
    result: SearchResult,
    cause: Effect,
    steps: tuple[FittedHypothesis, FittedHypothesis],
) -> list[float]:
    """Return the probabilities of a cause, each rival, and none of the catalogue, in sum 1."""
    rivals = result.rivals[cause]
    if not result.complete:
        return [math.nan] * (2 + len(rivals))
    known = cause in result.evidence
    over_none = result.evidence[cause] if known else search.compare.evidence(*steps)
    *named, none = search.criterion.probabilities([*(value for _, value in rivals), over_none])
    outside = result.outside.get(cause, float(none))
    return [*(np.array(named) / sum(named) * (1.0 - outside)).tolist(), outside]


def _estimates(
    fitter: HypothesisFitter, trial: FittedHypothesis, cause: Effect, errors: Mapping[str, float]
) -> dict[str, Estimate]:
    free = {freedom.name for freedom in trial.fit.freedoms}
    own = {f: n for f, n in cause.names().items() if f not in trial.hypothesis.taken_over(cause)}
    found = {field: estimate_of(trial.fit.model, name, errors) for field, name in own.items()}
    if not trial.fit.usable:
        return found
    fitted = {name: errors[name] for name in own.values() if name in free}
    intervals: dict[str, tuple[float, float]] = {}
    with fitter.progress.spare_time():
        intervals = likelihood_intervals(fitter, trial, fitted)
    return {
        field: replace(found[field], low=low, high=high)
        for field, name in own.items()
        for low, high in [intervals.get(name, (found[field].low, found[field].high))]
    }


def _gain_percent(without: HeldOut, with_: HeldOut) -> float:
    worse, better = without.windows.squares.sum(), with_.windows.squares.sum()
    if not np.isfinite(worse):  # without it the records cannot be followed at all
        return 100.0 if np.isfinite(better) else np.nan
    return float(100.0 * (1.0 - np.sqrt(better / worse)))


def retuned_parameters(
    problem: EstimationProblem, fit: WindowFit, errors: Mapping[str, float]
) -> dict[str, RetunedParameter]:
    """Compare the prior's free parameters with their re-tuned values."""
    table = {}
    for name in problem.prior.free_parameters:
        found, prior = estimate_of(fit.model, name, errors), problem.prior.parameters[name]
        low, high = (found.low, found.high) if name in errors else prior.bounds  # else held
        changed = not low <= prior.value <= high
        table[name] = RetunedParameter(prior.value, found.value, low, high, found.unit, changed)
    return table


def measure_gain(
    fitter: HypothesisFitter, trials: Mapping[str, FittedHypothesis], seed: int
) -> dict[str, Gain]:
    """Measure the errors of the prior and of hypotheses, on held-out windows and in free run.

    The last hypothesis leaves the noise, and explains what was found.
    """
    problem, rng = fitter.problem, np.random.default_rng(seed)
    windows = problem.windows
    counts = windows.sum_blocks(np.isfinite(windows.y).astype(float)).sum(axis=1)
    held_out, last = (
        {which: fitter.held_out(trial) for which, trial in trials.items()},
        [*trials][-1],
    )
    squares = {"prior": block_squares(problem, fitter.prior).sum(axis=1)}
    squares |= {which: found.block_squares.sum(axis=1) for which, found in held_out.items()}
    white = np.sqrt(fitter.white_squares(trials[last]) / np.maximum(counts.sum(axis=0), 1))
    draws = rng.integers(0, len(counts), (DRAWS, len(counts)))
    gains = {}
    for i, output in enumerate(problem.prior.outputs):
        scale, noise = windows.scale[i], float(white[i])

        def power(which: str, rows: np.ndarray, i: int = i) -> np.ndarray:
            measured = counts[rows, i].sum(axis=-1)
            return squares[which][rows, i].sum(axis=-1) / np.where(measured > 0, measured, np.nan)

        whole = np.arange(len(counts))
        share = share_above_noise(power("prior", whole), power(last, whole), noise)
        shares = share_above_noise(power("prior", draws), power(last, draws), noise)
        low, high = np.nanpercentile(shares, [2.5, 97.5])  # some draws may have measured nothing
        errors = {which: float(scale * np.sqrt(power(which, whole))) for which in squares}
        runs = {f"free_run_{which}": _rms(h.free_run, i, scale) for which, h in held_out.items()}
        gains[output] = Gain(
            **errors,
            noise=float(scale),
            explained_share=float(share),
            low=float(low),
            high=float(high),
            unit=problem.prior.unit(output),
            **runs,
        )
    return gains


def _rms(residuals: Residuals, output: int, scale: float) -> float:
    count = max(residuals.counts[output], 1.0)
    return float(scale * np.sqrt(residuals.squares[output] / count))


def share_above_noise(before: ArrayLike, after: ArrayLike, noise: float) -> np.ndarray:
    """Return the removed share of the error power above the noise, between 0 and 1."""
    before, after = np.asarray(before), np.asarray(after)
    known = np.isfinite(before) & np.isfinite(after)
    finite = np.where(known, before, 1.0)
    above = np.maximum(finite - noise**2, 1e-12 * np.maximum(finite, 1e-300))
    share = np.clip((finite - np.where(known, after, 1.0)) / above, 0.0, 1.0)
    return np.where(known, share, np.isfinite(after))
