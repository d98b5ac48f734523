"""Torch's random numbers: trainings use the one stream of a process in turn."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

import torch


class _StreamLock:
    """Lock on the random stream; in a forked process it starts unlocked, whoever held it before."""

    def __init__(self):
        self.lock = RLock()
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._renew)

    def _renew(self) -> None:
        self.lock = RLock()


_STREAM_LOCK = _StreamLock()


@contextmanager
def own_random_numbers() -> Iterator[None]:
    """Hold torch's random stream exclusively, and restore that of the CPU afterwards.

    Weights, batches, and the random numbers of a user-defined core, callback or optimizer come from
    the one stream that torch has in a process. A thread that seeds it waits until no other thread
    is in this context, and so draws the same numbers as it would alone. A GPU has a stream of its
    own: `torch.manual_seed` seeds that, too, and it is not restored.

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
