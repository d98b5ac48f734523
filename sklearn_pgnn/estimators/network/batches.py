"""Batches cut from whole tensors: much faster than collating samples one by one."""

import torch
from torch.utils.data import Subset

#: least number of batches that a small set of windows is cut into
MIN_BATCHES = 16


class TensorBatches:
    """Go through a data set of tensors, batch by batch.

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
