"""The data of a diagnosis: windows, estimated states and the scales of the signals."""

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

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
from sklearn_pgnn.estimation.without_model import free_values, squares_without_model
from sklearn_pgnn.exceptions import OptionError, RecordError
from sklearn_pgnn.physics.effect import Scales
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.places import signals_at_ports
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.record_windows import (
    MIN_SAMPLES,
    WINDOW_SHARE,
    cut,
    cut_exactly,
    median_window_length,
    record_durations,
    sample_steps,
    window_records,
)
from sklearn_pgnn.simulation.state_estimate import StateEstimator
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate
from sklearn_pgnn.trajectories.measured import spans_of, where_measured
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES as LEAST_SAMPLES
from sklearn_pgnn.trajectories.record import Record


@dataclass(frozen=True)
class EstimationProblem:
    """The records and the prior on which hypotheses are compared.

    `n_samples` is the number of measured values in all windows, `period` the dominant one of the
    outputs [s], and `min_samples` the fewest measured samples of a window.
    """

    prior: PhysicsModel
    windows: ShootingWindows
    states: StateEstimator
    scales: Scales
    n_samples: int
    period: float
    n_processes: int = 1
    min_samples: int = MIN_SAMPLES

    @property
    def typical_outputs(self) -> np.ndarray:
        """Root mean square of every output about its mean, of shape (n_outputs,)."""
        return np.array([self.scales.typical[output] for output in self.prior.outputs])

    @property
    def squares_about_mean(self) -> np.ndarray:
        """Squares of every output about its mean, in units of the noise."""
        measured = np.isfinite(self.windows.y[self.windows.rows]).sum(axis=0)
        return measured * (self.typical_outputs / self.windows.scale) ** 2

    @cached_property
    def squares_without_model(self) -> np.ndarray:
        """Squares of every output that no model is needed for, see `squares_without_model`."""
        return squares_without_model(self.windows, free_values(self.prior))

    @property
    def squares_of_no_use(self) -> np.ndarray:
        """Squares of every output at which a model says nothing about it.

        They are those about its mean. Windows of fewer samples than usual are so short that any
        start is nearer than the mean: there they are those that no model is needed for.
        """
        is_usual = self.min_samples >= MIN_SAMPLES
        return self.squares_about_mean if is_usual else self.squares_without_model

    @property
    def resolution(self) -> np.ndarray:
        """Accuracy limit of a simulation, in units of the noise, of shape (n_outputs,)."""
        return RESOLUTION * self.typical_outputs / self.windows.scale


def build_problem(
    model: PhysicsModel, records: tuple[Record, ...], n_processes: int = 1, **options: Any
) -> EstimationProblem:
    """Cut records into windows, see `window_records`, and estimate what a diagnosis needs."""
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


def _check_count(windows: ShootingWindows, window_length: float | str | None) -> None:
    """Raise `OptionError` if the user's windows are so long that there are too few."""
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
        f"{max(enough, default=least):.4g} s (at least {FOLDS} windows in all records: each is "
        f"predicted with parameters fitted to the others), got {window_length!r}. Remedy: choose "
        f"one of these, leave it out, or record longer."
    )


def shorter(problem: EstimationProblem, least: float = SHORTEST) -> EstimationProblem | None:
    """Return the problem with windows of half the length, or None if they would be too short."""
    length = problem.scales.window / 2
    if length < max(problem.min_samples * problem.scales.sample_time, least * problem.period):
        return None
    return recut(problem, length)


def with_few_samples(problem: EstimationProblem) -> EstimationProblem:
    """Return the problem with windows of as many values to judge by as initial states."""
    return replace(problem, min_samples=max(2 * free_values(problem.prior), LEAST_SAMPLES))


def in_usual_windows(problem: EstimationProblem) -> EstimationProblem | None:
    """Return the problem with windows of the usual length, or None if they are as long."""
    length = WINDOW_SHARE * problem.period
    usual = recut(replace(problem, min_samples=MIN_SAMPLES), length)
    is_longer = usual is not None and usual.scales.window > problem.scales.window
    return usual if is_longer else None


def longer(problem: EstimationProblem) -> EstimationProblem | None:
    """Return the problem with windows of twice the length, or None if they cannot be longer.

    There are at least `sklearn_pgnn.simulation.record_windows.MIN_WINDOWS`, if the records are long
    enough. Statistics keep blocks of the old length.
    """
    further = recut(problem, 2 * problem.scales.window)
    grows = further is not None and further.scales.window > problem.scales.window
    return further if grows else None


def recut(problem: EstimationProblem, length: float) -> EstimationProblem | None:
    """Return the problem with windows of another length, or None if that changes nothing."""
    windows = cut(problem.windows, length, min_samples=problem.min_samples)
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
    """Return the problem with another course of the inputs between samples."""
    return _simulated(problem, hold=hold)


def with_substeps(
    problem: EstimationProblem, substeps: int, method: str | None = None
) -> EstimationProblem:
    """Return the problem with other integration steps between samples."""
    method = method or problem.windows.method
    return _simulated(problem, substeps=substeps, method=method)


def on_one_thread(problem: EstimationProblem) -> EstimationProblem:
    """Return the problem for a process that has one thread to simulate on."""
    return replace(_simulated(problem, threads=1), n_processes=1)


def _simulated(problem: EstimationProblem, **options: Any) -> EstimationProblem:
    states = copy(problem.states)
    states.windows = windows = replace(problem.windows, **options)
    return replace(problem, windows=windows, states=states)


