"""Single samples: repeated samples, and outliers far from their neighbours."""

import numpy as np
from scipy.stats import binom, norm

from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.limits import ALPHA
from sklearn_pgnn.record_quality.signals import Signal


def find_held_samples(signal: Signal) -> Finding | None:
    r"""Find samples that repeat the one before while the signal moves.

    Parameters
    ----------
    signal : Signal
        The output.

    Returns
    -------
    Finding or None
        What was found.
    """
    extremes = (np.nanmin(signal.values), np.nanmax(signal.values))
    held = sum(int(np.sum(_held(signal, piece, extremes))) for piece in signal.pieces)
    expected = signal.chance_of_equals() if signal.tells_equals else 0.0
    if held < 2 or (expected and binom.sf(held - 1, signal.values.size, expected) > ALPHA):
        return None
    return Finding(
        "dropped samples",
        signal.name,
        f"{signal.name} repeats the value before it in {held} samples although it moves",
        float(held),
        "set repeated samples to NaN if the logger repeats the last value for missing samples, or "
        "reads the sensor more often than it measures; keep them if they come from coarse "
        "resolution at rest",
    )


def _held(signal, piece, extremes) -> np.ndarray:
    """Return which samples repeat the one before: all, or without noise those amid motion."""
    step = np.diff(piece)
    repeats = (step == 0) & ~np.isin(piece[1:], extremes)
    if signal.tells_equals:
        return repeats
    before, after = step[:-2], step[2:]
    # rounding moves a difference by up to one step, and chance by so many times the noise
    reach = norm.isf(ALPHA / (2 * signal.values.size)) * np.sqrt(2) * signal.noise
    least = max(signal.resolution, signal.finest) + reach
    moving = (before * after > 0) & (np.minimum(np.abs(before), np.abs(after)) > least)
    return repeats[1:-1] & moving


def find_outliers(signal: Signal, residual: Signal) -> Finding | None:
    r"""Find single samples far from their neighbours.

    A sample is an outlier if, less the line through its four neighbours, it lies beyond all of them
    by more than they differ plus as many times the noise as occurs by chance only once in
    :math:`1/\alpha` records; and if the same holds for the residual of a fitted model, in which
    motion is slow. A corner of the signal does not reach that far.

    Parameters
    ----------
    signal : Signal
        The output.
    residual : Signal
        What a fitted model leaves of it.

    Returns
    -------
    Finding or None
        What was found.

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
