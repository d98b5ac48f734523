"""One measured quantity of all records: its noise and its resolution."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import compress

import numpy as np

from sklearn_pgnn.record_quality.limits import BLOCK, COARSE, FINE, MOST, NOISE_LIKE, TWICE
from sklearn_pgnn.trajectories.grid import step_of
from sklearn_pgnn.trajectories.measured import spans_of
from sklearn_pgnn.trajectories.noise import finest_differences, noise_level


@dataclass(frozen=True)
class Signal:
    """One measured quantity of all records, NaN where there is no value, and times [s]."""

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
    def one_by_one(self) -> list["Signal"]:
        """The same of every record alone: one may be noisy, and another count in steps."""
        each = zip(self.pieces, self.times, self.records, strict=True)
        return [Signal(self.name, self.unit, [y], [t], [record]) for y, t, record in each]

    @cached_property
    def noise(self) -> float:
        """Standard deviation of its white noise, in the records in which it changes if any."""
        timed = zip(self.pieces, self.times, strict=True)
        pairs = list(zip(self.is_still, timed, strict=True))
        moving = [piece for is_still, piece in pairs if not is_still]
        return float(np.median([noise_level(*p) for p in moving or [p for _, p in pairs]]))

    @cached_property
    def is_still(self) -> list[bool]:
        """Whether it has no two different values, record by record."""
        return [not spans_of(piece[:, None])[0] > 0 for piece in self.pieces]

    @cached_property
    def noisy(self) -> bool:
        """Whether the finest part of it is noise, and not motion."""
        return looks_like_noise(self.pieces, self.times)

    @cached_property
    def resolution(self) -> float:
        """The step of which all values are multiples, or that between values that return; else 0.

        A thermistor's steps are uneven, and an encoder's are lost in the decimals that it was
        written with, or beside those of another record's encoder. Noise that brings nearly every
        value back after it was left shows that there are no others in between, and so do values
        that repeat while all others are about multiples of a step away.
        """
        return max(step_of(self.pieces), self._step_between_visits() if self.noisy else 0.0)

    def _step_between_visits(self) -> float:
        """Return the usual step to the next value if a value is usually visited again; else 0."""
        steps, visits = [], []
        for piece in self.pieces:
            known = piece[np.isfinite(piece)]
            values, counts = np.unique(
                known[np.diff(known, prepend=np.nan) != 0], return_counts=True
            )
            if values.size > 1:
                gaps = np.diff(values, prepend=-np.inf, append=np.inf)
                steps.append(np.minimum(gaps[1:], gaps[:-1]))
                visits.append(counts)
        if not steps:
            return 0.0
        step, count = np.concatenate(steps), np.concatenate(visits)
        each = np.repeat(step, count)  # of every visit
        return float(np.median(each)) if each.size >= TWICE * step.size else 0.0

    def chance_of_equals(self) -> float:
        r"""Return the chance that noise alone makes two neighbours equal.

        Two normal values of spread :math:`\sigma` rounded to steps :math:`q` are equal with the
        chance :math:`q/(2\sqrt{\pi}\sigma)`.
        """
        if not self.noisy or self.noise == 0:
            return 1.0
        return min(1.0, self.resolution / (2 * np.sqrt(np.pi) * self.noise))

    @property
    def tells_equals(self) -> bool:
        """Whether noise makes equal neighbours so rare that these are a sign of a fault."""
        return self.chance_of_equals() < COARSE

    @property
    def finest(self) -> float:
        """The least change that counts as one: no simulation is finer."""
        return FINE * float(np.nanstd(self.values))

    def measured(self, value: float) -> str:
        """Return a value with its unit, as text."""
        return f"{value:.4g} {self.unit}".rstrip()


def looks_like_noise(pieces: Sequence[np.ndarray], times: Sequence[np.ndarray]) -> bool:
    """Return whether the finest differences alternate nearly everywhere, as those of noise do.

    Samples at the ends of the range are left out: a sensor may be cut there. What is finer than any
    simulation is the computer's rounding. A piece without any measured sample says nothing.
    """
    measured = [np.isfinite(piece).any() for piece in pieces]
    if not any(measured):
        return False
    pieces, times = (list(compress(each, measured)) for each in (pieces, times))
    ends = np.nanmin(np.concatenate(pieces)), np.nanmax(np.concatenate(pieces))
    inner = [np.where(np.isin(piece, ends), np.nan, piece) for piece in pieces]
    levels = [noise_level(*piece) for piece in zip(inner, times, strict=True)]
    if not np.median(levels) > FINE * np.nanstd(np.concatenate(pieces)):
        return False
    blocks = np.concatenate([_alternates(*piece) for piece in zip(inner, times, strict=True)])
    return bool(blocks.size and np.mean(blocks) > MOST)


def _alternates(piece: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return block by block whether neighbouring differences have opposite signs."""
    steps = finest_differences(piece, times)[0]
    pairs = np.column_stack([steps[:-1], steps[1:]])
    blocks = np.array_split(pairs, max(1, len(pairs) // BLOCK))
    long = (block.T for block in blocks if len(block) >= 8)
    return np.array([a @ b < NOISE_LIKE * np.sqrt((a @ a) * (b @ b)) for a, b in long])
