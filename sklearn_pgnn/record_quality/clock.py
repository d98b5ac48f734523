"""The clock: samples that are missing from it, and steps that are uneven."""

from collections.abc import Sequence

import numpy as np

from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.limits import FINE, MOST, SHARE
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.trajectories.grid import grid_step
from sklearn_pgnn.trajectories.reader import MIN_SAMPLES


def find_gaps(times: Sequence[np.ndarray], records: Sequence[str]) -> Finding | None:
    """Find samples that are missing from a regular clock."""
    missing, first = 0, ""
    for t, record in zip(times, records, strict=True):
        steps, middle = np.diff(t), float(np.median(np.diff(t)))
        counts = np.maximum(np.rint(steps / middle), 1)
        late = counts >= 2
        regular = np.mean(np.abs(steps - counts * middle) < (1 - MOST) * middle) >= MOST
        if not regular or not late.any():
            continue
        missing += int(np.sum(counts[late] - 1))
        after = f"record {record} at {t[:-1][late][0]:.4g} s"
        first = first or f"a clock of {middle:.4g} s, the first after {after}"
    if not missing:
        return None
    return Finding(
        "dropped samples",
        "t",
        f"{missing} samples are missing from {first}",
        float(missing),
        "find out what the logger lost; across a gap the input is assumed to be held, and a record "
        "is split where the gap is longer than a window",
    )


def find_unused_samples(times: Sequence[np.ndarray], used: int) -> Finding | None:
    """Find that many samples lie between gaps, in pieces too short to be records."""
    count = sum(t.size for t in times)
    unused = count - used
    if unused < SHARE * count:
        return None
    return Finding(
        "unused samples",
        "t",
        f"{unused} of {count} samples lie in pieces of fewer than {MIN_SAMPLES} samples between "
        f"gaps that are longer than a window, and were not used",
        float(unused),
        "make window_length longer than the gaps if the inputs are held there, or record with one "
        "sample time",
    )


def _sample_time(t: np.ndarray) -> float:
    """Return the usual step of one record's clock; files may have clocks of their own."""
    return float(np.median(np.diff(t))) if t.size > 1 else np.inf


def find_jitter(signals: Sequence[Signal]) -> Finding | None:
    """Find a clock so uneven that it moves an output by a part of its noise."""
    found = [_jitter(signals, record) for record in range(len(signals[0].times))]
    uneven = [finding for finding in found if finding is not None]
    return max(uneven, key=lambda finding: finding.value, default=None)


def _jitter(signals: Sequence[Signal], record: int) -> Finding | None:
    """Find that the clock of one record is uneven."""
    t = signals[0].times[record]
    steps, middle = np.diff(t), _sample_time(t)
    regular = steps[np.rint(steps / middle) < 2]
    scatter = float(np.std(regular)) if regular.size else 0.0
    # an interval between rounded stamps has one of two values, a step of the rounding apart
    if scatter <= min(grid_step(t), middle) / 2 or scatter < FINE * middle:
        return None
    moved = [_slope(s, record) * scatter / max(s.noise, s.finest) for s in signals]
    if max(moved) ** 2 < SHARE:
        return None
    worst = signals[int(np.argmax(moved))].name
    return Finding(
        "clock jitter",
        "t",
        f"the sample time of {middle:.4g} s scatters by {scatter:.2g} s ({scatter / middle:.1%}) "
        f"in record {signals[0].records[record]}, in which {worst} moves by {max(moved):.2g} times "
        f"its noise",
        scatter,
        "check that the time stamps are taken at sampling, not at writing; record with a hardware "
        "clock",
    )


def _slope(signal: Signal, record: int) -> float:
    """Return the typical rate of change in a record, beyond what the noise makes."""
    steps = np.diff(signal.pieces[record])
    squares = steps[np.isfinite(steps)] ** 2
    power = squares.mean() - 2 * signal.noise**2 * signal.noisy if squares.size else 0.0
    return float(np.sqrt(max(power, 0.0))) / _sample_time(signal.times[record])
