"""What in a record itself stands in the way, told from its numbers alone, without a model."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import binom, norm

from sklearn_pgnn.trajectories.noise import finest_differences, noise_level, relative_error

#: chance at which one check of a quantity speaks up although nothing is wrong
ALPHA = 1e-3
#: correlation of neighbouring differences, block by block: -0.75 or less of white noise, near 1 of
#: a smooth signal
NOISE_LIKE, BLOCK = -0.5, 64
#: share of neighbouring samples that may be equal by chance before equal samples say nothing
COARSE = 0.2
#: steps of the resolution that make a motion
MOVES = 3.0
#: a clock is regular if so many of its intervals are within this share of their median; an
#: interval so much longer than the median is a gap
REGULAR, NEAR, GAP = 0.9, 0.1, 1.5
#: share of the noise power from which on an uneven clock counts
WHOLE = 0.05
#: no simulation is finer than this share of a signal's spread
FINE = 1e-5


@dataclass(frozen=True)
class Finding:
    """What in the records stands in the way of a diagnosis.

    Parameters
    ----------
    kind : str
        What sort of fault.
    where : str
        The quantity, and the record where it is one.
    text : str
        What was seen, in one sentence.
    value : float
        How large or how often.
    remedy : str
        What to do about it.

    Examples
    --------
    >>> finding = Finding("clipping", "phi", "phi stays at 1.2 rad", 34.0, "drive it less")
    >>> finding.where
    'phi'
    """

    kind: str
    where: str
    text: str
    value: float
    remedy: str


@dataclass(frozen=True)
class Signal:
    """One measured quantity of all records.

    Parameters
    ----------
    name, unit : str
        What it is called and its unit.
    pieces : sequence of ndarray of shape (n_samples,)
        Its values, record by record; NaN where there is none.
    times : sequence of ndarray of shape (n_samples,)
        Time [s].
    records : sequence of str
        What the records are called.
    """

    name: str
    unit: str
    pieces: Sequence[np.ndarray]
    times: Sequence[np.ndarray]
    records: Sequence[str]

    @property
    def values(self) -> np.ndarray:
        """All values, record after record."""
        return np.concatenate(self.pieces)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of its white noise."""
        return float(np.median([noise_level(*piece) for piece in self._timed]))

    @cached_property
    def noisy(self) -> bool:
        """Whether the finest part of it is noise, and not motion."""
        return _looks_like_noise(self.pieces, self.times)

    @property
    def _timed(self):
        return zip(self.pieces, self.times, strict=True)

    @cached_property
    def resolution(self) -> float:
        """The step of which all values are multiples; 0 where there is none."""
        return grid_step(self.values)

    def chance_of_equals(self) -> float:
        r"""Give the chance that noise alone makes two neighbours equal.

        Two normal values of spread :math:`\sigma` rounded to steps :math:`q` are equal with the
        chance :math:`q/(2\sqrt{\pi}\sigma)`.
        """
        if not self.noisy or self.noise == 0:
            return 1.0
        return min(1.0, self.resolution / (2 * np.sqrt(np.pi) * self.noise))

    def measured(self, value: float) -> str:
        """Write a value with the unit."""
        return f"{value:.4g} {self.unit}".rstrip()


def _looks_like_noise(pieces, times) -> bool:
    """Return whether the finest differences alternate nearly everywhere, as those of noise do.

    Samples at the ends of the range are left out: a sensor may be cut there. What is finer than any
    simulation is the computer's rounding.
    """
    ends = np.nanmin(np.concatenate(pieces)), np.nanmax(np.concatenate(pieces))
    inner = [np.where(np.isin(piece, ends), np.nan, piece) for piece in pieces]
    levels = [noise_level(*piece) for piece in zip(inner, times, strict=True)]
    if not np.median(levels) > FINE * np.nanstd(np.concatenate(pieces)):
        return False
    blocks = np.concatenate([_alternates(*piece) for piece in zip(inner, times, strict=True)])
    return bool(blocks.size and np.mean(blocks) > REGULAR)


