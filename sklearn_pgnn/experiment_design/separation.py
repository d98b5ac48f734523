r"""The experiment that would separate two causes, found by simulating both.

Both fitted models are driven by a small set of designed inputs. Each is then re-tuned to the
outputs of the other; the remaining difference, in units of the noise, is the information of the
experiment.
"""

import itertools
import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times
from sklearn_pgnn.estimation.budgets import (
    DRAWS,
    KEPT,
    OCTAVES,
    POWER,
    REPEATS,
    SAMPLES,
    STEPS,
    TOLERANCE,
)
from sklearn_pgnn.estimation.candidate import Candidate
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.equivalence import are_equivalent
from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords, FittedWindows
from sklearn_pgnn.estimation.freedoms import freedoms, held_by
from sklearn_pgnn.estimation.held_out import segments
from sklearn_pgnn.estimation.hypothesis import Hypothesis, resemble
from sklearn_pgnn.estimation.hypothesis_models import HypothesisModels
from sklearn_pgnn.estimation.plain_data import plain
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.experiment_design.power import Noise
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.differences import is_mark
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.led_states import start_values
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, cut
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.window_fit import EachStep, WindowFit, fit_windows

# -- designed excitations: waves of an input over the length of an experiment ----------------------

#: the name of every kind of wave
NAMES = {
    "steps": "steps with pauses",
    "ramp": "slow ramp up and down",
    "pulse": "one pulse, then a long pause",
    "sine": "sine with a period of {period:.3g} s",
    "sweep": "sweep from {low:.2g} to {high:.2g} Hz",
}


@dataclass(frozen=True)
class Wave:
    """A wave with a largest magnitude of 1.

    Its kind is ``"steps"``, ``"ramp"``, ``"pulse"``, ``"sine"`` or ``"sweep"``; `low` and `high`
    are the lowest and highest frequency [Hz] of a sine, or of a sweep.
    """

    kind: str
    low: float = 0.0
    high: float = 0.0

    def __str__(self) -> str:
        period = 1.0 / self.low if self.low else 0.0
        return NAMES[self.kind].format(period=period, low=self.low, high=self.high)

    def __call__(self, t: ArrayLike, duration: float) -> np.ndarray:
        """Return the wave over times [s] from 0 to `duration`."""
        t = np.asarray(t, dtype=float)
        share = t / duration
        if self.kind == "steps":
            return np.array([0.0, 1.0, 0.0, -1.0, 0.0])[np.minimum((5 * share).astype(int), 4)]
        if self.kind == "ramp":
            return 1 - np.abs((4 * share + 3) % 4 - 2)
        if self.kind == "pulse":
            return np.where((share > 0.05) & (share < 0.2), 1.0, 0.0)
        if self.kind == "sine":
            return np.sin(2 * np.pi * self.low * t)
        rate = np.log(self.high / self.low)
        return np.sin(2 * np.pi * self.low * duration * np.expm1(rate * share) / rate)


#: what moves an input: its name, the wave, its amplitude and offset
Design = tuple[str, Wave, float, float]


def waves(period: float, duration: float, sample_time: float) -> list[Wave]:
    """Return the waves to try on a machine."""
    quickest = MIN_SAMPLES / 2 * sample_time  # the shortest period that is sampled well enough
    octaves = np.arange(2.0 * OCTAVES + 1) - OCTAVES
    periods = [p for p in (period * 2.0**octaves).tolist() if quickest <= p < duration / 2]
    low, high = 2.0**-OCTAVES / period, min(2.0**OCTAVES / period, 1 / quickest)
    sines = [Wave("sine", 1 / p, 1 / p) for p in periods]
    return [Wave("steps"), Wave("ramp"), Wave("pulse"), *sines, Wave("sweep", low, high)]


