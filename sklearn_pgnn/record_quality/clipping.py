"""Clipping: samples that stand still at an end of the range."""

import numpy as np

from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.limits import ALPHA
from sklearn_pgnn.record_quality.signals import Signal


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


def _runs(mask: np.ndarray):
    """Return where runs of true values begin and end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return edges.reshape(-1, 2).tolist()


def _is_cut(signal, piece, first, last) -> bool:
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


def _has_kinks(piece, first, last, least) -> bool:
    """Return whether a run begins and ends more sharply than the signal bends anywhere else.

    A machine at rest came there smoothly.
    """
    bend = np.abs(np.diff(piece, 2))  # bend[k] is the kink at sample k + 1
    edges = np.array([first - 1, last - 2])
    runs = np.flatnonzero(piece == piece[first]) - 1  # where it is cut as well
    near = np.clip(np.add.outer(runs, [-1, 0, 1]).ravel(), 0, bend.size - 1)
    elsewhere = np.nanmax(np.delete(bend, near), initial=0.0)
    return bool(np.all(bend[edges] > max(elsewhere, least)))
