"""What a diagnosis works on: windows, estimated states and the scales of the signals."""

import math
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sklearn_pgnn.estimation.budgets import (
    FOLDS,
    RESOLUTION,
    SAMPLES,
    SHORTEST,
    SMALL_CHANGE,
    STRETCHES,
)
from sklearn_pgnn.estimation.spectral_lines import find_lines, slopes_by_record
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.physics.effect import Scales
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.record_windows import (
    MIN_SAMPLES,
    cut,
    cut_exactly,
    median_window_length,
    record_durations,
    window_records,
)
from sklearn_pgnn.simulation.state_estimate import StateEstimator
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate
from sklearn_pgnn.trajectories.record import Record


@dataclass(frozen=True)
class EstimationProblem:
    """The records and the prior on which hypotheses are compared.

    Parameters
    ----------
    prior : PhysicsModel
        The model as the engineer gave it.
    windows : ShootingWindows
        The records cut into windows, with the noise of every output.
    states : StateEstimator
        Estimates the initial states.
    scales : Scales
        How large the signals are.
    n_samples : int
        Number of measured values in all windows.
    period : float
        Dominant period of the outputs [s].
    n_processes : int, default=1
        Processes that fit hypotheses side by side.
    """

    prior: PhysicsModel
    windows: ShootingWindows
    states: StateEstimator
    scales: Scales
    n_samples: int
    period: float
    n_processes: int = 1

    @property
    def typical_outputs(self) -> np.ndarray:
        """Root mean square of every output about its mean, of shape (n_outputs,)."""
        return np.array([self.scales.typical[output] for output in self.prior.outputs])

    @property
    def resolution(self) -> np.ndarray:
        """What no simulation is finer than, in units of the noise, of shape (n_outputs,)."""
        return RESOLUTION * self.typical_outputs / self.windows.scale


def build_problem(
    model: PhysicsModel, records: tuple[Record, ...], n_processes: int = 1, **options
) -> EstimationProblem:
    """Cut records into windows and estimate what a diagnosis needs to know of them.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    records : tuple of Record
        Measured trajectories.
    n_processes : int, default=1
        Processes that fit hypotheses side by side.
    **options
        See `sklearn_pgnn.simulation.record_windows.window_records`.

    Returns
    -------
    EstimationProblem
        The problem.

    Raises
    ------
    OptionError
        If the length that the user wants windows to have leaves too few of them.
    """
    ground = window_records(model, records, **options)
    windows = ground.windows
    _check_count(windows, options.get("window_length"))
    scales = _scales(model, windows, ground.states.estimate(model).x)
    return EstimationProblem(
        model,
        windows,
        ground.states,
        scales,
        int(np.isfinite(windows.y).sum()),
        ground.period,
        n_processes,
    )


def _check_count(windows: ShootingWindows, window_length) -> None:
    """Raise `OptionError` where the user's windows are so long that too few are left."""
    if len(windows) >= FOLDS:
        return
    durations = record_durations(windows)
    steps = durations / np.diff(windows.bounds)
    ends = (durations - MIN_SAMPLES * steps)[:, None] / np.arange(1, FOLDS + 1)
    lengths = np.concatenate([durations, ends.ravel(), durations / FOLDS])
    enough = [x for x in lengths if x > 0 and len(cut_exactly(windows, x)) >= FOLDS]
    least = float(np.max(MIN_SAMPLES * steps))
    raise OptionError(
        f"window_length: expected a length from {least:.4g} s ({MIN_SAMPLES} samples) to "
        f"{max(enough, default=least):.4g} s ({FOLDS} windows in all records, for each is "
        f"judged by what the others taught), got {window_length!r}. Remedy: choose one of "
        f"these, leave it out, or record longer."
    )


def shorter(problem: EstimationProblem) -> EstimationProblem | None:
    """Return the problem with windows of half the length, or None where they would be too short."""
    length = problem.scales.window / 2
    if length < max(MIN_SAMPLES * problem.scales.sample_time, SHORTEST * problem.period):
        return None
    return recut(problem, length)