def _alternates(piece: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return block by block whether neighbouring differences have opposite signs."""
    steps = finest_differences(piece, times)[0]
    pairs = np.column_stack([steps[:-1], steps[1:]])
    blocks = np.array_split(pairs, max(1, len(pairs) // BLOCK))
    return np.array([_correlation(block) < NOISE_LIKE for block in blocks if len(block) >= 8])


def _correlation(pairs: np.ndarray) -> float:
    a, b = pairs.T
    power = np.sqrt(np.sum(a**2) * np.sum(b**2))
    return float(np.sum(a * b) / power) if power > 0 else 0.0


def grid_step(values: np.ndarray) -> float:
    """Find the step of which all differences of values are multiples.

    Only the larger half of the values counts: numbers written with so many digits are coarsest
    there.

    Parameters
    ----------
    values : ndarray of shape (n_samples,)
        The values; NaN is skipped.

    Returns
    -------
    float
        The step, or 0 if there is none.

    Examples
    --------
    >>> float(round(grid_step(np.round(np.random.default_rng(0).normal(size=100), 2)), 6))
    0.01
    >>> float(grid_step(np.random.default_rng(0).normal(size=100)))
    0.0
    """
    known = values[np.isfinite(values)]
    large = known[np.abs(known) >= np.median(np.abs(known))] if known.size else known
    distinct = np.unique(large)
    # what differs by rounding of the computer only is the same
    distinct = distinct[np.diff(distinct, prepend=-np.inf) > 1e-9 * np.abs(distinct).max(initial=0)]
    return _common_measure(np.diff(distinct)) if distinct.size > 2 else 0.0


def _common_measure(gaps: np.ndarray) -> float:
    """Give the largest step that goes into all gaps, by Euclid's algorithm; 0 if there is none."""
    least, step = 1e-8 * gaps.sum(), gaps.min()
    while step > least:
        rest = np.abs(gaps - step * np.rint(gaps / step))
        if rest.max() < 0.02 * step:
            return float(gaps.sum() / np.rint(gaps / step).sum())
        step = rest[rest >= 0.02 * step].min()
    return 0.0


# -- outputs ---------------------------------------------------------------------------------------


def find_clipping(signal: Signal) -> Finding | None:
    r"""Find runs of samples at the largest or the smallest value.

    Where there is noise, a run of :math:`R` equal samples among :math:`n` is too long for chance
    if :math:`n\,p^{R-1} < \alpha`; without noise, it must begin and end with kinks sharper than
    any other in the record.

    Parameters
    ----------
    signal : Signal
        The output.

    Returns
    -------
    Finding or None
        What was found.
    """
    chance = signal.chance_of_equals()
    runs = []
    for limit in (np.nanmin(signal.values), np.nanmax(signal.values)):
        for piece in signal.pieces:
            for first, last in _runs(piece == limit):
                if last - first >= 3 and _is_cut(signal, piece, first, last, chance):
                    runs.append((last - first, limit))
    if not runs:
        return None
    longest, limit = max(runs)
    total = sum(length for length, _ in runs)
    return Finding(
        "clipping",
        signal.name,
        f"{signal.name} stands still at its extreme value {signal.measured(limit)} "
        f"({total} samples, up to {longest} in a row)",
        float(total),
        "choose a wider range of the sensor or drive it less; the samples at the limit are no "
        "measurement",
    )


def _runs(mask: np.ndarray):
    """List where runs of true values begin and end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return edges.reshape(-1, 2).tolist()


def _is_cut(signal, piece, first, last, chance) -> bool:
    if chance < COARSE:
        away = piece[(piece != piece[first]) & np.isfinite(piece)]
        equal = float(np.mean(np.diff(away) == 0)) if away.size > 1 else 0.0
        chance = max(chance, equal, 1 / piece.size)
        return piece.size * chance ** (last - first - 1) < ALPHA
    return _has_kinks(piece, first, last, MOVES * signal.resolution)


def _has_kinks(piece, first, last, least) -> bool:
    """Tell whether a run begins and ends more sharply than the signal bends anywhere else.

    A machine at rest came there smoothly; one that is at rest from the first sample tells nothing.
    """
    bend = np.abs(np.diff(piece, 2))  # bend[k] is the kink at sample k + 1
    edges = np.array([k - 1 for k in (first, last - 1) if k < piece.size - 1])
    if first < 1:
        return False
    near = np.clip(np.add.outer(edges, [-1, 0, 1]).ravel(), 0, bend.size - 1)
    elsewhere = np.nanmax(np.delete(bend, near), initial=0.0)
    return bool(np.all(bend[edges] > max(elsewhere, least)))


def find_quantisation(signal: Signal) -> Finding | None:
    r"""Find steps of the resolution that are larger than the noise.

    From a noise of half a step on, rounding is like more white noise of variance
    :math:`q^2/12`; below, its error depends on the signal.

    Parameters
    ----------
    signal : Signal
        The output.

    Returns
    -------
    Finding or None
        What was found.

    References
    ----------
    .. [1] R. M. Gray, D. L. Neuhoff, "Quantization", IEEE Transactions on Information Theory
       44(6), 1998, :doi:`10.1109/18.720541`.
    """
    step = signal.resolution
    if not step > np.sqrt(1 / (1 / 4 + 1 / 12)) * max(signal.noise, FINE * _spread(signal)):
        return None
    levels = np.unique(np.rint(signal.values[np.isfinite(signal.values)] / step)).size
    return Finding(
        "quantisation",
        signal.name,
        f"{signal.name} comes in steps of {signal.measured(step)}, larger than its noise "
        f"({levels} different values)",
        step,
        "use a finer sensor or range; effects smaller than a step cannot be seen",
    )


def _spread(signal) -> float:
    return float(np.nanstd(signal.values))


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
    chance = signal.chance_of_equals()
    expected = chance if chance < COARSE else 0.0
    if held < 2 or (expected and binom.sf(held - 1, signal.values.size, expected) > ALPHA):
        return None
    return Finding(
        "dropped samples",
        signal.name,
        f"{signal.name} repeats the value before it in {held} samples although it moves",
        float(held),
        "the logger filled missing samples with old ones: leave such samples empty",
    )


def _held(signal, piece, extremes) -> np.ndarray:
    """Tell which samples repeat the one before: all, or without noise those amid motion."""
    step = np.diff(piece)
    repeats = (step == 0) & ~np.isin(piece[1:], extremes)
    if signal.chance_of_equals() < COARSE:
        return repeats
    before, after = step[:-2], step[2:]
    least = MOVES * max(signal.resolution, FINE * _spread(signal))
    moving = (before * after > 0) & (np.minimum(np.abs(before), np.abs(after)) > least)
    return repeats[1:-1] & moving


def find_outliers(signal: Signal, residual: Signal) -> Finding | None:
    r"""Find single samples far from their neighbours.

    A sample is one if, less the line through its four neighbours, it lies beyond all of them by
    more than they differ plus so many times the noise as chance makes only once in
    :math:`1/\alpha` records; and if so does what a model leaves of it, where motion is slow. A
    corner of the signal does not reach that far.

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
    noise = max(signal.noise, signal.resolution, FINE * _spread(signal))
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
    """Say how far every inner sample lies beyond its neighbours, less how far those differ."""
    if y.size < 5:
        return np.zeros(0)
    window = np.lib.stride_tricks.sliding_window_view(y, 5)
    near, at = window[:, [0, 1, 3, 4]], np.array([-2.0, -1.0, 1.0, 2.0])
    line = np.outer(near @ at / 10, at) + near.mean(axis=1, keepdims=True)
    rest, own = near - line, window[:, 2] - near.mean(axis=1)
    outside = np.maximum(own - rest.max(axis=1), rest.min(axis=1) - own)
    return outside - np.ptp(rest, axis=1)


# -- clock and inputs ------------------------------------------------------------------------------


def find_gaps(times: Sequence[np.ndarray], records: Sequence[str]) -> Finding | None:
    """Find samples that are missing from a regular clock.

    Parameters
    ----------
    times : sequence of ndarray of shape (n_samples,)
        Time of every record [s].
    records : sequence of str
        What the records are called.

    Returns
    -------
    Finding or None
        What was found.

    Examples
    --------
    >>> find_gaps([np.delete(np.arange(50) * 0.1, [20, 21])], ["a"]).value
    2.0
    """
    missing, first = 0, ""
    for t, record in zip(times, records, strict=True):
        steps, middle = np.diff(t), float(np.median(np.diff(t)))
        counts = np.maximum(np.rint(steps / middle), 1)
        late = steps > GAP * middle
        regular = np.mean(np.abs(steps - counts * middle) < NEAR * middle) >= REGULAR
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
        "find what the logger lost; across a gap the input is taken as held, and a record is taken "
        "apart where the gap is longer than a window",
    )


