"""Fits that other processes compute before a search requests them.

A search fits one hypothesis after another, but the next ones are known in advance. Where it saves
time, joblib's workers fit these in parallel. The search itself is unchanged: where it would fit, it
uses an existing fit. Its result is the same with and without them.
"""

import threading
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
from sklearn_pgnn.threads import end_with_parent, in_turn, one_thread_each
from sklearn_pgnn.user_line import warn_user

if TYPE_CHECKING:
    from sklearn_pgnn.estimation.fitting import HypothesisFitter

#: work [s] above which other processes are used: less is computed faster than it is transferred.
#: The larger value holds until they have started
WORTH, WORTH_STARTING = 0.3, 3.0
#: fits that are kept until requested; a search may not request all of them
MOST = 256

#: number of attempts with a batch if worker processes are lost
TRIES = 2
#: warning if worker processes are lost
LOST = (
    "a worker process was lost ({}); its fits are made again, with the same result. Remedy: reduce "
    "n_jobs if memory ran out."
)

#: called with a fitter and the arguments of the fit; returns the fit
Task = Callable[..., Any]


class Made(NamedTuple):
    """A fit by another process."""

    arguments: tuple
    result: Any
    failures: FailureLog


class FitsAhead:
    """Let other processes, if any, compute fits that a search will request next."""

    _have_started = False  # those of this process

    def __init__(self, n_processes: int):
        self.n_processes = n_processes
        self._made: dict[tuple[Task, Hashable], Made] = {}
        self._seconds: dict[Task, list[float]] = {}

    def make(self, fitter: "HypothesisFitter", task: Task, asked: Mapping[Any, tuple]) -> None:
        """Compute fits: some here, and the others in parallel once the first prove to take long."""
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
        """Return whether this many fits take longer than their transfer, as far as is known."""
        worth = WORTH if self._have_started else WORTH_STARTING
        return count * float(np.mean(self._seconds.get(task, 0.0))) > worth

    def _hand_over(
        self, fitter: "HypothesisFitter", task: Task, asked: Mapping[Any, tuple]
    ) -> None:
        """Compute fits in parallel; where this fails the search computes all of them itself."""
        for _ in range(TRIES):
            left = {name: of for name, of in asked.items() if (task, name) not in self._made}
            packed = _pack(fitter, task, list(left.values()))
            if packed is None:
                break
            try:
                return self._collect(fitter, task, left, packed)
            except TimeIsUp:
                raise
            except Exception as error:  # a program error recurs when the search fits
                warn_user(LOST.format(type(error).__name__), SimulationWarning)
        self.n_processes = 1

    def _collect(
        self, fitter: "HypothesisFitter", task: Task, asked: Mapping[Any, tuple], packed: np.ndarray
    ) -> None:
        """Let the fits of a batch be computed, and keep them as they arrive."""
        batch = uuid4().hex
        calls = [delayed(_run)(batch, packed, at) for at in range(len(asked))]
        FitsAhead._have_started = True
        made = in_turn(calls, self.n_processes, batch_size=1)
        for (name, arguments), found in zip(asked.items(), made, strict=True):
            if found is not None:
                self._keep(task, name, Made(arguments, *found))
            fitter.progress.tick()

    def _keep(self, task: Task, name: Hashable, made: Made) -> None:
        """Keep a fit until it is requested, in place of the oldest that was not requested."""
        self._made[task, name] = made
        for old in list(self._made)[:-MOST]:
            del self._made[old]

    def take(self, task: Task, name: Hashable, *arguments: Any) -> Made | None:
        """Return a fit, once, if its task was called with exactly these arguments."""
        made = self._made.pop((task, name), None)
        pairs = () if made is None else zip(arguments, made.arguments, strict=False)
        return made if all(one is other for one, other in pairs) else None


# -- transfer to other processes -------------------------------------------------------------------


def _pack(fitter: "HypothesisFitter", task: Task, arguments: list[tuple]) -> np.ndarray | None:
    """Return the data other processes need, as an array: joblib sends one to each of them once.

    It is None if a part of the model cannot be pickled.
    """
    content = fitter.on_one_thread(), fitter.progress.time_left, task, arguments
    try:
        return np.frombuffer(cloudpickle.dumps(content), np.uint8)
    except (PicklingError, TypeError, AttributeError):
        return None


class _Received(threading.local):
    """The batch last received by a thread of a worker, so that it is unpacked only once."""

    batch = ""

    def unpack(self, batch: str, packed: np.ndarray) -> None:
        """Unpack a batch, unless it is the last one."""
        if batch != self.batch:
            self.fitter, left, self.task, self.arguments = cloudpickle.loads(packed)
            self.end, self.batch = None if left is None else monotonic() + left, batch

    def progress(self) -> Progress:
        """Return a progress that ends a fit when the time limit of the search is reached."""
        left = None if self.end is None else self.end - monotonic()
        progress = Progress(time_limit=left, kept_back=0.0)
        progress.counts = True
        return progress


_RECEIVED = _Received()


@one_thread_each()
def _run(batch: str, packed: np.ndarray, at: int) -> tuple[Any, FailureLog] | None:
    """Return one fit of a batch and its numerical failures; None after the time limit."""
    end_with_parent()
    _RECEIVED.unpack(batch, packed)
    fitter = _RECEIVED.fitter
    fitter.failures, fitter.progress = FailureLog(), _RECEIVED.progress()
    try:
        return _RECEIVED.task(fitter, *_RECEIVED.arguments[at]), fitter.failures
    except TimeIsUp:
        return None
