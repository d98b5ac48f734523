r"""The experiment that would separate two causes, found by simulating both.

Both fitted models are driven by a small set of designed inputs. Each is then re-tuned to what the
other shows; what it leaves, in units of the noise, is what the experiment would tell.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sklearn_pgnn.diagnosis.result import Candidate, plain
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.equivalence import are_equivalent
from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords, FittedWindows
from sklearn_pgnn.estimation.hypothesis import Hypothesis, freedoms, held_by, resemble
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.simulation.record_windows import cut
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.window_fit import fit_windows

#: samples of a designed experiment at most
SAMPLES = 1500
#: amplitudes, as shares of the largest that is allowed
AMPLITUDES = (0.15, 0.5, 1.0)
#: periods of sines, in dominant periods of the records' outputs
PERIODS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0)
#: samples that a period takes at least
FAST = 10
#: steps of re-tuning, of a look at a start of an effect, and starts that are followed
STEPS, LOOK, FOLLOWED = 8, 2, 2
#: times that an experiment may have to be recorded until the diagnosis tells the causes apart, in
#: how many cases, of how many that are drawn
REPEATS, POWER, DRAWS = 10, 0.9, 400
#: difference, in units of the noise, below which two models are the same but for rounding
SAME = 1e-2


@dataclass(frozen=True)
class Experiment:
    """A designed experiment, begun in the state of the first record, and what it would tell.

    Parameters
    ----------
    input : str
        The input that is driven; the others rest.
    excitation : str
        How it is driven.
    amplitude, offset : float
        Amplitude about an offset [unit of the input].
    unit : str
        Unit of the input.
    duration, period : float
        Length of the experiment, and the machine's period that it was laid out by [s].
    reached : dict of str to float
        Largest magnitude of every state.
    difference : float
        Root mean square difference of the two models after re-tuning, in units of the noise.
    evidence : float
        The same as a number of standard errors over the whole experiment.
    repeats : float
        How often it must be recorded, beside the old records, so that the diagnosis tells the two
        apart in nine cases of ten; infinite where ten times are not enough.
    """

    input: str
    excitation: str
    amplitude: float
    offset: float
    unit: str
    duration: float
    period: float
    reached: dict[str, float]
    difference: float
    evidence: float
    repeats: float

    def signal(self, t) -> np.ndarray:
        """Give the input over time, to be recorded or simulated.

        Parameters
        ----------
        t : array-like of shape (n_samples,)
            Time [s], from 0 to `duration`.

        Returns
        -------
        ndarray of shape (n_samples,)
            The driven input.
        """
        wave = waves(np.asarray(t, dtype=float), self.period)[self.excitation]
        return self.offset + self.amplitude * wave


@dataclass(frozen=True)
class Separation:
    """How two causes can be told apart.

    Parameters
    ----------
    cause, other : Candidate
        The causes.
    equivalent : bool
        Whether they are the same, in the equations or in all that was tried, so that no experiment
        separates them.
    experiments : tuple of Experiment
        The experiments, the most telling first.
    """

    cause: Candidate
    other: Candidate
    equivalent: bool
    experiments: tuple[Experiment, ...] = ()

    @property
    def separable(self) -> bool:
        """Whether the first experiment separates them when it is recorded a few times."""
        return bool(self.experiments) and math.isfinite(self.experiments[0].repeats)


# -- inputs ----------------------------------------------------------------------------------------


def waves(t: np.ndarray, period: float) -> dict[str, np.ndarray]:
    """Give the designed excitations, each with a largest magnitude of 1.

    Parameters
    ----------
    t : ndarray of shape (n_samples,)
        Time [s], from 0.
    period : float
        Dominant period of the machine [s].

    Returns
    -------
    dict of str to ndarray of shape (n_samples,)
        The excitations by what they are called.

    Examples
    --------
    >>> list(waves(np.linspace(0, 10, 101), 1.0))[:2]
    ['steps with rests between', 'slow ramp up and down']
    """
    share = t / t[-1]
    found = {
        "steps with rests between": np.array([0.0, 1.0, 0.0, -1.0, 0.0])[
            np.minimum((5 * share).astype(int), 4)
        ],
        "slow ramp up and down": 1 - np.abs((4 * share + 3) % 4 - 2),
        "one pulse, then a long rest": np.where((share > 0.05) & (share < 0.2), 1.0, 0.0),
    }
    for count in PERIODS:
        if FAST * t[1] <= count * period < t[-1] / 2:
            found[f"sine of {count * period:.3g} s"] = np.sin(2 * np.pi * t / (count * period))
    low, high = 0.2 / period, min(10.0 / period, 1 / (FAST * t[1]))
    rate = np.log(high / low)
    sweep = np.sin(2 * np.pi * low * t[-1] * np.expm1(rate * share) / rate)
    return {**found, f"sweep from {low:.2g} to {high:.2g} Hz": sweep}


def _designs(records: DiagnosisRecords, reach: float):
    """Lay out every input, excitation and amplitude: its description and its inputs."""
    windows, period = records.windows, records.problem.period
    longest = np.diff(windows.bounds).max()
    t = records.problem.scales.sample_time * np.arange(min(int(longest), SAMPLES))
    lowest, highest = windows.u.min(axis=0), windows.u.max(axis=0)
    half = (highest - lowest) / 2
    offset = np.where(np.abs(lowest + highest) > 0.01 * half, lowest + half, 0.0)
    for i, name in enumerate(records.problem.prior.inputs):
        for excitation, wave in waves(t, period).items():
            for amplitude in reach * half[i] * np.array(AMPLITUDES):
                u = np.tile(offset, (t.size, 1))
                u[:, i] += amplitude * wave
                yield (name, excitation, float(amplitude), float(offset[i])), t, u


# -- models ----------------------------------------------------------------------------------------


def swap(records: DiagnosisRecords, old: Effect, new: Effect, each_step: Callable[[], None] | None):
    """Fit the model with one cause in the place of another.

    Parameters
    ----------
    records : DiagnosisRecords
        The records and the fits.
    old, new : Effect
        The cause to take out and the one to put in.
    each_step : callable or None
        See `fit_windows`.

    Returns
    -------
    FittedWindows
        The best fit over the starts of the new effect.
    """
    problem, prior = records.problem, records.problem.prior
    hypothesis = Hypothesis(tuple(new if cause == old else cause for cause in records.causes))
    held = held_by(prior, hypothesis)

    def fit(model, max_steps=25):
        estimate = problem.states.estimate(model)
        free = freedoms(problem, hypothesis, model, held)
        x0 = estimate.x[records.windows.starts]
        return fit_windows(
            model,
            records.windows,
            free,
            x0,
            estimate.spread,
            max_steps=max_steps,
            each_step=each_step,
        )

    starts = new.proposals(prior, problem.scales)
    looks = [fit(_extend(records, hypothesis.order, start, held), LOOK) for start in starts]
    looks.sort(key=lambda look: look.objective)
    best = min((fit(look.model) for look in looks[:FOLLOWED]), key=lambda each: each.objective)
    return FittedWindows(best.model, best.x0, best.evaluation.residual, best.freedoms)


def _extend(records, causes, start=None, held=frozenset()):
    """Extend the prior by causes: a new one at its start, the others at fitted values."""
    problem = records.problem
    model = problem.prior
    for cause in causes:
        own = cause.proposals(problem.prior, problem.scales)[0]
        is_new = start is not None and (cause.id, cause.target) == (start.id, start.target)
        model = (start if is_new else own).apply(model)
    new = set() if start is None else set(start.names().values())
    fresh = held | (new - set(problem.prior.parameters))
    known = records.fits["extended"].model.parameters
    values = {n: known[n].value for n in model.parameters if n in known and n not in fresh}
    return model.with_parameters(**values)


def _left(records, truth: FittedWindows, rival: FittedWindows, t, u, each_step):
    """Re-tune a rival to what a model shows: squares left by block, states reached; else None."""
    bounds = np.array([0, t.size])
    blank = np.zeros((t.size, records.windows.y.shape[1]))
    whole = replace(
        records.windows, t=t, u=u, y=blank, bounds=bounds, starts=bounds[:1], lengths=bounds[1:]
    )
    run = free_run(truth.model, whole, 0, t.size, truth.x0[0])
    if not run.success or _beyond(records, run.y):
        return None
    windows = cut(replace(whole, y=run.y), records.problem.scales.window, min_windows=1)
    own = free_run(rival.model, whole, 0, t.size, rival.x0[0])
    x0 = np.nan_to_num(own.x[windows.starts])
    for i, name in enumerate(rival.model.states):
        if name in truth.model.states:
            x0[:, i] = run.x[windows.starts, list(truth.model.states).index(name)]
    spread = records.problem.states.estimate(rival.model).spread
    free = tuple(replace(f, centre=rival.model.parameters[f.name].value) for f in rival.freedoms)
    fit = fit_windows(rival.model, windows, free, x0, spread, max_steps=STEPS, each_step=each_step)
    reached = dict(zip(truth.model.states, np.abs(run.x).max(axis=0).tolist(), strict=True))
    return fit.evaluation.block_squares.ravel(), reached


def _beyond(records, y) -> bool:
    """Tell whether an output leaves twice the range of the records."""
    low, high = np.nanmin(records.windows.y, axis=0), np.nanmax(records.windows.y, axis=0)
    room = 0.5 * (high - low)
    return bool(np.any(y < low - room) or np.any(y > high + room))


# -- together --------------------------------------------------------------------------------------


def are_same(records: DiagnosisRecords, cause: Effect, other: Effect) -> bool:
    """Tell whether two causes are equivalent in the equations, beside the other causes.

    Parameters
    ----------
    records : DiagnosisRecords
        The records and the fits.
    cause, other : Effect
        The causes.

    Returns
    -------
    bool
        Whether no record separates them.
    """
    beside = tuple(each for each in records.causes if each not in (cause, other))
    return are_equivalent(_extend(records, beside), cause, other)


def separate(
    records: DiagnosisRecords,
    cause: Effect,
    other: Effect,
    criterion: SelectionCriterion,
    reach: float = 1.0,
    each_step: Callable[[], None] | None = None,
) -> Separation:
    """Find the experiments that would separate two causes.

    Parameters
    ----------
    records : DiagnosisRecords
        The records and the fits.
    cause, other : Effect
        The cause that was named and the one that does as well.
    criterion : SelectionCriterion
        The rule by which one of two causes is refuted.
    reach : float, default=1
        Largest amplitude, as a multiple of the records'.
    each_step : callable, optional
        Called before every step of a fit; what it raises ends the search.

    Returns
    -------
    Separation
        The experiments, the most telling first.
    """
    pair = Candidate(cause.id, cause.target), Candidate(other.id, other.target)
    if are_same(records, cause, other):
        return Separation(*pair, equivalent=True)
    if resemble(records.problem, records.fits["extended"].model, cause, other):
        return Separation(*pair, equivalent=False)
    second = swap(records, cause, other, each_step)
    found, same = _try_all(records, second, criterion, reach, each_step)
    nested = cause.id in other.generalises or other.id in cause.generalises
    if found and same and not nested:
        return Separation(*pair, equivalent=True)
    return Separation(*pair, equivalent=False, experiments=found)


def _try_all(
    records, second: FittedWindows, criterion: SelectionCriterion, reach, each_step
) -> tuple[tuple[Experiment, ...], bool]:
    """Rank the experiments, and tell whether each model imitates the other in all of them."""
    first = records.fits["extended"]
    noise = max(float(np.nanmean((first.residual / records.windows.scale) ** 2)), 1e-300)
    found, largest = [], 0.0
    for design, t, u in _designs(records, reach):
        runs = [
            _left(records, a, b, t, u, each_step) for a, b in ((first, second), (second, first))
        ]
        whole = [run for run in runs if run is not None and np.isfinite(run[0]).all()]
        if len(whole) == 2:
            squares = min((run[0] / noise for run in whole), key=np.sum)
            found.append(_told(records, criterion, design, t, squares, whole[0][1]))
            largest = max(largest, *(run[0].sum() / (noise * t.size) for run in whole))
    found.sort(key=lambda each: (each.repeats, -each.evidence))
    return tuple(found), bool(largest < SAME**2)


def _told(records, criterion, design, t, squares, reached) -> Experiment:
    name, excitation, amplitude, offset = design
    return Experiment(
        input=name,
        excitation=excitation,
        amplitude=amplitude,
        offset=offset,
        unit=records.problem.prior.inputs[name],
        duration=float(t[-1]),
        period=records.problem.period,
        reached=reached,
        difference=float(np.sqrt(squares.sum() / (t.size * records.windows.y.shape[1]))),
        evidence=float(np.sqrt(squares.sum())),
        repeats=_repeats(records.problem.n_samples, squares, t.size, criterion.to_refute),
    )


def _repeats(n_old: int, squares: np.ndarray, n_new: int, evidence: float) -> float:
    r"""Count how often an experiment must be recorded until one of two causes is refuted.

    The old records, which the two explain alike, count beside the new ones,
    :math:`\Lambda = \tfrac{n}{2} \log(S_0/S_1)` over both.
    """
    rng, size = np.random.default_rng(0), np.sqrt(squares.sum())
    for count in range(1, REPEATS + 1):
        n = n_old + count * n_new
        nearer = rng.chisquare(max(n - 1, 1), DRAWS)
        error = rng.standard_normal(DRAWS)
        ratio = (nearer + (np.sqrt(count) * size + error) ** 2) / (nearer + error**2)
        if np.mean(n / 2 * np.log(ratio) > evidence) >= POWER:
            return float(count)
    return float("inf")


def plain_separation(separation: Separation) -> dict:
    """Turn a separation into what JSON holds.

    Parameters
    ----------
    separation : Separation
        How two causes can be told apart.

    Returns
    -------
    dict
        Plain data.
    """
    return {
        "cause": plain(separation.cause),
        "other": plain(separation.other),
        "equivalent": separation.equivalent,
        "separable": separation.separable,
        "experiments": [plain(experiment) for experiment in separation.experiments],
    }
