"""From records to windows: window length and noise are estimated from the records."""

import warnings
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from numbers import Real

import numpy as np

from sklearn_pgnn.exceptions import OptionError, SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.fastest import fastest
from sklearn_pgnn.simulation.noise_option import read_noise_std
from sklearn_pgnn.simulation.simulate import hold_of, simulate_acting
from sklearn_pgnn.simulation.state_estimate import StateEstimator
from sklearn_pgnn.simulation.stepping import usual_interval
from sklearn_pgnn.simulation.substeps import (
    EXPLICIT,
    IMPLICIT,
    MAX_SUBSTEPS,
    STABLE,
    Steps,
    enough_steps,
    given_steps,
)
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import Evaluation, ShootingWindows, evaluate
from sklearn_pgnn.trajectories.grid import step_of
from sklearn_pgnn.trajectories.measured import (
    constant_outputs,
    of_measured,
    spans_of,
    where_measured,
)
from sklearn_pgnn.trajectories.noise import noise_level, rough_noise_level
from sklearn_pgnn.trajectories.record import Record, split_at_gaps

#: fewest samples of a window, and fewest windows of all records
MIN_SAMPLES, MIN_WINDOWS = 20, 8
#: default length of a window, as a share of the fastest output's dominant period
WINDOW_SHARE = 1 / 3
#: samples over which an output's rate is taken: the shortest lag above the noise is used
LAGS = (1, 2, 4, 8, 16, 32, 64)
#: the window that is a whole record
WHOLE = "trajectory"
#: most windows in which eigenvalues are taken
SOME_WINDOWS = 32
#: share of a power that is negligible
NEGLIGIBLE = 0.01
#: relative tolerance of a length compared with a clock
JITTER = 1e-6


@dataclass(frozen=True)
class WindowedRecords:
    """Records cut into windows.

    `period` is the dominant one of the outputs [s]. `told`, of shape (n_windows, n_states), are
    initial states that are known and not to be fitted, NaN where not. `steps_are_told` is whether
    the user or the model says how many integration steps are made.
    """

    windows: ShootingWindows
    states: StateEstimator
    period: float
    told: np.ndarray | None = None
    steps_are_told: bool = False