@dataclass(frozen=True)
class Subsample:
    """Some of the samples of a problem, for a first fit.

    `which` are the indices of its windows in the problem. Every `factor`-th sample was kept:
    windows are thinned where the record is sampled faster than the model needs.
    """

    windows: ShootingWindows
    which: np.ndarray
    factor: int

    @property
    def stepped(self) -> ShootingWindows:
        """The windows with the problem's step size: an effect's state may be as fast."""
        return replace(self.windows, substeps=self.factor * self.windows.substeps)


def subsample_windows(problem: EstimationProblem, residual: np.ndarray) -> Subsample:
    """Take about `SAMPLES` samples: every n-th of a window, then every m-th window.

    If the windows are few, and so long that this is still far more, their beginnings are taken,
    unless these have less than half of their share of the error: what is wrong must be seen.
    """
    factor = _thinning(problem)
    thinned = problem.windows.thin(factor) if factor > 1 else problem.windows
    squares = np.nansum(residual**2, axis=1)
    of_windows = problem.windows.sum_blocks(squares[:, None]).sum(axis=(1, 2))
    which = np.sort(worst_first(of_windows)[:: one_of(thinned)])
    few = thinned.select(which)
    period = math.ceil(problem.period / (factor * problem.scales.sample_time))
    # half more than the budget is what `one_of` may leave by rounding
    most = max(3 * SAMPLES // (2 * len(few)), period, MIN_SAMPLES)
    begun = replace(few, lengths=np.minimum(few.lengths, most))
    spans = zip(problem.windows.starts[which], factor * begun.lengths, strict=True)
    told = sum(squares[a : a + n].sum() for a, n in spans)
    share = begun.lengths.sum() / few.lengths.sum()
    hidden = told < 0.5 * share * of_windows[which].sum()
    return Subsample(few if hidden else begun, which, factor)


def one_of(windows: ShootingWindows) -> int:
    """Return the number of windows of which one is taken, for about `SAMPLES` samples."""
    step = round(windows.lengths.sum() / SAMPLES)
    return max(1, min(step, len(windows) // STRETCHES))


def worst_first(squares: np.ndarray) -> np.ndarray:
    """Order windows by their error, the largest first."""
    return np.argsort(-squares, kind="stable")


def _thinning(problem: EstimationProblem) -> int:
    """Return the thinning factor at which the prior's simulation hardly changes."""
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


def _scales(model: PhysicsModel, windows: ShootingWindows, x: np.ndarray) -> Scales:
    """Measure the signals."""
    firsts, lasts = windows.bounds[:-1], windows.bounds[1:] - 1
    table = {name: x[:, i] for i, name in enumerate(model.states)}
    samples = sample_table(model, windows, x)
    for name, signal in signals_at_ports(model).items():
        table[name] = evaluate_samples(signal, samples, windows.t.size)
    rate = {name: _rate(windows, values) for name, values in table.items()}
    tones, ripples = find_lines(model, windows, x)
    table |= {name: windows.u[:, i] for i, name in enumerate(model.inputs)}
    table |= {name: windows.y[:, i] for i, name in enumerate(model.outputs)}
    return Scales(
        typical={name: _positive(np.nanstd(values)) for name, values in table.items()},
        peak={name: _positive(np.nanmax(np.abs(values))) for name, values in table.items()},
        rate={name: _positive(value) for name, value in rate.items()},
        sample_time=float(np.median(sample_steps(windows))),
        window=median_window_length(windows),
        duration=float(np.max(windows.t[lasts] - windows.t[firsts])),
        latest=float(np.abs(windows.t).max()),
        tones=tones,
        ripples=ripples,
        extremes={n: (float(np.nanmin(v)), float(np.nanmax(v))) for n, v in table.items()},
    )


def _rate(windows: ShootingWindows, values: np.ndarray) -> float:
    r"""Return :math:`\sqrt{\overline{\dot x^2}}` of a state, the mean taken over time."""
    widths = np.concatenate([np.gradient(windows.t[a:b]) for a, b in pairwise(windows.bounds)])
    squares = slopes_by_record(windows, values) ** 2
    return float(np.sqrt(np.average(squares, weights=widths)))


def _positive(value: float) -> float:
    return float(value) if np.isfinite(value) and value > 0 else 1e-12


def check_records(model: PhysicsModel, records: tuple[Record, ...]) -> None:
    """Raise `RecordError` if records are insufficient for a diagnosis."""
    outputs = [record.y for record in records if record.y is not None]
    sizes = [int(where_measured(y).sum()) for y in outputs]
    windows = sum(size // MIN_SAMPLES for size in sizes)
    if windows < FOLDS:
        raise RecordError(
            f"expected records of at least {FOLDS * MIN_SAMPLES} measured samples to diagnose "
            f"{model.name!r}, at least {FOLDS} windows of {MIN_SAMPLES} samples, since each window "
            f"is predicted with parameters fitted to the others; got {sum(sizes)} samples, enough "
            f"for {windows}. Remedy: record longer, more often, or at a higher rate."
        )
    for name, column in zip(model.outputs, np.concatenate(outputs).T, strict=True):
        if not np.isfinite(column).any():
            raise RecordError(
                f"output {name!r}: expected measured values, got none. Remedy: leave the output "
                f"out of the model, or add its column."
            )
        if spans_of(column[:, None])[0] == 0:
            said = f"{float(np.nanmax(column)):.4g} {model.unit(name)}".rstrip()
            raise RecordError(
                f"output {name!r}: expected a signal that changes, got {said} in every sample of "
                f"every record. Remedy: look at the sensor and its cable; record the machine in "
                f"motion, or leave the output out of the model."
            )


def with_prior_spreads(model: PhysicsModel, prior: PhysicsModel) -> PhysicsModel:
    """Return an extended model whose parameters have the spread they had in the prior."""
    changes = {
        name: model.parameters[name].with_spread(prior.parameters[name].spread)
        for name in prior.parameters
    }
    return model.with_parameters(**changes)
