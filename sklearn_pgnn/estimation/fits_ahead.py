"""Fits that other processes make before a search asks for them.

A search fits one hypothesis after the other, but knows which ones it will ask for next. Where that
pays, joblib's workers fit these side by side. The search goes on as ever; where it would fit, it
takes what is there: its result is the same with and without them.
"""

import threading
import warnings
from collections.abc import Callable, Hashable, Mapping
from pickle import PicklingError
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple
from uuid import uuid4

import cloudpickle
import numpy as np
from joblib import delayed

from sklearn_pgnn.estimation.progress import Progress, TimeIsUp
from sklearn_pgnn.estimation.unusable import FailureLog
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.threads import in_turn, one_thread_each

if TYPE_CHECKING:
    from sklearn_pgnn.estimation.fitting import HypothesisFitter

#: work [s] that is worth handing to other processes: less is done sooner than handed over. They
#: take the first one to start
WORTH, WORTH_STARTING = 0.3, 3.0
#: fits that are kept until they are asked for; a search may have gone another way
MOST = 256

#: how often a batch is handed over, should other processes be lost
TRIES = 2
#: said where other processes are lost
LOST = (
    "a process that fitted hypotheses was lost ({}); the diagnosis goes on, and its result is the "
    "same. Remedy: a smaller n_jobs if the memory did not suffice."
)

#: called with a fitter and with what it is to fit; returns the fit
Task = Callable[..., Any]


class Made(NamedTuple):
    """What another process has fitted.

    Parameters
    ----------
    arguments : tuple
        What it was called with.
    result : object
        The fit.
    failures : FailureLog
        What broke down on the way.
    """

    arguments: tuple
    result: Any
    failures: FailureLog


class FitsAhead:
    """Let other processes make fits that a search will ask for next.

    Parameters
    ----------
    n_processes : int
        How many; with one there are no others.
    """

    _have_started = False  # those of this process

    def __init__(self, n_processes: int):
        self.n_processes = n_processes
        self._made: dict[tuple[Task, Hashable], Made] = {}
        self._seconds: dict[Task, list[float]] = {}

    def make(self, fitter: "HypothesisFitter", task: Task, asked: Mapping[Any, tuple]) -> None:
        """Make fits: some here, and the others side by side once these prove to take long.

        Parameters
        ----------
        fitter : HypothesisFitter
            Who will ask for them.
        task : callable
            Makes a fit.
        asked : mapping of hashable to tuple
            By the name of each fit, what the task is called with.
        """
        left = dict(asked)
        while self.n_processes > 1 and len(left) > 1:
            if self._is_long(task, len(left)):
                self._hand_over(fitter, task, left)
                break
            name = next(iter(left))
            arguments, begun = left.pop(name), monotonic()
            found = task(fitter, *arguments)
            self._seconds.setdefault(task, []).append(monotonic() - begun)
            self._keep(task, name, Made(arguments, found, FailureLog()))

    def _is_long(self, task: Task, count: int) -> bool:
        """Return whether so many fits take longer than handing them over, as far as is known."""
        worth = WORTH if self._have_started else WORTH_STARTING
        return count * float(np.mean(self._seconds.get(task, 0.0))) > worth

    def _hand_over(
        self, fitter: "HypothesisFitter", task: Task, asked: Mapping[Any, tuple]
    ) -> None:
        """Make fits side by side; where that cannot be done the search makes all of its own."""
        for _ in range(TRIES):
            left = {name: of for name, of in asked.items() if (task, name) not in self._made}
            packed = _pack(fitter, task, list(left.values()))
            if packed is None:
                break
            try:
                return self._collect(fitter, task, left, packed)
            except TimeIsUp:
                raise
            except Exception as error:  # one of the program comes again where the search fits
                warnings.warn(LOST.format(type(error).__name__), SimulationWarning, stacklevel=2)
        self.n_processes = 1

    def _collect(
        self, fitter: "HypothesisFitter", task: Task, asked: Mapping[Any, tuple], packed: np.ndarray
    ) -> None:
        """Let the fits of a batch be made, and keep them as they come."""
        batch = uuid4().hex
        calls = [delayed(_run)(batch, packed, at) for at in range(len(asked))]
        FitsAhead._have_started = True
        made = in_turn(calls, self.n_processes, batch_size=1)
        for (name, arguments), found in zip(asked.items(), made, strict=True):
            if found is not None:
                self._keep(task, name, Made(arguments, *found))
            fitter.progress.tick()

    def _keep(self, task: Task, name: Hashable, made: Made) -> None:
        """Keep a fit until it is asked for, in the place of the oldest that nobody asked for."""
        self._made[task, name] = made
        for old in list(self._made)[:-MOST]:
            del self._made[old]

    def take(self, task: Task, name: Hashable, *arguments) -> Made | None:
        """Return a fit, once, if its task was called with these very arguments before others."""
        made = self._made.pop((task, name), None)
        pairs = () if made is None else zip(arguments, made.arguments, strict=False)
        return made if all(one is other for one, other in pairs) else None


# -- what travels ----------------------------------------------------------------------------------


def _pack(fitter: "HypothesisFitter", task: Task, arguments: list[tuple]) -> np.ndarray | None:
    """Return what other processes need, as an array: joblib sends one to each of them once.

    It is None where a model has something that cannot travel.
    """
    content = fitter.on_one_thread(), fitter.progress.time_left, task, arguments
    try:
        return np.frombuffer(cloudpickle.dumps(content), np.uint8)
    except (PicklingError, TypeError, AttributeError):
        return None


class _Received(threading.local):
    """What a thread of a worker was sent last, so that it is unpacked once."""

    batch = ""

    def unpack(self, batch: str, packed: np.ndarray) -> None:
        """Unpack a batch, unless it is the last one."""
        if batch != self.batch:
            self.fitter, left, self.task, self.arguments = cloudpickle.loads(packed)
            self.end, self.batch = None if left is None else monotonic() + left, batch

    def progress(self) -> Progress:
        """Return a progress that ends a fit when the time of the search is up."""
        progress = Progress(time_limit=None if self.end is None else self.end - monotonic())
        progress.counts = True
        return progress


_RECEIVED = _Received()


@one_thread_each()
def _run(batch: str, packed: np.ndarray, at: int) -> tuple[Any, FailureLog] | None:
    """Return one fit of a batch, and what broke down on the way; None where the time is up."""
    _RECEIVED.unpack(batch, packed)
    fitter = _RECEIVED.fitter
    fitter.failures, fitter.progress = FailureLog(), _RECEIVED.progress()
    try:
        return _RECEIVED.task(fitter, *_RECEIVED.arguments[at]), fitter.failures
    except TimeIsUp:
        return None
