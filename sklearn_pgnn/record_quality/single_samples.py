"""Single samples: repeated samples, and outliers far from their neighbours."""

import numpy as np
from scipy.stats import binom, norm

from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.limits import ALPHA
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.trajectories.grid import steps_at


def find_held_samples(signal: Signal) -> Finding | None:
    r"""Find samples that repeat the one before while the signal moves.

    A smooth signal in steps :math:`q` repeats its value wherever it moves by less than a step
    between two samples, :math:`|\dot y|\,\Delta t < q`: at rest and at its turning points. It then
    goes on by single steps. Only a repeat between two changes of the same sign, each larger than a
    step and what noise and rounding add, can thus be a sample that was held. Where noise is larger
    than the steps, neighbours that lie near each other are equal as often as any other two samples
    that do, whatever the steps are; a logger that holds samples makes only neighbours equal.
    """
    count = _more_than_by_chance(signal) or _in_smooth_motion(signal)
    if count < 2:
        return None
    return Finding(
        "dropped samples",
        signal.name,
        f"{signal.name} repeats the value before it in {count} samples although it moves",
        float(count),
        "set repeated samples to NaN if the logger repeats the last value for missing samples, or "
        "reads the sensor more often than it measures; keep them if they come from coarse "
        "resolution at rest",
    )


def _more_than_by_chance(signal: Signal) -> int:
    """Return the number of repeats if noise alone does not make so many neighbours equal; else 0.

    A value that is repeated more than once counts as one event: where it rests, noise rests, too.
    """
    if not signal.tells_equals:
        return 0
    near, values = signal.noise / 2, signal.values  # differences so small are equally likely
    ends, pieces = (np.nanmin(values), np.nanmax(values)), signal.pieces  # a sensor may be cut
    equal = [(np.diff(piece) == 0) & ~np.isin(piece[1:], ends) for piece in pieces]
    events = sum(int(np.sum(np.diff(repeats, prepend=False) & repeats)) for repeats in equal)
    close = sum(int(np.sum(np.abs(np.diff(_visits(piece))) < near)) for piece in pieces)
    if not events or binom.sf(events - 1, events + close, _share_of_equals(pieces, near)) > ALPHA:
        return 0
    return int(sum(np.sum(repeats) for repeats in equal))


def _share_of_equals(pieces, near: float) -> float:
    """Return how many of the visits of values that lie near each other are visits of one value.

    Neighbours are left out; one pair is counted as equal, for what was not seen.
    """
    equal, close = 1, 1
    for visits in map(_visits, pieces):
        values, counts = np.unique(visits, return_counts=True)
        upto = np.concatenate([[0], np.cumsum(counts)])
        below, beyond = (np.searchsorted(values, values + by) for by in (-near, near))
        equal += int(np.sum(counts * (counts - 1)))
        close += int(np.sum(counts * (upto[beyond] - upto[below] - 1)))
        close -= 2 * int(np.sum(np.abs(np.diff(visits)) < near))
    return min(1.0, equal / close)


def _visits(piece: np.ndarray) -> np.ndarray:
    """Return the values in their order, each once however long it stays."""
    known = piece[np.isfinite(piece)]
    return known[np.diff(known, prepend=np.nan) != 0]


def _in_smooth_motion(signal: Signal) -> int:
    """Return the number of repeats in a motion that neither noise nor rounding explain."""
    found, tail = 0, norm.isf(ALPHA / (2 * signal.values.size)) * np.sqrt(2)
    for piece in signal.pieces:
        change, step = np.diff(piece), np.maximum(steps_at(piece), signal.resolution)[1:-2]
        before, at, after = change[:-2], change[1:-1], change[2:]
        # steps hide noise that is smaller than the rounding's own
        reach = tail * np.maximum(signal.noise, step / np.sqrt(12))
        least = np.maximum(step, signal.finest) + reach
        moving = (before * after > 0) & (np.minimum(np.abs(before), np.abs(after)) > least)
        found += int(np.sum(moving & (at == 0)))
    return found


def find_outliers(signal: Signal, residual: Signal) -> Finding | None:
    r"""Find single samples far from their neighbours.

    A sample is an outlier if, less the line through its four neighbours, it lies beyond all of them
    by more than they differ plus as many times the noise as occurs by chance only once in
    :math:`1/\alpha` records; and if the same holds for the residual of a fitted model, in which
    motion is slow. A corner of the signal does not reach that far.

    References
    ----------
    .. [1] F. R. Hampel, "The influence curve and its role in robust estimation", Journal of the
       American Statistical Association 69, 1974, :doi:`10.1080/01621459.1974.10482962`.
    """
    noise = max(signal.noise, signal.resolution, signal.finest)
    reach = norm.isf(ALPHA / (2 * signal.values.size)) * noise
    found = [
        (record, k)
        for record, y, rest in zip(signal.records, signal.pieces, residual.pieces, strict=True)
        for k in np.flatnonzero((_beyond(y) > reach) & (_beyond(rest) > reach)) + 2
    ]
    if not found:
        return None
    record, k = found[0]
    return Finding(
        "outliers",
        signal.name,
        f"{signal.name} has single samples far from their neighbours ({len(found)} in all, the "
        f"first in record {record}, sample {k})",
        float(len(found)),
        "leave these samples empty (NaN) and look for loose contacts or lost telegrams",
    )


def _beyond(y: np.ndarray) -> np.ndarray:
    """Return how far every inner sample lies beyond its neighbours, less how far those differ."""
    if y.size < 5:
        return np.zeros(0)
    window = np.lib.stride_tricks.sliding_window_view(y, 5)
    near, at = window[:, [0, 1, 3, 4]], np.array([-2.0, -1.0, 1.0, 2.0])
    line = np.outer(near @ at / 10, at) + near.mean(axis=1, keepdims=True)
    rest, own = near - line, window[:, 2] - near.mean(axis=1)
    outside = np.maximum(own - rest.max(axis=1), rest.min(axis=1) - own)
    return outside - np.ptp(rest, axis=1)
