"""The progress of a diagnosis, and its time limit."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from time import monotonic

from sklearn_pgnn.estimation.budgets import BETTER
from sklearn_pgnn.stages import BEST

#: share of the time limit, and longest time [s], that a search leaves for what follows it: the
#: first half for tests of what it has found until then, the second for intervals, errors and checks
RESERVE, MOST_RESERVED = 0.2, 60.0
#: part of the reserve that is left after these tests
AFTER_TESTS = 0.5


class TimeIsUp(Exception):
    """The time limit of a diagnosis is reached."""


class Progress:
    """The progress of a diagnosis, to which all long computations report.

    `report` is called as ``report(stage, done, total)``; a better hypothesis is reported as a stage
    in between that begins with `BEST`. The `time_limit` [s] counts from now on; `kept_back` is the
    part of the reserve that is kept back where the time counts.

    Where the time `counts`, its end, less the reserve, is raised; else a fit ends with what it has
    where all the time is up: a result there must be. `ended` is the reason and stage of an early
    end, after which only the steps that the result needs follow; `failed` is the first error of a
    stage that was left out.
    """

    def __init__(
        self,
        report: Callable[[str, int, int], None] | None = None,
        time_limit: float | None = None,
        kept_back: float = 1.0,
    ):
        self._report = report
        self._limit, self._begun = time_limit, monotonic()
        self.stage, self._done, self._total = "", 0, 1
        self.counts = False
        self.ended: str | None = None
        self.failed: Exception | None = None
        self._kept_back, self._is_spare = kept_back, False
        self._least = inf  # error of the best so far, in units of the noise

    @property
    def _raises(self) -> bool:
        """Whether the end of the time is raised."""
        return self.counts or self._is_spare

    @property
    def time_left(self) -> float | None:
        """Time [s] after which `TimeIsUp` is raised; None if it never is."""
        return self._left() if self._raises and self._limit is not None else None

    def _left(self) -> float:
        """Return the time [s] that is left for the present work."""
        if self._limit is None:
            return inf
        reserve = min(RESERVE * self._limit, MOST_RESERVED) if self._raises else 0.0
        return self._limit - self._kept_back * reserve - (monotonic() - self._begun)

    @contextmanager
    def spare_time(self, kept_back: float = 0.0) -> Iterator[None]:
        """Cut short what a result gains from but does not need, a part of the reserve kept back."""
        before = self._kept_back, self._is_spare
        self._kept_back, self._is_spare = kept_back, True
        try:
            with self.kept():
                yield
        finally:
            self._kept_back, self._is_spare = before

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Leave a stage where the time is up or it fails: what was found before it is kept."""
        try:
            yield
        except TimeIsUp:
            return
        except Exception as error:
            self.failed = self.failed or error
            self.ended = self.ended or f"{said(error)}, at {self.stage!r}"

    def begin(self, stage: str, total: int = 1) -> None:
        """Begin a stage."""
        self.stage, self._done, self._total = stage, 0, max(total, 1)
        self.tick()

    def step(self) -> None:
        """Note that one step of the stage is done."""
        self._done += 1
        self._total = max(self._total, self._done)
        self.tick()

    def tick(self) -> bool:
        """Note that work goes on within a step; return whether a fit shall end with what it has."""
        if self._report is not None:
            self._report(self.stage, self._done, self._total)
        if self._left() > 0:
            return False
        if self._raises:
            self.ended = self.ended or f"time limit, at {self.stage!r}"
            raise TimeIsUp
        return True

    def note(self, times_noise: float, causes: str) -> None:
        """Report causes whose error is clearly less than that of any before, at any stage."""
        if times_noise >= BETTER * self._least:
            return
        self._least = times_noise
        if self._report is not None:
            self._report(f"{BEST}error {times_noise:.2f} times the noise with {causes}", 0, 1)

    def end(self, error: BaseException) -> None:
        """End early by an error, and report no more."""
        self.ended, self._report = f"{said(error)}, at {self.stage!r}", None


def said(error: BaseException) -> str:
    """Return a short description of what ended a diagnosis or a stage of it."""
    if isinstance(error, KeyboardInterrupt):
        return "interrupted"
    return f"unexpected {type(error).__name__}: {error}"
