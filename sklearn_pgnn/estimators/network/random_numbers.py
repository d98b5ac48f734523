"""Torch's random numbers: a process has one stream, which trainings take in turn."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

import torch


class _StreamLock:
    """Whose turn it is; in a forked process that of nobody, whoever had it in the first one."""

    def __init__(self):
        self.lock = RLock()
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._renew)

    def _renew(self) -> None:
        self.lock = RLock()


_STREAM_LOCK = _StreamLock()


@contextmanager
def own_random_numbers() -> Iterator[None]:
    """Have torch's stream of random numbers alone, and give that of the processor back as it was.

    Weights, batches, and what a core, a callback or an optimizer of one's own may draw come from
    the one stream that torch has in a process. Whoever seeds it on a thread waits until no other
    thread is in here, and so draws what it would draw alone. A graphics card has a stream of its
    own: `torch.manual_seed` seeds that, too, and it stays as it was left in here.

    Examples
    --------
    >>> before = torch.get_rng_state()
    >>> with own_random_numbers():
    ...     _ = torch.manual_seed(0), torch.rand(3)
    >>> torch.equal(before, torch.get_rng_state())
    True
    """
    with _STREAM_LOCK.lock, torch.random.fork_rng(devices=[]):
        yield
