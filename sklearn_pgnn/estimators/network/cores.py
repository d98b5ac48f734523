# what torch and skorch set is not typed
# mypy: disable-error-code="has-type,assignment,operator,misc,union-attr,arg-type"
"""The cores of a network, layers in sequence or a recurrent unit, and a core for plain rows."""

from itertools import pairwise
from numbers import Integral

import numpy as np
import torch
from torch import nn

_ACTIVATIONS = {
    "tanh": nn.Tanh,
    "relu": nn.ReLU,
    "silu": nn.SiLU,
    "sigmoid": nn.Sigmoid,
    "identity": nn.Identity,
}


class FeedForward(nn.Module):
    """Hidden layers of equal width, then a linear output.

    Parameters
    ----------
    n_inputs : int, default=1
        Number of features.
    n_outputs : int, default=1
        Number of outputs.
    neurons : int, default=8
        Neurons of every hidden layer.
    layers : int, default=2
        Hidden layers.
    activation : {"tanh", "relu", "silu", "sigmoid", "identity"}, default="tanh"
        Activation of the hidden neurons.

    Examples
    --------
    >>> FeedForward(3, 1, neurons=5)(torch.zeros(7, 3)).shape
    torch.Size([7, 1])
    """

    def __init__(
        self,
        n_inputs: int = 1,
        n_outputs: int = 1,
        neurons: int = 8,
        layers: int = 2,
        activation: str = "tanh",
    ):
        super().__init__()
        _check_at_least_one("neurons", neurons)
        _check_at_least_one("layers", layers)
        if activation not in _ACTIVATIONS:
            raise ValueError(
                f"module__activation: expected one of {', '.join(_ACTIVATIONS)}, "
                f"got {activation!r}."
            )
        self.activation = activation
        self.sizes = (n_inputs, *[int(neurons)] * int(layers), n_outputs)
        parts: list[nn.Module] = []
        for n_in, n_out in pairwise(self.sizes):
            parts += [nn.Linear(n_in, n_out), _ACTIVATIONS[activation]()]
        self.layers = nn.Sequential(*parts[:-1])

    def forward(self, z: torch.Tensor) -> torch.Tensor:
        """Evaluate the network.

        Parameters
        ----------
        z : Tensor of shape (..., n_inputs)
            Standardised features.

        Returns
        -------
        Tensor of shape (..., n_outputs)
            Outputs of the network.
        """
        return self.layers(z)


class Recurrent(nn.Module):
    """A gated recurrent unit and a linear output.

    Parameters
    ----------
    n_inputs : int, default=1
        Number of features.
    n_outputs : int, default=1
        Number of outputs.
    neurons : int, default=8
        Hidden neurons.

    References
    ----------
    .. [1] K. Cho et al., "Learning phrase representations using RNN encoder-decoder for
       statistical machine translation", EMNLP 2014, :doi:`10.3115/v1/D14-1179`.

    Examples
    --------
    >>> core = Recurrent(3, 1, neurons=5)
    >>> output, hidden = core(torch.zeros(7, 3), core.at_rest(7))
    >>> output.shape, hidden.shape
    (torch.Size([7, 1]), torch.Size([7, 5]))
    """

    def __init__(self, n_inputs: int = 1, n_outputs: int = 1, neurons: int = 8):
        super().__init__()
        _check_at_least_one("neurons", neurons)
        self.sizes = (n_inputs, int(neurons), n_outputs)
        self.unit = nn.GRUCell(n_inputs, int(neurons))
        self.read = nn.Linear(int(neurons), n_outputs)

    def at_rest(self, n: int) -> torch.Tensor:
        """Return the initial hidden state of `n` trajectories.

        Parameters
        ----------
        n : int
            Number of trajectories.

        Returns
        -------
        Tensor of shape (n, neurons)
            Zeros.
        """
        return self.read.weight.new_zeros(n, self.sizes[1])

    def forward(self, z: torch.Tensor, hidden: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Advance by one sample.

        Parameters
        ----------
        z : Tensor of shape (n, n_inputs)
            Standardised features.
        hidden : Tensor of shape (n, neurons)
            Hidden state.

        Returns
        -------
        output : Tensor of shape (n, n_outputs)
            Outputs of the network.
        hidden : Tensor of shape (n, neurons)
            The next hidden state.
        """
        hidden = self.unit(z, hidden)
        return self.read(hidden), hidden


class RowNetwork(nn.Module):
    """A core between the scalings of features and of targets."""

    def __init__(self, core: nn.Module, X: np.ndarray, y: np.ndarray):
        super().__init__()
        self.core = core
        for name, values in (("X", X), ("y", y)):
            spread = values.std(axis=0)
            self.register_buffer(f"mean_{name}", torch.as_tensor(values.mean(axis=0)))
            self.register_buffer(f"scale_{name}", torch.as_tensor(np.where(spread > 0, spread, 1)))

    def forward(self, X):
        """Predict targets (n, n_outputs) from features (n, n_features)."""
        z = (X - self.mean_X) / self.scale_X
        if hasattr(self.core, "at_rest"):
            return self.mean_y + self.scale_y * self.core(z, self.core.at_rest(len(z)))[0]
        return self.mean_y + self.scale_y * self.core(z)


def _check_at_least_one(name, number):
    if not isinstance(number, Integral) or number < 1:
        raise ValueError(f"module__{name}: expected an integer >= 1, got {number!r}.")
