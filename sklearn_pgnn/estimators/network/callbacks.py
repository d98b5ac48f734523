"""Callbacks of the training: decay of the learning rate, and the best free run."""

import copy
import math

import numpy as np
from skorch.callbacks import Callback, LRScheduler


class EnoughTraining(Exception):
    """Raised to end a phase of the training early."""


class CosineDecay(Callback):
    r"""Let the learning rate of a phase fall to zero, :math:`\frac{1}{2}(1 + \cos \pi e/E)`.

    If there is an `LRScheduler` among the callbacks, it alone sets the learning rate.

    .. [1] I. Loshchilov, F. Hutter, "SGDR: stochastic gradient descent with warm restarts",
       ICLR 2017, arXiv:1608.03983.
    """

    def on_train_begin(self, net, **kwargs):
        """Note the learning rates that the phases begin with."""
        decides = not any(isinstance(part, LRScheduler) for _, part in net.callbacks_)
        self.groups_ = net.optimizer_.param_groups if decides else []
        self.rates_ = [group["lr"] for group in self.groups_]

    def on_epoch_begin(self, net, **kwargs):
        """Set the epoch's learning rate."""
        phase = net._phase
        if phase is not None:
            factor = phase.rate * (1 + math.cos(math.pi * phase.epoch / phase.epochs)) / 2
            self._set(factor)
            phase.epoch += 1

    def on_train_end(self, net, **kwargs):
        """Restore the learning rates, in case the training is continued."""
        self._set(1.0)
        self.groups_ = []

    def _set(self, factor) -> None:
        for group, rate in zip(self.groups_, self.rates_, strict=False):
            group["lr"] = rate * factor


class BestFreeRun(Callback):
    """Keep the weights with the best free run of the held-out trajectories; stop early.

    The history gets the error as ``free_run``, and its square, a mean squared error, as
    ``valid_loss``.

    Rollouts or the last phase end after `n_iter_no_change` epochs without a better free run. Single
    steps go on: their free run varies until the learning rate has decayed.
    """

    def __init__(self, n_iter_no_change=100):
        self.n_iter_no_change = n_iter_no_change

    def on_train_begin(self, net, **kwargs):
        """Reset, and note the error of previously trained weights."""
        self.best_, self.weights_, self.waited_ = np.inf, None, 0
        if _is_validated(net) and net.history:
            self.note(net, net._validation_error())

    def on_epoch_end(self, net, **kwargs):
        """Simulate the held-out trajectories, and keep the weights if they are the best."""
        if not _is_validated(net):
            return
        error = net._validation_error()
        for name, value in (("free_run", error), ("valid_loss", error**2)):
            net.history.record(name, value)
            net.history.record(f"{name}_best", bool(error < self.best_))
        self.note(net, error)
        if self.waited_ >= self.n_iter_no_change and not net.module_.teacher_forcing:
            raise EnoughTraining

    def note(self, net, error: float) -> None:
        """Keep the weights if they are the best so far."""
        self.waited_ += 1
        if error < self.best_:
            self.best_, self.waited_ = error, 0
            self.weights_ = copy.deepcopy(net.module_.state_dict())

    def restore(self, net) -> None:
        """Restore the best weights, and reset the count of epochs without progress."""
        if self.weights_ is not None:
            net.module_.load_state_dict(self.weights_)
        self.waited_ = 0


def _is_validated(net) -> bool:
    return net._data is not None and bool(net._data.validation)
