"""Times that are taken in turns, so that a busy machine slows all ways down alike.

What runs on one core is measured by the processor's clock: what other programs take does not count.
The threads of BLAS would, which wait for each other on a busy machine, so ways are run without.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from threadpoolctl import threadpool_limits


@dataclass(frozen=True)
class Row:
    """A line of the table: how many times as long one thing takes as another.

    Parameters
    ----------
    work : str
        What was done.
    seconds : float
        How long it took [s].
    against : str
        What it is compared with.
    ratio : float
        Its time over the other's; where the bar is a least one, the other's over its own.
    bar : float
        What the ratio should be at most, or at least.
    at_least : bool, default=False
        Which of the two.
    """

    work: str
    seconds: float
    against: str
    ratio: float
    bar: float
    at_least: bool = False

    @property
    def holds(self) -> bool:
        """Whether the bar is kept."""
        return self.ratio >= self.bar if self.at_least else self.ratio <= self.bar

    @property
    def cells(self) -> list[str]:
        """The line's cells."""
        bar = f"{'≥' if self.at_least else '≤'} {self.bar:g}"
        seconds = f"{1e3 * self.seconds:.3g}"
        return [self.work, seconds, self.against, f"{self.ratio:.3g}", bar, _MARK[self.holds]]


_MARK = {True: "kept", False: "**missed**"}


def best_times(
    *ways: Callable[[], object], repeats: int = 5, clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Return the shortest time of every way [s], the ways taken in turns after one run of each."""
    for way in ways:
        way()
    with threadpool_limits(1, "blas"):
        times = [[seconds(way, clock) for way in ways] for _ in range(repeats)]
    return [min(of) for of in zip(*times, strict=True)]


def seconds(way: Callable[[], object], clock: Callable[[], float] = time.process_time) -> float:
    """Return the time of one run [s]."""
    start = clock()
    way()
    return clock() - start


def times_as_long(work, way, against, other, bar, *, samples=(1, 1), **options) -> Row:
    """Return how many times as long a way takes as another, per sample of each."""
    mine, theirs = best_times(way, other, **options)
    return Row(work, mine, against, (mine / samples[0]) / (theirs / samples[1]), bar)


def times_as_fast(work, way, against, other, bar, *, samples=(1, 1), **options) -> Row:
    """Return how many times as fast a way is as another, per sample of each."""
    mine, theirs = best_times(way, other, **options)
    ratio = (theirs / samples[1]) / (mine / samples[0])
    return Row(work, mine, against, ratio, bar, at_least=True)
