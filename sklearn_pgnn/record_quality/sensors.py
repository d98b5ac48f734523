"""Sensors: clipped, dead or coarse ones, repeated samples, and outliers."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import binom, norm

from sklearn_pgnn.record_quality.finding import Finding, listed
from sklearn_pgnn.record_quality.limits import ALPHA, TWICE
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.trajectories.grid import steps_at
from sklearn_pgnn.trajectories.measured import SEVERAL

# -- samples that stand still at an end of the range -----------------------------------------------


def find_clipping(signal: Signal) -> Finding | None:
    r"""Find runs of samples at the largest or the smallest value.

    Where there is noise, a run of :math:`R` equal samples among :math:`n` is too long for chance
    if :math:`n\,p^{R-1} < \alpha`; without noise, it must begin and end with kinks sharper than
    any other in the record. Before and after an experiment a machine may rest, and a speed be zero
    without noise: there a run tells nothing.
    """
    runs = []
    for limit in (np.nanmin(signal.values), np.nanmax(signal.values)):
        for alone in signal.one_by_one:
            piece = alone.pieces[0]
            for first, last in _runs(piece == limit):
                if last - first >= 3 and _is_cut(alone, piece, first, last):
                    runs.append((last - first, limit))
    if not runs:
        return None
    longest, limit = max(runs)
    total = sum(length for length, _ in runs)
    return Finding(
        "clipping",
        signal.name,
        f"{signal.name} stays at its extreme value {signal.measured(limit)} ({total} samples, up "
        f"to {longest} in a row)",
        float(total),
        "choose a wider range of the sensor or drive it less; the samples at the limit are not "
        "measurements",
    )


def _runs(mask: np.ndarray) -> list[list[int]]:
    """Return where runs of true values begin and end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return edges.reshape(-1, 2).tolist()


def _is_cut(signal: Signal, piece: np.ndarray, first: int, last: int) -> bool:
    """Return whether a run of equal samples is longer than chance or rest make it."""
    if first < 1 or last == piece.size:  # a machine may rest before and after an experiment
        return False
    if signal.tells_equals:
        away = piece[(piece != piece[first]) & np.isfinite(piece)]
        equal = float(np.mean(np.diff(away) == 0)) if away.size > 1 else 0.0
        chance = max(signal.chance_of_equals(), equal, 1 / piece.size)
        return piece.size * chance ** (last - first - 1) < ALPHA
    # rounding moves a second difference by up to two steps; where a counter dithers, noise by more
    return _has_kinks(piece, first, last, 3 * signal.resolution + 4 * signal.noise)


def _has_kinks(piece: np.ndarray, first: int, last: int, least: float) -> bool:
    """Return whether a run begins and ends more sharply than the signal bends anywhere else.

    A machine at rest came there smoothly.
    """
    bend = np.abs(np.diff(piece, 2))  # bend[k] is the kink at sample k + 1
    edges = np.array([first - 1, last - 2])
    runs = np.flatnonzero(piece == piece[first]) - 1  # where it is cut as well
    near = np.clip(np.add.outer(runs, [-1, 0, 1]).ravel(), 0, bend.size - 1)
    elsewhere = np.nanmax(np.delete(bend, near), initial=0.0)
    return bool(np.all(bend[edges] > max(elsewhere, least)))


# -- outputs that never change though the model moves ----------------------------------------------


def find_dead_sensor(signal: Signal, residual: Signal) -> Finding | None:
    """Find records in which an output has one value only, and a fitted model clearly others.

    A machine at rest is no fault: its model rests, too.
    """
    still = signal.is_still
    if all(still):
        return None
    least = TWICE * max(signal.noise, signal.resolution, signal.finest)
    rows = zip(still, signal.records, signal.pieces, residual.pieces, strict=True)
    dead = {
        record: signal.measured(float(np.nanmax(piece)))
        for is_still, record, piece, rest in rows
        if is_still and np.isfinite(piece).sum() >= SEVERAL and np.sqrt(np.nanmean(rest**2)) > least
    }
    if not dead:
        return None
    places = listed(f"record {record} ({value})" for record, value in dead.items())
    return Finding(
        "dead sensor",
        signal.name,
        f"{signal.name} has one value only throughout {places}, where the model moves",
        float(len(dead)),
        "look at the sensor and its cable, and leave the output empty (NaN) in these records; if "
        "the machine was stuck there, that is what the model lacks",
    )


# -- steps of the resolution that are larger than the noise ----------------------------------------


def find_quantisation(signal: Signal, left: float = 0.0) -> Finding | None:
    """Find steps of the resolution that are larger than the noise, and than what is left.

    From a noise of half a step on, rounding is like more white noise of variance
    :math:`q^2/12`; below, its error depends on the signal. Where a model leaves more than a step,
    it is not the steps that stand in the way.

    .. [1] R. M. Gray, D. L. Neuhoff, "Quantization", IEEE Transactions on Information Theory
       44(6), 1998, :doi:`10.1109/18.720541`.
    """
    step = signal.resolution
    if not step > max(np.sqrt(1 / (1 / 4 + 1 / 12)) * max(signal.noise, signal.finest), left):
        return None
    levels = np.unique(np.rint(signal.values[np.isfinite(signal.values)] / step)).size
    return Finding(
        "quantisation",
        signal.name,
        f"{signal.name} is quantised in steps of {signal.measured(step)}, larger than its noise "
        f"({levels} different values)",
        step,
        "use a finer sensor or range; effects smaller than a step cannot be detected",
    )


# -- repeated samples, and outliers far from their neighbours --------------------------------------


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


def _share_of_equals(pieces: Sequence[np.ndarray], near: float) -> float:
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
