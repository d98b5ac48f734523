"""The network on rows that have no time: a plain regression."""

import numpy as np
import torch
from torch import nn


class RowNetwork(nn.Module):
    """A core between two scalings.

    The core maps standardised features to standardised targets; X and y are those of the training
    data.
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

        Features have shape (n, n_features), targets (n, n_outputs).
        """
        z = (X - self.mean_X) / self.scale_X
        if hasattr(self.core, "at_rest"):
            return self.mean_y + self.scale_y * self.core(z, self.core.at_rest(len(z)))[0]
        return self.mean_y + self.scale_y * self.core(z)