# -- the experiment --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Experiment:
    """A designed experiment from the initial state of the first record, and its information.

    Parameters
    ----------
    input : str
        The input that is driven; the others rest.
    excitation : str
        The excitation in words.
    wave : Wave
        The excitation as a function of time.
    amplitude, offset : float
        Amplitude about an offset [unit of the input].
    unit : str
        Unit of the input.
    duration : float
        Length of the experiment [s].
    reached : dict of str to float
        Largest magnitude of every state.
    difference : float
        Root mean square difference of the two models after re-tuning, in units of the noise.
    evidence : float
        The same difference as a number of standard errors over the whole experiment.
    repeats : float
        Number of recordings, in addition to the old records, with which the diagnosis separates the
        two in nine cases of ten; infinite where ten are not enough.

    Examples
    --------
    >>> wave = Wave("pulse")
    >>> pulse = Experiment("F", str(wave), wave, amplitude=2.0, offset=0.5, unit="N", duration=10.0,
    ...                    reached={"v": 0.8}, difference=3.0, evidence=9.0, repeats=1.0)
    >>> pulse.signal([0.0, 1.0, 5.0, 10.0])
    array([0.5, 2.5, 0.5, 0.5])
    """

    input: str
    excitation: str
    wave: Wave
    amplitude: float
    offset: float
    unit: str
    duration: float
    reached: dict[str, float]
    difference: float
    evidence: float
    repeats: float

    def signal(self, t: ArrayLike) -> np.ndarray:
        """Return the input over time, to be recorded or simulated.

        Parameters
        ----------
        t : array-like of shape (n_samples,)
            Time [s], from 0 to `duration`.

        Returns
        -------
        ndarray of shape (n_samples,)
            The driven input.
        """
        return self.offset + self.amplitude * self.wave(t, self.duration)


@dataclass(frozen=True)
class Separation:
    """How two causes can be separated by experiment.

    Parameters
    ----------
    cause, other : Candidate
        The causes.
    equivalent : bool
        Whether they are equivalent, in the equations or in all experiments that were tried, so that
        no experiment separates them.
    experiments : tuple of Experiment
        The experiments, the most informative first.

    Examples
    --------
    >>> from sklearn_pgnn.diagnosis import Candidate
    >>> bias, load = Candidate("input_bias", "F"), Candidate("constant_load", "v")
    >>> Separation(bias, load, equivalent=True).separable
    False
    """

    cause: Candidate
    other: Candidate
    equivalent: bool
    experiments: tuple[Experiment, ...] = ()

    @property
    def separable(self) -> bool:
        """Whether the first experiment separates them if it is recorded a few times."""
        return bool(self.experiments) and math.isfinite(self.experiments[0].repeats)


# -- inputs ----------------------------------------------------------------------------------------


