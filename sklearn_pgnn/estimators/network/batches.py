"""Batches cut from whole tensors, and the stream of random numbers that they are drawn from."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

import torch
from torch.utils.data import Subset

#: least number of batches that a small set of windows is cut into
MIN_BATCHES = 16


class TensorBatches:
    """Go through a data set of tensors, batch by batch, much faster than sample by sample.

    ``X`` of the data set is an array or a dict of arrays, its ``y`` an array. The batch size is
    reduced if there would be fewer than 16 batches; with `shuffle` the samples are taken in a new
    order each time.
    """

    def __init__(self, dataset, batch_size=1, shuffle=False):
        self.dataset, self.shuffle = dataset, shuffle
        n = len(dataset)
        self.batch_size = n if batch_size == -1 else max(1, min(batch_size, n // MIN_BATCHES))

    def __len__(self):
        return -(-len(self.dataset) // self.batch_size)

    def __iter__(self):
        n = len(self.dataset)
        order = torch.randperm(n) if self.shuffle else torch.arange(n)
        whole = self.dataset
        while isinstance(whole, Subset):
            whole, order = whole.dataset, torch.as_tensor(whole.indices)[order]
        X, y = _tensors(whole.X), _tensors(whole.y)
        for rows in order.split(self.batch_size):
            yield _take(X, rows), _take(y, rows)


def _tensors(part):
    if isinstance(part, dict):
        return {name: torch.as_tensor(values) for name, values in part.items()}
    return torch.as_tensor(part)


def _take(part, rows):
    if isinstance(part, dict):
        return {name: _take(values, rows) for name, values in part.items()}
    return part.index_select(0, rows)


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
    """
    with _STREAM_LOCK.lock, torch.random.fork_rng(devices=[]):
        yield
