"""A trained network: its free run, a step in real time, and its training beside plain skorch."""

import warnings

import numpy as np
import torch
from measure import Row, best_times, times_as_fast
from skorch import NeuralNetRegressor
from torch import nn

from sklearn_pgnn import PGNNLRegressor, datasets, systems

FEW, STEPS = 500, 1000


class Plain(nn.Module):
    """The network that a user would write: one hidden layer."""

    def __init__(self, inputs, outputs, neurons):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(inputs, neurons), nn.Tanh(), nn.Linear(neurons, outputs)
        )

    def forward(self, X):
        """Return the change of the state."""
        return self.layers(X)


def rows():
    """Yield the rows on networks."""
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    X, y = datasets.make_golf_robot()
    robot = systems.golf_robot()
    network = PGNNLRegressor(robot, random_state=0)
    inputs = np.random.default_rng(0).standard_normal((len(X), 3)).astype(np.float32)
    targets = inputs[:, :2].copy()
    skorch = NeuralNetRegressor(
        Plain, module__inputs=3, module__outputs=2, module__neurons=32, max_epochs=50, lr=0.01,
        optimizer=torch.optim.Adam, batch_size=min(2048, -(-len(X) // 16)), train_split=None,
        verbose=0,
    )  # fmt: skip
    mine, theirs = best_times(
        lambda: network.fit(X, y), lambda: skorch.fit(inputs, targets), repeats=1
    )
    work = f"training of a network, {len(X)} samples"
    yield Row(work, mine, "plain skorch, the first phase", mine / theirs, 1.3)
    yield times_as_fast(
        f"network, free run of {len(X)} samples", lambda: network.predict(X),
        f"a torch loop, {FEW} samples", _torch_loop(skorch.module_), 100.0,
        samples=(len(X), FEW),
    )  # fmt: skip
    stepper = network.stepper(x0=[0.0, 0.0])

    def steps():
        for _ in range(STEPS):
            stepper.step([0.1])

    (took,) = best_times(steps)
    yield Row("a step of the stepper", took / STEPS, "20 µs", took / STEPS / 20e-6, 1.0)


def _torch_loop(module):
    """Return a free run of a network, step by step in torch."""

    @torch.no_grad()
    def run():
        x, u = torch.zeros(2), torch.zeros(1)
        for _ in range(FEW):
            x = x + 1e-3 * module(torch.cat([x, u]))
        return x

    return run