def longer(problem: EstimationProblem) -> EstimationProblem | None:
    """Return the problem with windows of twice the length, or None where they cannot be longer.

    There are always `sklearn_pgnn.simulation.record_windows.MIN_WINDOWS`, if the records make so
    many at all. Statistics stay with blocks of the old length.
    """
    further = recut(problem, 2 * problem.scales.window)
    grows = further is not None and further.scales.window > problem.scales.window
    return further if grows else None


def recut(problem: EstimationProblem, length: float) -> EstimationProblem | None:
    """Return the problem with windows of another length, or None where that changes nothing.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    length : float
        Length of the windows [s]; they are shorter where there would be fewer than
        `sklearn_pgnn.simulation.record_windows.MIN_WINDOWS`.

    Returns
    -------
    EstimationProblem or None
        The problem. Longer windows have more blocks, of about the old length.
    """
    windows = cut(problem.windows, length)
    if np.array_equal(windows.starts, problem.windows.starts):
        return None
    length = median_window_length(windows)
    blocks = max(1, round(problem.windows.blocks * length / problem.scales.window))
    return replace(
        problem,
        windows=replace(windows, blocks=blocks),
        scales=replace(problem.scales, window=length),
    )


def with_hold(problem: EstimationProblem, hold: str) -> EstimationProblem:
    """Return the problem with inputs that run otherwise between samples.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    hold : {"zoh", "foh"}
        How inputs run between samples.

    Returns
    -------
    EstimationProblem
        The same windows.
    """
    return _simulated(problem, hold=hold)


def with_substeps(problem: EstimationProblem, substeps: int) -> EstimationProblem:
    """Return the problem with so many integration steps from sample to sample."""
    return _simulated(problem, substeps=substeps)


def on_one_thread(problem: EstimationProblem) -> EstimationProblem:
    """Return the problem for a process that has one thread to simulate on."""
    return replace(_simulated(problem, threads=1), n_processes=1)


def _simulated(problem: EstimationProblem, **options) -> EstimationProblem:
    states = copy(problem.states)
    states.windows = windows = replace(problem.windows, **options)
    return replace(problem, windows=windows, states=states)


@dataclass(frozen=True)
class Subsample:
    """Some of the samples of a problem, for a first look.

    Parameters
    ----------
    windows : ShootingWindows
        Some windows, thinned where the record is sampled faster than the model needs.
    which : ndarray of int
        Which of the problem's windows they are.
    factor : int
        One sample of so many was kept.
    """

    windows: ShootingWindows
    which: np.ndarray
    factor: int

    @property
    def stepped(self) -> ShootingWindows:
        """The windows in the steps of the problem's: an effect's state may be as quick as these."""
        return replace(self.windows, substeps=self.factor * self.windows.substeps)


