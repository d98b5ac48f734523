"""What happens between the epochs: the learning rate decays, and the best free run is kept."""

import copy
import math

import numpy as np
from skorch.callbacks import Callback


class EnoughTraining(Exception):
    """Raised to end a phase of the training early."""


class CosineDecay(Callback):
    r"""Let the learning rate of a phase fall to zero, :math:`\frac{1}{2}(1 + \cos \pi e/E)`.

    References
    ----------
    .. [1] I. Loshchilov, F. Hutter, "SGDR: stochastic gradient descent with warm restarts",
       ICLR 2017, arXiv:1608.03983.
    """

    def on_epoch_begin(self, net, **kwargs):
        """Set the epoch's learning rate."""
        phase = net._phase
        if phase is not None:
            factor = (1 + math.cos(math.pi * phase.epoch / phase.epochs)) / 2
            for group, rate in zip(net.optimizer_.param_groups, phase.rates, strict=True):
                group["lr"] = rate * factor

    def on_epoch_end(self, net, **kwargs):
        """Count the epoch."""
        if net._phase is not None:
            net._phase.epoch += 1


class BestFreeRun(Callback):
    """Keep the weights whose free run of the held-out trajectories is best; end without progress.

    Parameters
    ----------
    patience : int, default=20
        Epochs without a better free run after which rollouts or the last phase end. Single steps
        go on: their free run varies until the learning rate has decayed.
    """

    def __init__(self, patience=20):
        self.patience = patience

    def on_train_begin(self, net, **kwargs):
        """Begin anew."""
        self.best_, self.weights_, self.waited_ = np.inf, None, 0

    def on_epoch_end(self, net, **kwargs):
        """Run the held-out trajectories, and compare."""
        if not net._validation:
            return
        error = net._validation_error()
        net.history.record("free_run", error)
        net.history.record("free_run_best", bool(error < self.best_))
        self.note(net, error)
        if self.waited_ >= self.patience and not net.module_.teacher_forcing:
            raise EnoughTraining

    def note(self, net, error: float) -> None:
        """Keep the weights if they are the best so far."""
        self.waited_ += 1
        if error < self.best_:
            self.best_, self.waited_ = error, 0
            self.weights_ = copy.deepcopy(net.module_.core.state_dict())

    def restore(self, net) -> None:
        """Go back to the best weights, and wait anew."""
        if self.weights_ is not None:
            net.module_.core.load_state_dict(self.weights_)
        self.waited_ = 0
