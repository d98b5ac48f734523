"""Data quality: faults of the records, checked before any cause is named."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.effects.differences import is_mark
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.clock import find_gaps, find_jitter, find_unused_samples
from sklearn_pgnn.record_quality.excitation import (
    find_blind_parameters,
    find_dull_input,
    find_first_steps,
)
from sklearn_pgnn.record_quality.feedback import find_closed_loop, find_state_feedback
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.refits import find_drift, find_early_output, find_uneven_noise
from sklearn_pgnn.record_quality.sensors import (
    find_clipping,
    find_dead_sensor,
    find_held_samples,
    find_outliers,
    find_quantisation,
)
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES, MIN_WINDOWS, median_window_length
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows
from sklearn_pgnn.trajectories.record import (
    REMEDY,
    Record,
    remarks_on_repeats,
    repeated_records,
)


def check_data_quality(
    problem: EstimationProblem,
    names: Sequence[str],
    whole: Sequence[Record],
    base: WindowFit,
    final: WindowFit,
    best: WindowFit | None = None,
    each_step: Callable[[], bool | None] = lambda: None,
) -> Iterator[Finding]:
    """Yield the faults of the records; a check is wrong in at most one of a thousand sets."""
    windows, model = problem.windows, problem.prior
    outputs = _signals(model, model.outputs, windows, windows.y, names)
    inputs = _signals(model, model.inputs, windows, windows.u, names)
    driven = [signal for signal in inputs if not is_mark(model, signal.name)]
    left = _signals(model, model.outputs, windows, final.evaluation.residual, names)
    clocks = [record.t for record in whole]
    checks: list[Callable[[], Sequence[Finding | None]]] = [
        lambda: [find_few_windows(windows), *find_repeats(whole)],
        lambda: [*map(find_dull_input, driven), find_first_steps(driven)],
        lambda: find_blind_parameters(problem, base),
        lambda: [
            find_gaps(clocks, [record.name for record in whole]),
            find_jitter(outputs),
            find_unused_samples(clocks, windows.t.size),
        ],
        *(partial(_of_signal, *pair) for pair in zip(outputs, left, strict=True)),
        lambda: [find_closed_loop(outputs, inputs, left)],
        lambda: find_state_feedback(problem, final, each_step),
        lambda: [find_early_output(problem, base, final, each_step)],
        lambda: [find_drift(problem, names, base, best or final, each_step)],
    ]
    for check in checks:
        each_step()
        yield from (finding for finding in check() if finding is not None)


def find_repeats(whole: Sequence[Record]) -> list[Finding]:
    """Return a finding for every record that has the values of another one."""
    pairs = zip(repeated_records(whole), remarks_on_repeats(whole), strict=True)
    return [Finding("repeated record", b, said, 1.0, REMEDY) for (_, b), said in pairs]


def _of_signal(signal: Signal, rest: Signal) -> list[Finding | None]:
    """Check an output, given what the model leaves of it."""
    size = float(np.sqrt(np.nanmean(rest.values**2)))
    return [
        find_dead_sensor(signal, rest),
        find_clipping(signal),
        find_quantisation(signal, size),
        find_held_samples(signal),
        find_outliers(signal, rest),
        find_uneven_noise(signal),
    ]


def clipped_outputs(problem: EstimationProblem) -> tuple[str, ...]:
    """Return the outputs that stand still at an end of their range though they are noisy elsewhere.

    That is the sensor: the machine itself may stand still at its stop, but its noise would not.
    """
    model, windows = problem.prior, problem.windows
    names = [""] * (windows.bounds.size - 1)
    outputs = _signals(model, model.outputs, windows, windows.y, names)
    return tuple(s.name for s in outputs if s.tells_equals and find_clipping(s))


def _signals(
    model: PhysicsModel,
    quantities: Iterable[str],
    windows: ShootingWindows,
    values: np.ndarray,
    names: Sequence[str],
) -> list[Signal]:
    cuts = windows.bounds[1:-1]
    times = np.split(windows.t, cuts)
    return [
        Signal(name, model.unit(name), np.split(values[:, i], cuts), times, names)
        for i, name in enumerate(quantities)
    ]


def find_few_windows(windows: ShootingWindows) -> Finding | None:
    """Return a finding if the windows are too few for a held-out evaluation."""
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