def window_records(
    model: PhysicsModel,
    records: tuple[Record, ...],
    *,
    window_length: float | str | None = None,
    noise_std=None,
    hold: str | None = None,
    substeps: int | None = None,
    threads: int = 1,
    levels: np.ndarray | None = None,
) -> WindowedRecords:
    """Cut records into windows and get ready to estimate their initial states."""
    hold = hold_of(model, hold)
    substeps = model.simulation.get("substeps") if substeps is None else substeps
    method = model.simulation.get("method")
    t = np.concatenate([record.t for record in records])
    u = np.ascontiguousarray(np.concatenate([record.u for record in records]), dtype=float)
    y = np.ascontiguousarray(np.concatenate([record.y for record in records]), dtype=float)
    bounds = np.concatenate([[0], np.cumsum([record.t.size for record in records])])
    scale = read_noise_std(noise_std, list(model.outputs))
    if scale is None:
        levels = noise_levels(records) if levels is None else levels
        scale = output_noise(records, levels)
    whole = ShootingWindows(t, u, y, bounds, bounds[:-1], np.diff(bounds), scale, hold, 1, threads)
    unknown = np.full(len(model.states), np.nan)
    told = [unknown if record.x0 is None else record.x0 for record in records]
    states = StateEstimator(model, whole, told)
    period = dominant_period(records, levels)
    if window_length == WHOLE:
        windows = replace(whole, blocks=-(-MIN_WINDOWS // len(records)))
    elif window_length is None:
        windows = cut(whole, period * WINDOW_SHARE)
    else:
        windows = cut_exactly(whole, check_length(whole, window_length))
    windows = replace(windows, substeps=int(substeps or 1), method=method or EXPLICIT)
    windows = in_enough_steps(model, windows, states, substeps is not None, method)
    states.windows = windows
    find_starts(model, cut(windows, period * WINDOW_SHARE), states)
    windows = replace(windows, states=tuple(model.states))
    known = np.array(told) if window_length == WHOLE else None
    return WindowedRecords(windows, states, period, known, substeps is not None)


def without_gaps(records: tuple[Record, ...], window_length=None) -> tuple[Record, ...]:
    """Cut records at gaps that are longer than a window."""
    if window_length == WHOLE:
        return records
    if not isinstance(window_length, Real):
        window_length = WINDOW_SHARE * dominant_period(records)
    return split_at_gaps(records, float(window_length), MIN_SAMPLES)


def noise_levels(records) -> np.ndarray:
    """Estimate the noise of every output in every record, of shape (n_records, n_outputs)."""
    return np.array([[noise_level(column, r.t) for column in r.y.T] for r in records])


def output_noise(records, levels: np.ndarray | None = None) -> np.ndarray:
    r"""Estimate the noise of every output, never below that of its rounding, :math:`q/\sqrt{12}`.

    Nor is it below a millionth of its standard deviation. Records in which an output never changes
    tell nothing of its noise. If none else is there, it counts as 1 in the output's unit; see
    `warn_of_constant_outputs`.
    """
    y = np.concatenate([record.y for record in records])
    spread = of_measured(np.nanstd, y)
    differ = spans_of(y) > 0  # a spread may be rounding
    levels = noise_levels(records) if levels is None else levels
    usual = of_measured(np.nanmedian, np.where(constant_outputs(records), np.nan, levels))
    steps = [step_of([record.y[:, i] for record in records]) for i in range(y.shape[1])]
    rounding = np.where(differ, steps, 0.0) / np.sqrt(12)
    return np.fmax(np.fmax(usual, rounding), np.where(differ, 1e-6 * spread, 1.0))


def dominant_period(records, levels: np.ndarray | None = None) -> float:
    r"""Return the shortest dominant period of the outputs [s].

    It is :math:`2\pi\,\mathrm{rms}(y)/\mathrm{rms}(\dot y)`. The differences are taken over a
    stretch long enough that noise does not matter.
    """
    duration = max(record.t[-1] - record.t[0] for record in records)
    columns = range(records[0].y.shape[1])
    known = [None if levels is None else levels[:, column] for column in columns]
    return float(min(duration, *map(partial(_period, records), columns, known)))


def _period(records, column: int, levels) -> float:
    """Return the dominant period of one output; infinite where noise hides its rate everywhere.

    Most noise is so small that a rough estimate will do; a fine one is made where that matters.
    """
    signal, rate, floor = _powers(records, column, _each(rough_noise_level, records, column))
    if not floor < NEGLIGIBLE * rate:
        fine = _each(noise_level, records, column) if levels is None else levels
        signal, rate, floor = _powers(records, column, fine)
    return float(2 * np.pi * np.sqrt(signal / rate)) if rate > 0 else np.inf


def _each(estimate, records, column: int) -> list[float]:
    """Estimate the noise of one output in every record."""
    return [estimate(record.y[:, column], record.t) for record in records]


def _powers(records, column: int, levels) -> np.ndarray:
    """Return the powers of an output, of its rate, and of noise in the rate, times the samples."""
    noise = np.median(levels)
    return np.sum([_powers_of(record, column, noise) for record in records], axis=0)


def _powers_of(record, column: int, noise: float) -> np.ndarray:
    """Return the powers of one record.

    The rate is taken over the shortest lag at which it rises above this record's part of noise.
    """
    y, t = record.y[:, column], record.t
    for lag in LAGS:
        width = t[lag:] - t[:-lag]
        rate = (y[lag:] - y[:-lag]) / width
        good = np.isfinite(rate)
        power, floor = np.sum(rate[good] ** 2), np.sum(2 * (noise / width[good]) ** 2)
        if t.size > 4 * lag and power > 1.5 * floor:
            return np.array([np.nanvar(y) * good.sum(), power - floor, floor])
    return np.zeros(3)


def cut(
    whole: ShootingWindows,
    length: float,
    min_windows: int = MIN_WINDOWS,
    min_samples: int = MIN_SAMPLES,
) -> ShootingWindows:
    """Cut every record into windows of about equal length."""
    durations = record_durations(whole)
    measured = np.add.reduceat(where_measured(whole.y), whole.bounds[:-1], dtype=int)
    most = np.maximum(measured // min_samples, 1)
    counts = np.clip(np.rint(durations / length), 1, most).astype(int)
    while counts.sum() < min_windows and (counts < most).any():
        counts[np.argmax(np.where(counts < most, durations / counts, -np.inf))] += 1
    spans = zip(pairwise(whole.bounds), counts, strict=True)
    edges = [np.linspace(a, b, count + 1).astype(int) for (a, b), count in spans]
    off_steps = [_off_steps(whole.u, some) for some in edges]
    enough = sum(len(some) - 1 for some in off_steps) >= min_windows
    return _between(whole, off_steps if enough else edges)


def cut_exactly(whole: ShootingWindows, length: float) -> ShootingWindows:
    """Cut every record into windows of one length; the remainder at its end is one more."""
    edges = []
    for (a, b), duration in zip(pairwise(whole.bounds), record_durations(whole), strict=True):
        t = whole.t[a:b]
        # half a sample of slack: a rounded clock moves no sample into the window before
        ends = t[0] + length * np.arange(1, int(duration / length) + 1) - 0.5 * duration / t.size
        mine = [0]
        for edge in np.searchsorted(t, ends).tolist():
            if min(edge - mine[-1], t.size - edge) >= MIN_SAMPLES:
                mine.append(edge)
        edges.append(a + np.array([*mine, t.size]))
    return _between(whole, [_off_steps(whole.u, some) for some in edges])


def _off_steps(u: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Move edges by a part of a window, which makes the outer windows longer, off an input's steps.

    An input that steps at edges only is constant in every window, like a state that begins there.
    """
    steps = np.diff(u[edges[0] : edges[-1]], axis=0) ** 2
    steps /= np.maximum(steps.sum(axis=0), np.finfo(float).tiny)

    def lost(some: np.ndarray) -> float:
        return float(steps[some[1:-1] - edges[0] - 1].sum(axis=0).max(initial=0.0))

    if len(edges) < 5 or lost(edges) <= 0.5:
        return edges
    parts = (np.diff(edges[1:-1]) // part for part in (2, 3, 4))
    return min((edges, *(np.r_[edges[0], edges[1:-2] + p, edges[-1]] for p in parts)), key=lost)


def _between(whole: ShootingWindows, edges) -> ShootingWindows:
    """Return the windows between edges, record by record."""
    starts = np.concatenate([some[:-1] for some in edges])
    return replace(whole, starts=starts, lengths=np.concatenate([np.diff(some) for some in edges]))


def record_durations(windows: ShootingWindows) -> np.ndarray:
    """Return the duration of every record [s], its last sample's interval included."""
    return _durations(windows.t, windows.bounds[:-1], np.diff(windows.bounds))


def sample_steps(windows: ShootingWindows) -> np.ndarray:
    """Return the sample intervals of all records [s]."""
    return np.concatenate([np.diff(windows.t[a:b]) for a, b in pairwise(windows.bounds)])


def median_window_length(windows: ShootingWindows) -> float:
    """Return the median length of windows [s], each on its own record's clock."""
    return float(np.median(_durations(windows.t, windows.starts, windows.lengths)))


def _durations(t, starts, lengths) -> np.ndarray:
    return (t[starts + lengths - 1] - t[starts]) * lengths / np.maximum(lengths - 1, 1)


def check_length(whole: ShootingWindows, window_length) -> float:
    """Return the length that a user wants windows to have, or raise `OptionError`."""
    durations = record_durations(whole)
    least = float(np.max(MIN_SAMPLES * durations / np.diff(whole.bounds)))
    least, most = min(least, durations.max()), float(durations.max())
    known = isinstance(window_length, Real) and not isinstance(window_length, bool)
    if not known or not least * (1 - JITTER) <= window_length <= most * (1 + JITTER):
        raise OptionError(
            f"window_length: expected a length from {least:.4g} s ({MIN_SAMPLES} samples) to "
            f"{most:.4g} s (the longest record), got {window_length!r}. Remedy: choose one of "
            f"these, or leave it out."
        )
    return float(window_length)


def in_enough_steps(
    model: PhysicsModel,
    windows: ShootingWindows,
    states: StateEstimator,
    is_told: bool = False,
    method: str | None = None,
) -> ShootingWindows:
    """Return windows with steps in which the outputs hardly change; told ones with stable steps."""
    fast, x = course(model, windows, states)
    if is_told:
        steps = given_steps(windows.substeps, method, fast)
    else:
        steps = enough_substeps(model, windows, x[windows.starts], fast, method)
    return replace(windows, **steps._asdict())


def course(
    model: PhysicsModel, windows: ShootingWindows, states: StateEstimator
) -> tuple[float, np.ndarray]:
    """Return how fast a model is along the records, see `fastest`, and its states there.

    States that are simulated are so in stable steps.
    """
    alike = copy(states)
    alike.windows = windows
    x = alike.values(model)
    fast = speed_along(model, windows, x)
    if fast > STABLE * windows.substeps and states.hidden(model):
        alike.windows = replace(windows, method=IMPLICIT)
        x = alike.values(model)
        fast = speed_along(model, windows, x)
    return fast, x


def speed_in_windows(model: PhysicsModel, windows: ShootingWindows, fit: Evaluation) -> float:
    """Return how fast a model is where it goes in windows, some of them if they are many.

    Measured states may be where a simulation never is, as beyond the noise about rest.
    """
    acting, speeds = windows.acting_inputs(model), [0.0]
    for w in np.unique(np.linspace(0, len(windows) - 1, SOME_WINDOWS).astype(int)):
        rows = slice(windows.starts[w], windows.starts[w] + windows.lengths[w])
        options = windows.options_in(int(windows.record[w]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SimulationWarning)
            run = simulate_acting(model, windows.t[rows], acting[rows], fit.x0[w], **options)
        speeds.append(fastest(model, run.t, acting[rows], run.x, windows.usual_intervals[w]))
    return max(speeds)


def speed_along(model: PhysicsModel, windows: ShootingWindows, x: np.ndarray) -> float:
    """Return the largest eigenvalue times step along records, in a step for a usual interval."""
    acting, speeds = windows.acting_inputs(model), [0.0]
    for a, b in pairwise(windows.bounds):
        t = windows.t[a:b]
        speeds.append(fastest(model, t, acting[a:b], x[a:b], usual_interval(t)))
    return max(speeds)


def enough_substeps(
    model: PhysicsModel,
    windows: ShootingWindows,
    x0: np.ndarray,
    fast: float = 0.0,
    method: str | None = None,
) -> Steps:
    """Return steps in which a model's outputs change by less than a tenth of the noise."""

    def run(steps: Steps):
        return evaluate(model, replace(windows, **steps._asdict()), x0, ()).residual

    def change(coarse, finer):
        with warnings.catch_warnings():  # overflow: the substeps are too coarse
            warnings.simplefilter("ignore", RuntimeWarning)
            return np.sqrt(np.nanmean(((finer - coarse) / windows.scale) ** 2)) / 0.1

    return enough_steps(run, change, fast, min(windows.substeps, MAX_SUBSTEPS), method)


#: another start must lower the squares of a record's first window to this share
CLEARLY = 1 / 2
#: quantiles of a simulation in which hidden states are tried as starts
PLACES = (0.25, 0.5, 0.75, 0.95)


def find_starts(model: PhysicsModel, windows: ShootingWindows, states: StateEstimator) -> None:
    """Start hidden states at typical values, if a record's first window is clearly fitted better.

    A model's own initial state may be a poor starting point: in an empty tank the outflow has no
    slope over the level, and no small step leads away from there. Such a start is always left.
    """
    names = list(model.states)
    hidden = [names.index(state) for state in states.hidden(model)]
    unknown = [[i for i in hidden if not np.isfinite(s[names[i]])] for s in states.starts]
    if not any(unknown):
        return
    first = windows.select(np.searchsorted(windows.starts, windows.bounds[:-1]))
    usual = states.estimate(model)
    here = usual.x[windows.bounds[:-1]]
    begun = fit_windows(model, first, (), here, usual.spread)
    least = np.full(len(first), np.inf)
    for place in PLACES:
        there = here.copy()
        for r, (a, b) in enumerate(pairwise(windows.bounds)):
            there[r, unknown[r]] = np.quantile(usual.x[a:b, unknown[r]], place, axis=0)
        tried = fit_windows(model, first, (), there, usual.spread)
        squares = tried.evaluation.squares
        clear = squares < CLEARLY * begun.evaluation.squares
        better = (squares < least) & (clear | _is_stuck(begun, tried, unknown))
        for r in np.flatnonzero(better).tolist():
            least[r] = squares[r]
            states.starts[r].update({names[i]: tried.x0[r, i] for i in unknown[r]})


def _is_stuck(begun: WindowFit, tried: WindowFit, unknown: list[list[int]]) -> np.ndarray:
    """Return for every window whether small changes of a state have no effect there only."""
    here, there = (np.einsum("wii->wi", fit.evaluation.gram) > 0 for fit in (begun, tried))
    lost = ~here & there
    return np.array([bool(lost[r, i].any()) for r, i in enumerate(unknown)])
