"""From records to windows: the records themselves say how long and how noisy."""

import warnings
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.record_start import find_starts
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.state_estimate import StateEstimator
from sklearn_pgnn.simulation.windows import Windows, evaluate
from sklearn_pgnn.trajectories.gaps import split_at_gaps
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.trajectories.noise import noise_level

#: a window holds at least so many samples, and there are at least so many windows
MIN_SAMPLES, MIN_WINDOWS = 20, 8
#: share of the dominant period of the fastest output that makes a window
WINDOW_SHARE = 1 / 3
#: samples over which an output's rate is taken, the fewest that noise does not hide first
LAGS = (1, 2, 4, 8, 16, 32, 64)
MAX_SUBSTEPS = 32
#: the window that is a whole record
WHOLE = "trajectory"


@dataclass(frozen=True)
class WindowedRecords:
    """Records cut into windows.

    Parameters
    ----------
    windows : Windows
        The windows, with the noise of every output.
    states : StateEstimator
        Estimates their initial states.
    period : float
        Dominant period of the outputs [s].
    told : ndarray of shape (n_windows, n_states), optional
        Initial states that are known and not to be fitted, NaN where not.
    """

    windows: Windows
    states: StateEstimator
    period: float
    told: np.ndarray | None = None


def window_records(
    model: PhysicsModel,
    records: tuple[Record, ...],
    *,
    window: float | str | None = None,
    noise=None,
    hold: str | None = None,
    substeps: int | None = None,
    threads: int = 1,
) -> WindowedRecords:
    """Cut records into windows and get ready to estimate their initial states.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    records : tuple of Record
        Measured trajectories.
    window : float or "trajectory", optional
        Window length [s], or every record in one window; by default a third of the dominant
        period of the outputs.
    noise : array-like of shape (n_outputs,), optional
        Standard deviation of every output's noise; by default estimated.
    hold : {"zoh", "foh"}, optional
        How inputs run between samples; by default as the model says, else held.
    substeps : int, optional
        Integration steps from sample to sample; by default as the model says, else as many as
        accuracy needs.
    threads : int, default=1
        Threads to simulate on.

    Returns
    -------
    WindowedRecords
        The windows.
    """
    hold = hold_of(model, hold)
    substeps = model.simulation.get("substeps") if substeps is None else substeps
    t = np.concatenate([record.t for record in records])
    u = np.ascontiguousarray(np.concatenate([record.u for record in records]), dtype=float)
    y = np.ascontiguousarray(np.concatenate([record.y for record in records]), dtype=float)
    bounds = np.concatenate([[0], np.cumsum([record.t.size for record in records])])
    scale = output_noise(records) if noise is None else np.asarray(noise, dtype=float).ravel()
    whole = Windows(t, u, y, bounds, bounds[:-1], np.diff(bounds), scale, hold, 1, threads)
    told = [_told_start(model, record) for record in records]
    states = StateEstimator(model, whole, told)
    period = dominant_period(records)
    if window == WHOLE:
        windows = replace(whole, pieces=-(-MIN_WINDOWS // len(records)))
    else:
        windows = cut(whole, period * WINDOW_SHARE if window is None else float(window))
    if substeps is None:
        substeps = _enough_substeps(model, windows, states.estimate(model).x)
    windows = replace(windows, substeps=int(substeps))
    states.windows = windows
    find_starts(model, cut(windows, period * WINDOW_SHARE), states)
    return WindowedRecords(windows, states, period, np.array(told) if window == WHOLE else None)


def without_gaps(records: tuple[Record, ...], window=None) -> tuple[Record, ...]:
    """Cut records where nothing was recorded for longer than a window, which bridges no such gap.

    Parameters
    ----------
    records : tuple of Record
        Measured trajectories.
    window : float or "trajectory", optional
        As in `window_records`.

    Returns
    -------
    tuple of Record
        See `sklearn_pgnn.trajectories.gaps.split_at_gaps`.
    """
    if window == WHOLE:
        return records
    length = window if isinstance(window, Real) else WINDOW_SHARE * dominant_period(records)
    return split_at_gaps(records, float(length), MIN_SAMPLES)


def _told_start(model, record) -> np.ndarray:
    """Give the initial state a record tells, NaN where it does not."""
    return np.full(len(model.states), np.nan) if record.x0 is None else record.x0


def output_noise(records) -> np.ndarray:
    """Estimate the noise of every output, never below a millionth of its range."""
    y = np.concatenate([record.y for record in records])
    spread = np.nanstd(y, axis=0)
    levels = [[noise_level(column, record.t) for column in record.y.T] for record in records]
    return np.maximum(np.median(levels, axis=0), np.where(spread > 0, 1e-6 * spread, 1.0))


def dominant_period(records) -> float:
    r"""Give the shortest dominant period of the outputs [s].

    It is :math:`2\pi\,\mathrm{rms}(y)/\mathrm{rms}(\dot y)`. The differences are taken over a
    stretch long enough that noise does not matter.
    """
    duration = max(record.t[-1] - record.t[0] for record in records)
    columns = range(records[0].y.shape[1])
    return float(min(duration, *(_period(records, column) for column in columns)))


def _period(records, column: int) -> float:
    """Return the dominant period of one output; infinite where noise hides its rate everywhere."""
    noise = np.median([noise_level(record.y[:, column], record.t) for record in records])
    powers = np.sum([_powers(record, column, noise) for record in records], axis=0)
    return float(2 * np.pi * np.sqrt(powers[0] / powers[1])) if powers[1] > 0 else np.inf


def _powers(record, column: int, noise: float) -> np.ndarray:
    """Return the powers of an output and of its rate, times the samples, of one record.

    The rate is taken over the shortest lag at which it rises above this record's part of noise.
    """
    y, t = record.y[:, column], record.t
    for lag in LAGS:
        width = t[lag:] - t[:-lag]
        rate = (y[lag:] - y[:-lag]) / width
        good = np.isfinite(rate)
        power, floor = np.sum(rate[good] ** 2), np.sum(2 * (noise / width[good]) ** 2)
        if t.size > 4 * lag and power > 1.5 * floor:
            return np.array([np.nanvar(y) * good.sum(), power - floor])
    return np.zeros(2)


def cut(whole: Windows, length: float, min_windows: int = MIN_WINDOWS) -> Windows:
    """Cut every record into windows of about equal length.

    Parameters
    ----------
    whole : Windows
        One window a record.
    length : float
        Wanted length [s]; at least `MIN_SAMPLES` samples.
    min_windows : int, default=8
        The length is short enough for so many windows in all.

    Returns
    -------
    Windows
        The windows.
    """
    durations = whole.t[whole.bounds[1:] - 1] - whole.t[whole.bounds[:-1]]
    length = min(length, durations.sum() / min_windows)
    starts, lengths = [], []
    for a, b, duration in zip(whole.bounds[:-1], whole.bounds[1:], durations, strict=True):
        count = max(1, min(round(duration / length), (b - a) // MIN_SAMPLES))
        edges = np.linspace(a, b, count + 1).astype(int)
        starts.append(edges[:-1])
        lengths.append(np.diff(edges))
    return replace(whole, starts=np.concatenate(starts), lengths=np.concatenate(lengths))


def _enough_substeps(model, windows, x) -> int:
    """Double the substeps until the prior's outputs change by less than a tenth of the noise."""
    x0 = x[windows.starts]
    substeps = 1
    residual = evaluate(model, replace(windows, substeps=1), x0, ()).residual
    while substeps < MAX_SUBSTEPS:
        finer = evaluate(model, replace(windows, substeps=2 * substeps), x0, ()).residual
        with warnings.catch_warnings():  # of what leaves the finite numbers nothing is learned
            warnings.simplefilter("ignore", RuntimeWarning)
            difference = np.sqrt(np.nanmean(((finer - residual) / windows.scale) ** 2))
        if np.isfinite(difference) and difference < 0.1:
            return substeps
        substeps, residual = 2 * substeps, finer
    return substeps