def _sample_time(t: np.ndarray) -> float:
    """Return the usual step of one record's clock; files may have clocks of their own."""
    return float(np.median(np.diff(t))) if t.size > 1 else np.inf


def find_jitter(signals: Sequence[Signal]) -> Finding | None:
    """Find a clock so uneven that it moves an output by a part of its noise.

    Parameters
    ----------
    signals : sequence of Signal
        The outputs.

    Returns
    -------
    Finding or None
        What was found.
    """
    found = [_jitter(signals, record) for record in range(len(signals[0].times))]
    uneven = [finding for finding in found if finding is not None]
    return max(uneven, key=lambda finding: finding.value, default=None)


def _jitter(signals: Sequence[Signal], record: int) -> Finding | None:
    """Find that the clock of one record is uneven."""
    t = signals[0].times[record]
    steps, middle = np.diff(t), _sample_time(t)
    regular = steps[steps < GAP * middle]
    scatter = float(np.std(regular)) if regular.size else 0.0
    # stamps rounded to a step scatter by up to 0.41 steps
    if scatter <= 0.5 * min(grid_step(t), middle) or scatter < 1e-6 * middle:
        return None
    moved = [_slope(s, record) * scatter / max(s.noise, FINE * _spread(s)) for s in signals]
    if max(moved) ** 2 < WHOLE:
        return None
    worst = signals[int(np.argmax(moved))].name
    return Finding(
        "clock jitter",
        "t",
        f"the sample time of {middle:.4g} s scatters by {scatter:.2g} s ({scatter / middle:.1%}) "
        f"in record {signals[0].records[record]}, in which {worst} moves by {max(moved):.2g} times "
        f"its noise",
        scatter,
        "check that the time stamps are those of the sampling, not of the writing; record with a "
        "hardware clock",
    )


