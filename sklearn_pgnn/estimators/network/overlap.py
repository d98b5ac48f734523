r"""The part of the network's output that other values of the model's parameters could express.

Over the training rows the network's contribution :math:`N` and the derivatives :math:`J` of the
model's step by its free parameters are vectors of one space. The share of :math:`N` that lies in
the column space of :math:`J`,

.. math:: h = \frac{1}{\sqrt n} Q^T N, \qquad J = Q R,

is penalised, so that the parameters take what they can express, and the network the rest [1]_.

References
----------
.. [1] B. M. Gyoerok, J. H. Hoekstra, J. Kon, T. Peni, M. Schoukens, R. Toth, "Orthogonal
   projection-based regularization for efficient model augmentation", 2025, arXiv:2501.05842.
"""

import copy

import numpy as np
import torch
from torch import nn

from sklearn_pgnn.estimators.network.dissipation import dissipated
from sklearn_pgnn.estimators.network.free_parameters import FreeParameters
from sklearn_pgnn.estimators.network.records import TrainingWindows
from sklearn_pgnn.estimators.network.structure import corrected_states
from sklearn_pgnn.simulation.network_run import NetworkStep, energy_values, prior_steps

#: maximum number of training rows that are used
ROWS = 1500
#: parameter directions with less effect than this share of the strongest count as without effect
RANK = 1e-6


class Overlap:
    """The part of a network's output that the model's parameters could express."""

    def __init__(self, step: NetworkStep, free: FreeParameters, windows: TrainingWindows):
        rows = windows.pairs[:: max(1, len(windows.pairs) // ROWS)]
        own = corrected_states(step.model, "correction")
        left = np.sqrt(np.mean((windows.x[rows + 1] - windows.prior[rows]) ** 2, axis=0))[own]
        left = np.where(left > 0, left, 1.0)
        dt = windows.samples["dt"][rows, None, None]
        gain = (step.gain[0] + dt * (step.gain[1] + dt * step.gain[2]))[:, own] / left[:, None]
        self._gain = torch.as_tensor(gain)
        self._loss = _Loss(step, windows, rows, own, left) if step.loss else None
        self._seen = torch.as_tensor(_features(step, windows, rows))
        slopes = _slopes(step, free, windows, rows)[:, own] / left[:, None]
        basis = _basis(slopes.reshape(-1, len(free.names)))
        self._basis = torch.as_tensor(basis / np.sqrt(len(basis)))

    def __call__(self, core: nn.Module) -> torch.Tensor:
        """Return the overlap with every direction of the parameters; its square is the share."""
        seen = self._seen.to(next(core.parameters()).device)
        at_rest = getattr(core, "at_rest", None)
        output = core(seen) if at_rest is None else core(seen, at_rest(len(seen)))[0]
        said = torch.einsum("nso,no->ns", self._gain.to(output.device), output)
        if self._loss is not None:
            said = said + self._loss(output)
        return self._basis.to(output.device).T @ said.reshape(-1)

    def with_slopes(self, core: nn.Module, weights: np.ndarray):
        """Return the overlap and its derivatives by the weights.

        The network's own weights do not matter. The overlap has shape (n_directions,), its
        derivatives (n_directions, n_weights).
        """
        core = copy.deepcopy(core).cpu()
        nn.utils.vector_to_parameters(torch.as_tensor(weights), core.parameters())
        parts = list(core.parameters())
        overlap = self(core)
        slopes = [
            nn.utils.parameters_to_vector(torch.autograd.grad(each, parts, retain_graph=True))
            for each in overlap
        ]
        return overlap.detach().numpy(), np.array([each.numpy() for each in slopes])


class _Loss:
    """What a dissipative network takes out at the training rows, relative to the model's error."""

    def __init__(self, step, windows, rows, own, left):
        places = [list(step.model.states).index(name) for name in step.loss.states]
        at = windows.samples["t"][rows], windows.prior[rows], windows.samples["acting"][rows]
        parts = energy_values(step.model, step.loss.states, *at)[0]
        spread = np.array([[place == i for i in own] for place in places]) / left
        self._given = [
            torch.as_tensor(part)
            for part in (parts, step.loss.root, windows.samples["dt"][rows, None], spread)
        ]

    def __call__(self, output):
        parts, root, dt, spread = (part.to(output.device) for part in self._given)
        return dissipated(output, parts, root, dt) @ spread


def _features(step, windows, rows) -> np.ndarray:
    """Return what the network sees at the training rows, standardised."""
    parts = [windows.seen[rows], windows.u[rows]]
    if step.guide == "step":
        parts.append((windows.prior[rows] - windows.x[rows]) / windows.samples["dt"][rows, None])
    elif step.guide == "terms":
        parts.append(windows.terms[rows])
    return (np.hstack([*parts, windows.features[rows + 1]]) - step.mean) / step.scale


def _slopes(step, free, windows, rows) -> np.ndarray:
    """Return the derivatives of the model's step by the relative changes of its parameters."""
    samples = windows.samples
    slopes = prior_steps(
        step.model, step.substeps, step.hold, samples["t"][rows], samples["dt"][rows],
        windows.x[rows], samples["acting"][rows], samples["acting_next"][rows], free.names,
    )[1]  # fmt: skip
    return slopes[:, :, : len(free.names)] * free.unit


def _basis(slopes: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the column space."""
    size = np.linalg.norm(slopes, axis=0)
    left, values, _ = np.linalg.svd(slopes / np.where(size > 0, size, 1.0), full_matrices=False)
    return left[:, values > RANK * values[:1].max(initial=0.0)]
