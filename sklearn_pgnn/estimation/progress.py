"""The progress of a diagnosis, and its time limit."""

from collections.abc import Callable
from math import inf
from time import monotonic

from sklearn_pgnn.estimation.budgets import BETTER

#: how a report begins that is no stage, but the best so far
BEST = "best candidate so far: "


class TimeIsUp(Exception):
    """The time that a diagnosis may take is over."""


class Progress:
    """The progress of a diagnosis, to which all long computations report.

    Parameters
    ----------
    report : callable, optional
        Called as ``report(stage, done, total)``; where a better hypothesis turns up, a stage in
        between says so, beginning with `BEST`.
    time_limit : float, optional
        Time [s] from now on.

    Attributes
    ----------
    stage : str
        What is being done.
    counts : bool
        Whether the time limit counts: not before there is a result, nor while it is written down.
    ended : str or None
        Why the end came early, and at what stage; only what the result needs is still done then.
    """

    def __init__(
        self, report: Callable[[str, int, int], None] | None = None, time_limit: float | None = None
    ):
        self._report = report
        self._limit, self._begun = time_limit, monotonic()
        self.stage, self._done, self._total = "", 0, 1
        self.counts = False
        self.ended: str | None = None
        self._least = inf  # times the noise that the best so far leaves

    @property
    def time_left(self) -> float | None:
        """Time [s] after which `TimeIsUp` is raised; None where it is not."""
        if self._limit is None or not self.counts or self.ended is not None:
            return None
        return self._limit - (monotonic() - self._begun)

    def begin(self, stage: str, total: int = 1) -> None:
        """Begin a stage.

        Parameters
        ----------
        stage : str
            What is done.
        total : int, default=1
            Steps it will take, as far as that is known.
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
            If the time is up; once only.
        """
        if self._report is not None:
            self._report(self.stage, self._done, self._total)
        left = self.time_left
        if left is not None and left <= 0:
            self.ended = f"time limit of {self._limit:g} s, at {self.stage!r}"
            raise TimeIsUp

    def note(self, times_noise: float, causes: str) -> None:
        """Announce causes that leave clearly less than any before, whatever the stage.

        Parameters
        ----------
        times_noise : float
            What they leave, in units of the noise.
        causes : str
            Their names.
        """
        if times_noise >= BETTER * self._least:
            return
        self._least = times_noise
        if self._report is not None:
            self._report(f"{BEST}{times_noise:.2f} times the noise left with {causes}", 0, 1)

    def end(self, reason: str) -> None:
        """End early, and report no more.

        Parameters
        ----------
        reason : str
            Why.
        """
        self.ended, self._report = f"{reason}, at {self.stage!r}", None