def _slope(signal, record: int) -> float:
    """Return the typical rate of change in a record, beyond what the noise makes."""
    steps = np.diff(signal.pieces[record])
    squares = steps[np.isfinite(steps)] ** 2
    power = squares.mean() - 2 * signal.noise**2 * signal.noisy if squares.size else 0.0
    return float(np.sqrt(max(power, 0.0))) / _sample_time(signal.times[record])


def find_dull_input(signal: Signal) -> Finding | None:
    """Find an input that never changes or knows two values only.

    Parameters
    ----------
    signal : Signal
        The input.

    Returns
    -------
    Finding or None
        What was found.

    Examples
    --------
    >>> still = Signal("u", "V", [np.ones(9)], [np.arange(9.0)], ["a"])
    >>> find_dull_input(still).text
    'u has the value 1 V throughout'
    """
    levels = np.unique(signal.values)
    if levels.size > 2:
        return None
    values = " and ".join(signal.measured(level) for level in levels)
    text, remedy = {
        1: (
            f"{signal.name} has the value {values} throughout",
            "vary it: what it does to the machine cannot be seen",
        ),
        2: (
            f"{signal.name} has only the values {values}",
            "drive it at several levels: its gain, offset, dead zone and limit look alike at two",
        ),
    }[levels.size]
    return Finding("poor excitation", signal.name, text, float(levels.size), remedy)


def find_uneven_noise(signal: Signal) -> Finding | None:
    """Find records that are noisier than others by more than twice.

    Parameters
    ----------
    signal : Signal
        The output.

    Returns
    -------
    Finding or None
        What was found.
    """
    timed = list(zip(signal.pieces, signal.times, strict=True))
    if len(timed) < 2 or not all(_looks_like_noise([y], [t]) for y, t in timed):
        return None
    levels = np.array([noise_level(*piece) for piece in timed])
    errors = np.array([_noise_error(*piece) for piece in timed])
    low, high = int(np.argmin(levels)), int(np.argmax(levels))
    error = np.hypot(errors[low], errors[high])
    pairs = len(levels) * (len(levels) - 1)
    least = np.log(2) + norm.isf(ALPHA / pairs) * error
    if not levels[low] > 0 or np.log(levels[high] / levels[low]) < least:
        return None
    return Finding(
        "drift between records",
        signal.name,
        f"the noise of {signal.name} is {signal.measured(levels[high])} in record "
        f"{signal.records[high]} and {signal.measured(levels[low])} in record "
        f"{signal.records[low]}",
        float(levels[high] / levels[low]),
        "find what changed between the records, or diagnose them apart",
    )


def _noise_error(piece, times) -> float:
    """Return the relative standard error of the noise of a record."""
    differences, order = finest_differences(piece, times)
    return relative_error(differences.size, order)
