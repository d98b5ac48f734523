"""The progress of a diagnosis, and its time limit."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from time import monotonic

from sklearn_pgnn.estimation.budgets import BETTER
from sklearn_pgnn.stages import BEST

#: share of the time limit that tests of what was found until then may take beyond it
SPARE = 0.1


class TimeIsUp(Exception):
    """The time limit of a diagnosis is reached."""


class Progress:
    """The progress of a diagnosis, to which all long computations report.

    Parameters
    ----------
    report : callable, optional
        Called as ``report(stage, done, total)``; a better hypothesis is reported as a
        stage in between that begins with `BEST`.
    time_limit : float, optional
        Time [s] from now on.

    Attributes
    ----------
    stage : str
        The current stage.
    counts : bool
        Whether the time limit applies: not before there is a result, nor while it is stored.
    ended : str or None
        Reason and stage of an early end; only the steps that the result needs follow it.
    """

    def __init__(
        self, report: Callable[[str, int, int], None] | None = None, time_limit: float | None = None
    ):
        self._report = report
        self._limit, self._begun = time_limit, monotonic()
        self.stage, self._done, self._total = "", 0, 1
        self.counts = False
        self.ended: str | None = None
        self._spares = False
        self._least = inf  # error of the best so far, in units of the noise

    @property
    def time_left(self) -> float | None:
        """Time [s] after which `TimeIsUp` is raised; None if there is no limit."""
        if self._limit is None or not (self._spares or (self.counts and self.ended is None)):
            return None
        limit = (1.0 + SPARE) * self._limit if self._spares else self._limit
        return limit - (monotonic() - self._begun)

    @contextmanager
    def spare_time(self) -> Iterator[None]:
        """Cut short what a result gains from but does not need, `SPARE` of the limit beyond it."""
        self._spares = True
        try:
            yield
        except TimeIsUp:
            return
        finally:
            self._spares = False

    def begin(self, stage: str, total: int = 1) -> None:
        """Begin a stage.

        Parameters
        ----------
        stage : str
            Its name.
        total : int, default=1
            Number of its steps, as far as known.
        """
        self.stage, self._done, self._total = stage, 0, max(total, 1)
        self.tick()

    def step(self) -> None:
        """Note that one step of the stage is done.

        Raises
        ------
        TimeIsUp
            If the time is up; once only.
        """
        self._done += 1
        self._total = max(self._total, self._done)
        self.tick()

    def tick(self) -> None:
        """Note that work goes on within a step.

        Raises
        ------
        TimeIsUp
            If the time is up; once only, and where spare time is up.
        """
        if self._report is not None:
            self._report(self.stage, self._done, self._total)
        left = self.time_left
        if left is not None and left <= 0:
            self.ended = self.ended or f"time limit of {self._limit:g} s, at {self.stage!r}"
            raise TimeIsUp

    def note(self, times_noise: float, causes: str) -> None:
        """Report causes whose error is clearly less than that of any before, at any stage.

        Parameters
        ----------
        times_noise : float
            Their error, in units of the noise.
        causes : str
            Their names.
        """
        if times_noise >= BETTER * self._least:
            return
        self._least = times_noise
        if self._report is not None:
            self._report(f"{BEST}error {times_noise:.2f} times the noise with {causes}", 0, 1)

    def end(self, reason: str) -> None:
        """End early, and report no more.

        Parameters
        ----------
        reason : str
            The reason.
        """
        self.ended, self._report = f"{reason}, at {self.stage!r}", None