def _designs(
    records: DiagnosisRecords, reach: float
) -> Iterator[tuple[Design, np.ndarray, np.ndarray]]:
    """Yield every experiment to try: its description, its times and its inputs.

    What says in which records something differs stays as it was in the end.
    """
    windows, period, model = records.windows, records.problem.period, records.problem.prior
    longest = np.diff(windows.bounds).max()
    t = records.problem.scales.sample_time * np.arange(min(int(longest), SAMPLES // KEPT))
    lowest, highest = windows.u.min(axis=0), windows.u.max(axis=0)
    half = (highest - lowest) / 2
    offset = np.where(np.abs(lowest + highest) > 0.01 * half, lowest + half, 0.0)
    marks = np.array([is_mark(model, name) for name in model.inputs], dtype=bool)
    offset[marks] = windows.u[-1, marks]
    levels = np.union1d(reach, min(reach, 1.0) * 2.0 ** -np.arange(float(OCTAVES)))
    for i, name in itertools.compress(enumerate(model.inputs), ~marks):
        for wave in waves(period, t[-1], t[1]):
            for amplitude in half[i] * levels:
                u = np.tile(offset, (t.size, 1))
                u[:, i] += amplitude * wave(t, t[-1])
                yield (name, wave, float(amplitude), float(offset[i])), t, u


# -- models ----------------------------------------------------------------------------------------


def swap(records: DiagnosisRecords, old: Effect, new: Effect, each_step: EachStep) -> FittedWindows:
    """Fit the model with one cause in place of another, the others as fitted and as they begin."""
    problem, prior = records.problem, records.problem.prior
    hypothesis = put_in_place(problem, records.causes, old, new)
    held = held_by(prior, hypothesis)

    def fit(model: PhysicsModel, max_steps: int = 25) -> WindowFit:
        free = freedoms(problem, hypothesis, model, held)
        return fit_windows(
            model,
            records.windows,
            free,
            *problem.states.expected_starts(model, records.windows),
            max_steps=max_steps,
            each_step=each_step,
        )

    starts = new.proposals(prior, problem.scales)
    begun = ("extended", "refitted") if len(records.causes) > 1 else ("extended",)
    pairs = itertools.product(starts, begun)
    looks = [fit(_extend(records, hypothesis.order, *pair, held), STEPS) for pair in pairs]
    looks.sort(key=lambda look: look.objective)
    best = min((fit(look.model) for look in looks[:KEPT]), key=lambda each: each.objective)
    return FittedWindows(best.model, best.x0, best.evaluation.residual, best.freedoms)


def put_in_place(
    problem: EstimationProblem, causes: tuple[Effect, ...], old: Effect, new: Effect
) -> Hypothesis:
    """Return the hypothesis with a cause in place of another, behind what it would prevent."""
    at, models = causes.index(old), HypothesisModels(problem)
    rest = Hypothesis(tuple(cause for cause in causes if cause != old))
    there = rest.plus(new, at)
    places = [there, *(rest.plus(new, place) for place in reversed(range(len(causes))))]
    return next((placed for placed in places if models.is_possible(placed)), there)


def _extend(
    records: DiagnosisRecords,
    causes: tuple[Effect, ...],
    start: Effect | None = None,
    begun: str = "extended",
    held: Collection[str] = frozenset(),
) -> PhysicsModel:
    """Extend the prior by causes: a new one at its start, the others as in a fitted model."""
    problem, prior = records.problem, records.problem.prior.parameters
    model = HypothesisModels(problem).extend(Hypothesis(causes), records.fits[begun].model)
    values = {name: prior[name].value for name in held}
    if start is not None:
        own = start.names().items()
        values |= {name: getattr(start, field) for field, name in own if name not in prior}
    return model.with_parameters(**values)


class _Shown(NamedTuple):
    """Residuals of an experiment after re-tuning: squares and times, with the states reached."""

    squares: np.ndarray
    times: np.ndarray
    reached: dict[str, float]


def _left(
    records: DiagnosisRecords,
    truth: FittedWindows,
    rival: FittedWindows,
    t: np.ndarray,
    u: np.ndarray,
    each_step: EachStep,
) -> _Shown | None:
    """Re-tune a rival to outputs, and return the residuals; None outside the records' range."""
    bounds = np.array([0, t.size])
    y = np.zeros((t.size, records.windows.y.shape[1]))
    whole = replace(
        records.windows, t=t, u=u, y=y, bounds=bounds, starts=bounds[:1], lengths=bounds[1:]
    )
    run = free_run(truth.model, whole, 0, t.size, truth.x0[0])
    if not run.success or _beyond(records, run.y):
        return None
    windows = cut(replace(whole, y=run.y), records.problem.scales.window, min_windows=1)
    own = free_run(rival.model, whole, 0, t.size, rival.x0[0])
    x = np.nan_to_num(own.x)
    for i, name in enumerate(rival.model.states):
        if name in truth.model.states:
            x[:, i] = run.x[:, list(truth.model.states).index(name)]
    x0 = start_values(rival.model, windows, x)
    spread = records.problem.states.estimate(rival.model).spread
    free = tuple(replace(f, centre=rival.model.parameters[f.name].value) for f in rival.freedoms)
    fit = fit_windows(
        rival.model, windows, free, x0, spread, max_steps=2 * STEPS, each_step=each_step
    )
    if not fit.usable:
        return None
    reached = dict(zip(truth.model.states, np.abs(run.x).max(axis=0).tolist(), strict=True))
    signal = fit.evaluation.residual / windows.scale
    times = autocorrelation_times(signal, segments(windows))
    return _Shown(np.nansum(signal**2, axis=0), times, reached)


def _beyond(records: DiagnosisRecords, y: np.ndarray) -> bool:
    """Return whether an output leaves twice the range of the records."""
    low, high = np.nanmin(records.windows.y, axis=0), np.nanmax(records.windows.y, axis=0)
    room = 0.5 * (high - low)
    return bool(np.any(y < low - room) or np.any(y > high + room))


# -- together --------------------------------------------------------------------------------------


def are_same(records: DiagnosisRecords, cause: Effect, other: Effect) -> bool:
    """Return whether two causes are equivalent in the equations, beside the other causes."""
    beside = tuple(each for each in records.causes if each not in (cause, other))
    model = _extend(records, beside)
    both_act = all(each.can_act(each.target, model) for each in (cause, other))
    return both_act and are_equivalent(model, cause, other)


def separate(
    records: DiagnosisRecords,
    cause: Effect,
    other: Effect,
    criterion: SelectionCriterion,
    reach: float = 1.0,
    each_step: EachStep = None,
) -> Separation:
    """Find the experiments that would separate two causes."""
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
    records: DiagnosisRecords,
    second: FittedWindows,
    criterion: SelectionCriterion,
    reach: float,
    each_step: EachStep,
) -> tuple[tuple[Experiment, ...], bool]:
    """Rank the experiments; also return whether each model imitates the other in all of them."""
    first = records.fits["extended"]
    noise, found, same = _noise(records), [], True
    for design, t, u in _designs(records, reach):
        runs = [
            _left(records, a, b, t, u, each_step) for a, b in ((first, second), (second, first))
        ]
        whole = [run for run in runs if run is not None]
        if len(whole) == 2:
            least, most = sorted(whole, key=lambda run: np.sum(run.squares / noise.power))
            found.append(_told(records, criterion, design, t, noise, least, whole[0].reached))
            same = same and np.sum(most.squares / noise.power) < TOLERANCE * t.size
    found.sort(key=lambda each: (each.repeats, -each.evidence))
    return tuple(found), same


def _noise(records: DiagnosisRecords) -> Noise:
    """Return the residuals of the fitted model over windows, as noise."""
    windows = records.windows
    residual = records.fits["extended"].residual / windows.scale
    return Noise.of(residual, segments(windows), records.problem.resolution, white=False)


def _told(
    records: DiagnosisRecords,
    criterion: SelectionCriterion,
    design: Design,
    t: np.ndarray,
    noise: Noise,
    left: _Shown,
    reached: dict[str, float],
) -> Experiment:
    """Describe an experiment by its residuals after re-tuning."""
    name, wave, amplitude, offset = design
    shares = left.squares / noise.power
    evidence = np.sqrt((shares / noise.times).sum())
    return Experiment(
        input=name,
        excitation=str(wave),
        wave=wave,
        amplitude=amplitude,
        offset=offset,
        unit=records.problem.prior.inputs[name],
        duration=float(t[-1]),
        reached=reached,
        difference=float(np.sqrt(shares.sum() / (t.size * shares.size))),
        evidence=float(evidence),
        repeats=_repeats(noise, left, t.size, criterion.to_refute),
    )


def _repeats(noise: Noise, left: _Shown, n_new: int, needed: float) -> float:
    """Count how often an experiment is recorded, beside old records, until a cause is refuted."""
    for count in range(1, REPEATS + 1):
        rng, both = np.random.default_rng(0), replace(noise, counts=noise.counts + count * n_new)
        size, along = np.sqrt(count * left.squares), noise.power * noise.times
        ratios = both.likelihood_ratios(size, left.times, along, rng, DRAWS)
        if np.mean(ratios > needed) >= POWER:
            return float(count)
    return float("inf")


def plain_separation(separation: Separation) -> dict:
    """Return a separation as plain data for JSON."""
    return {
        "cause": plain(separation.cause),
        "other": plain(separation.other),
        "equivalent": separation.equivalent,
        "separable": separation.separable,
        "experiments": [plain(experiment) for experiment in separation.experiments],
    }
