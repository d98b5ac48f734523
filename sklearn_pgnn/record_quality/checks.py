"""Data quality: faults of the records, checked before any cause is named."""

from collections.abc import Sequence

import numpy as np

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.record_quality.clipping import find_clipping
from sklearn_pgnn.record_quality.clock import find_gaps, find_jitter, find_unused_samples
from sklearn_pgnn.record_quality.drift import find_drift, find_uneven_noise
from sklearn_pgnn.record_quality.excitation import (
    find_blind_parameters,
    find_dull_input,
    find_first_steps,
)
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.noise_feedback import find_closed_loop
from sklearn_pgnn.record_quality.quantisation import find_quantisation
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.record_quality.single_samples import find_held_samples, find_outliers
from sklearn_pgnn.record_quality.state_feedback import find_state_feedback
from sklearn_pgnn.record_quality.synchrony import find_early_output
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, MIN_WINDOWS, median_window_length
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.trajectories.record import Record


def check_data_quality(
    problem: EstimationProblem,
    names: Sequence[str],
    whole: Sequence[Record],
    base: WindowFit,
    final: WindowFit,
    best: WindowFit | None = None,
) -> tuple[Finding, ...]:
    """Return the faults of the records that limit a diagnosis.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    names : sequence of str
        What the records are called.
    whole : sequence of Record
        The records as they were read, with their gaps.
    base, final : WindowFit
        The re-tuned prior and the extended model.
    best : WindowFit, optional
        With a formula for what no cause explains: it drifts less than one that lacks a part.

    Returns
    -------
    tuple of Finding
        The findings; empty if there are none.

    Notes
    -----
    Every check of one quantity gives a false alarm in at most one of a thousand faultless sets of
    records.
    """
    windows, model = problem.windows, problem.prior
    outputs = _signals(model, model.outputs, windows, windows.y, names)
    inputs = _signals(model, model.inputs, windows, windows.u, names)
    left = _signals(model, model.outputs, windows, final.evaluation.residual, names)
    found: list[Finding | None] = [find_few_windows(windows)]
    found += [*map(find_dull_input, inputs), find_first_steps(inputs)]
    found += find_blind_parameters(problem, base)
    clocks = [record.t for record in whole]
    found += [find_gaps(clocks, [record.name for record in whole]), find_jitter(outputs)]
    found.append(find_unused_samples(clocks, windows.t.size))
    for signal, rest in zip(outputs, left, strict=True):
        size = float(np.sqrt(np.nanmean(rest.values**2)))
        found += [find_clipping(signal), find_quantisation(signal, size)]
        found += [find_held_samples(signal), find_outliers(signal, rest), find_uneven_noise(signal)]
    found += [find_closed_loop(outputs, inputs, left), *find_state_feedback(problem, final)]
    found += [
        find_early_output(problem, base, final),
        find_drift(problem, names, base, best or final),
    ]
    return tuple(finding for finding in found if finding is not None)


def clipped_outputs(problem: EstimationProblem) -> tuple[str, ...]:
    """Return the outputs that stand still at an end of their range though they are noisy elsewhere.

    That is the sensor: the machine itself may stand still at its stop, but its noise would not.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.

    Returns
    -------
    tuple of str
        Outputs.
    """
    model, windows = problem.prior, problem.windows
    names = [""] * (windows.bounds.size - 1)
    outputs = _signals(model, model.outputs, windows, windows.y, names)
    return tuple(s.name for s in outputs if s.tells_equals and find_clipping(s))


def _signals(model, quantities, windows: ShootingWindows, values, names) -> list[Signal]:
    cuts = windows.bounds[1:-1]
    times = np.split(windows.t, cuts)
    return [
        Signal(name, model.unit(name), np.split(values[:, i], cuts), times, names)
        for i, name in enumerate(quantities)
    ]


def find_few_windows(windows: ShootingWindows) -> Finding | None:
    """Return a finding if the windows are too few for a held-out evaluation.

    Parameters
    ----------
    windows : ShootingWindows
        The windows of the diagnosis.

    Returns
    -------
    Finding or None
        What was found.
    """
    count = len(windows)
    if count >= MIN_WINDOWS:
        return None
    return Finding(
        "short records",
        "t",
        f"the records give only {count} windows of {median_window_length(windows):.3g} s, fewer "
        f"than {MIN_WINDOWS}: held-out errors, and so the verdict, are uncertain",
        float(count),
        f"record longer, so that at least {MIN_WINDOWS} windows of {MIN_SAMPLES} samples fit, or "
        f"choose shorter windows",
    )