def subsample_windows(problem: EstimationProblem, squares: np.ndarray) -> Subsample:
    """Take about `SAMPLES` samples: every so many of a window, then every so many windows.

    Where the windows are few, and so long that these are far more, their beginnings are taken.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    squares : ndarray of shape (n_windows,)
        Error of every window; small and large ones are taken alike.

    Returns
    -------
    Subsample
        Some of its samples.
    """
    factor = _thinning(problem)
    thinned = problem.windows.thin(factor) if factor > 1 else problem.windows
    which = np.sort(worst_first(squares)[:: one_of(thinned)])
    few = thinned.select(which)
    period = math.ceil(problem.period / (factor * problem.scales.sample_time))
    # half more than the budget is what `one_of` may leave by rounding
    most = max(3 * SAMPLES // (2 * len(few)), period, MIN_SAMPLES)
    return Subsample(replace(few, lengths=np.minimum(few.lengths, most)), which, factor)


def one_of(windows: ShootingWindows) -> int:
    """Return of how many windows one is taken for about `SAMPLES` samples."""
    step = round(windows.lengths.sum() / SAMPLES)
    return max(1, min(step, len(windows) // STRETCHES))


def worst_first(squares: np.ndarray) -> np.ndarray:
    """Order windows by their error, the largest first."""
    return np.argsort(-squares, kind="stable")


def _thinning(problem: EstimationProblem) -> int:
    """Return of how many samples one is kept, the prior's simulation hardly changing by it."""
    windows, model, factor = problem.windows, problem.prior, 1
    x0 = problem.states.estimate(model).x[windows.starts]
    residual = evaluate(model, windows, x0, ()).residual
    simulated = replace(windows, y=windows.y - residual)
    while (
        windows.lengths.sum() > factor * SAMPLES
        and windows.lengths.min() >= 2 * factor * MIN_SAMPLES
    ):
        change = evaluate(model, simulated.thin(2 * factor), x0, ()).residual / windows.scale
        if not np.sqrt(np.nanmean(change**2)) < SMALL_CHANGE:
            break
        factor *= 2
    return factor


def _scales(model, windows, x) -> Scales:
    """Measure the signals."""
    firsts, lasts = windows.bounds[:-1], windows.bounds[1:] - 1
    steps = [np.diff(windows.t[a:b]) for a, b in pairwise(windows.bounds)]
    sample_time = float(np.median(np.concatenate(steps)))
    table = {name: x[:, i] for i, name in enumerate(model.states)}
    rate = {name: _rate(windows, values) for name, values in table.items()}
    tones, ripples = find_lines(model, windows, x)
    table |= {name: windows.u[:, i] for i, name in enumerate(model.inputs)}
    table |= {name: windows.y[:, i] for i, name in enumerate(model.outputs)}
    return Scales(
        typical={name: _positive(np.nanstd(values)) for name, values in table.items()},
        peak={name: _positive(np.nanmax(np.abs(values))) for name, values in table.items()},
        rate={name: _positive(value) for name, value in rate.items()},
        sample_time=sample_time,
        window=median_window_length(windows),
        duration=float(np.max(windows.t[lasts] - windows.t[firsts])),
        latest=float(np.abs(windows.t).max()),
        tones=tones,
        ripples=ripples,
        extremes={n: (float(np.nanmin(v)), float(np.nanmax(v))) for n, v in table.items()},
    )


def _rate(windows, values) -> float:
    r"""Return :math:`\sqrt{\overline{\dot x^2}}` of a state, the mean taken over time."""
    widths = np.concatenate([np.gradient(windows.t[a:b]) for a, b in pairwise(windows.bounds)])
    squares = slopes_by_record(windows, values) ** 2
    return float(np.sqrt(np.average(squares, weights=widths)))


def _positive(value) -> float:
    return float(value) if np.isfinite(value) and value > 0 else 1e-12


def check_records(model: PhysicsModel, records: tuple[Record, ...]) -> None:
    """Raise `RecordError` where records cannot carry a diagnosis."""
    sizes = [record.t.size for record in records]
    windows = sum(size // MIN_SAMPLES for size in sizes)
    if windows < FOLDS:
        raise RecordError(
            f"expected records of at least {FOLDS * MIN_SAMPLES} samples to diagnose "
            f"{model.name!r}, {FOLDS} windows of {MIN_SAMPLES}, for each is judged by what "
            f"the others taught; got {sum(sizes)} samples, which make {windows}. Remedy: record "
            f"longer, more often, or at a higher rate."
        )
    for name, column in zip(model.outputs, np.concatenate([r.y for r in records]).T, strict=True):
        if not np.isfinite(column).any():
            raise RecordError(
                f"output {name!r}: expected measured values, got none. Remedy: leave the output "
                f"out of the model, or add its column."
            )
        if not np.nanstd(column) > 0:
            raise RecordError(
                f"output {name!r}: expected a signal that changes, got a constant. Remedy: record "
                f"the machine in motion, or leave the output out of the model."
            )


def with_prior_spreads(model: PhysicsModel, prior: PhysicsModel) -> PhysicsModel:
    """Return an extended model whose parameters have the spread they had in the prior.

    Parameters
    ----------
    model, prior : PhysicsModel
        The extended model and what it came from.

    Returns
    -------
    PhysicsModel
        The extended model; a parameter that was freed is no longer.
    """
    changes = {
        name: model.parameters[name].with_spread(prior.parameters[name].spread)
        for name in prior.parameters
    }
    return model.with_parameters(**changes)
