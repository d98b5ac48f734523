"""The network on rows that have no time: a plain regression."""

import numpy as np
import torch
from torch import nn


class RowNetwork(nn.Module):
    """A core between two scalings.

    Parameters
    ----------
    core : Module
        Maps standardised features to standardised targets.
    X : ndarray of shape (n_samples, n_features)
        Features of the training data.
    y : ndarray of shape (n_samples, n_outputs)
        Their targets.
    """

    def __init__(self, core: nn.Module, X: np.ndarray, y: np.ndarray):
        super().__init__()
        self.core = core
        for name, values in (("X", X), ("y", y)):
            spread = values.std(axis=0)
            self.register_buffer(f"mean_{name}", torch.as_tensor(values.mean(axis=0)))
            self.register_buffer(f"scale_{name}", torch.as_tensor(np.where(spread > 0, spread, 1)))

    def forward(self, X):
        """Predict the targets.

        Parameters
        ----------
        X : Tensor of shape (n, n_features)
            Features.

        Returns
        -------
        Tensor of shape (n, n_outputs)
            Targets.
        """
        z = (X - self.mean_X) / self.scale_X
        if hasattr(self.core, "at_rest"):
            return self.mean_y + self.scale_y * self.core(z, self.core.at_rest(len(z)))[0]
        return self.mean_y + self.scale_y * self.core(z)
