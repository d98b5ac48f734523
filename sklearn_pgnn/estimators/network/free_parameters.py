r"""The parameters of a model that are trained with the network, within their spread.

Over the training rows the network's contribution :math:`N` and the derivatives :math:`J` of the
model's step by its free parameters are vectors of one space. The share of :math:`N` that lies in
the column space of :math:`J`,

.. math:: h = \frac{1}{\sqrt n} Q^T N, \qquad J = Q R,

is penalised, so that they take what they can express, and the network the rest [1]_.

References
----------
.. [1] B. M. Gyoerok, J. H. Hoekstra, J. Kon, T. Peni, M. Schoukens, R. Toth, "Orthogonal
   projection-based regularization for efficient model augmentation", 2025, arXiv:2501.05842.
"""

import copy
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from sklearn_pgnn.estimators.network.records import TrainingWindows
from sklearn_pgnn.estimators.network.structure import corrected_states
from sklearn_pgnn.estimators.network.torch_functions import dissipated
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.network_run import (
    NetworkStep,
    energy_values,
    parameter_units,
    prior_steps,
)
from sklearn_pgnn.simulation.uncertainty import Estimate

#: every parameter of the model that is not fixed
ALL = "all"
#: a parameter this close to the end of its range, as a share of the range, is at its end
AT_THE_END = 1e-6
#: maximum number of training rows that the overlap is taken over
ROWS = 1500
#: parameter directions with less effect than this share of the strongest count as without effect
RANK = 1e-6


@dataclass(frozen=True)
class FreeParameters:
    """Parameters as relative changes, within limits, from their values at the training's start."""

    names: tuple[str, ...]
    start: np.ndarray
    unit: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, prior: PhysicsModel, start: PhysicsModel, names) -> "FreeParameters":
        """Let parameters vary from their start as far as the prior's spread and bounds allow."""
        names = tuple(names)
        given = [prior.parameters[name] for name in names]
        now = np.array([start.parameters[name].value for name in names])
        unit = parameter_units(start, names)
        low = np.array([max(p.bounds[0], p.value - p.reach) for p in given])
        high = np.array([min(p.bounds[1], p.value + p.reach) for p in given])
        return cls(names, now, unit, (low - now) / unit, (high - now) / unit)

    def values(self, changes) -> dict:
        """Return the parameters' values by name, as numbers or tensors like the changes."""
        known = zip(self.names, self.start.tolist(), self.unit.tolist(), strict=True)
        return {name: a + b * changes[..., i] for i, (name, a, b) in enumerate(known)}

    def estimates(self, model: PhysicsModel, changes, reach) -> dict[str, Estimate]:
        """Return the values with intervals that reach so far to each side, within the range."""
        ends = np.clip(changes - reach, self.low, self.high), changes, changes + reach
        low, value, high = (self.values(np.minimum(each, self.high)) for each in ends)
        return {
            name: Estimate(
                float(value[name]), float(low[name]), float(high[name]), model.parameters[name].unit
            )
            for name in self.names
        }

    def at_the_end(self, changes: np.ndarray) -> list[str]:
        """Name the parameters that ended at a limit of their range."""
        near = np.minimum(changes - self.low, self.high - changes)
        reached = near <= AT_THE_END * np.minimum(self.high - self.low, 1.0)
        return [name for name, is_at in zip(self.names, reached, strict=True) if is_at]


def names_of(model: PhysicsModel | None, free) -> tuple[str, ...]:
    """Read the parameter ``free``: None for no parameter, ``"all"``, or names."""
    if free is None:
        return ()
    if model is None:
        raise ValueError(f"free={free!r} needs a model, got none. Remedy: give model=.")
    if isinstance(free, str):
        if free == ALL:
            return tuple(model.free_parameters)
        raise ValueError(
            f"free: expected {ALL!r}, or a sequence of parameters among "
            f"{', '.join(model.parameters)}, got {free!r}. Remedy: free=[{free!r}]."
        )
    unknown = [name for name in free if name not in model.parameters]
    if unknown:
        raise ValueError(
            f"free: expected parameters among {', '.join(model.parameters)}, got {unknown[0]!r}."
        )
    return tuple(free)


class Overlap:
    """The part of a network's output that the model's parameters could express."""

    def __init__(self, step: NetworkStep, free: FreeParameters, windows: TrainingWindows):
        rows = windows.pairs[:: max(1, len(windows.pairs) // ROWS)]
        here = {name: part[rows] for name, part in windows.samples.items()}
        own = corrected_states(step.model, "correction")
        left = np.sqrt(np.mean((windows.x[rows + 1] - windows.prior[rows]) ** 2, axis=0))[own]
        left = np.where(left > 0, left, 1.0)
        dt = here["dt"][:, None, None]
        gain = (step.gain[0] + dt * (step.gain[1] + dt * step.gain[2]))[:, own] / left[:, None]
        seen = (windows.features_of(step.guide, rows) - step.mean) / step.scale
        self._gain, self._seen, self._lossy = torch.as_tensor(gain), torch.as_tensor(seen), []
        if step.loss:
            at = here["t"], windows.prior[rows], here["acting"]
            parts = energy_values(step.model, step.loss.states, *at)[0]
            names = list(step.model.states)
            spread = np.array([[s == names[i] for i in own] for s in step.loss.states]) / left
            given = parts, step.loss.root, here["dt"][:, None], spread
            self._lossy = [torch.as_tensor(part) for part in given]
        slopes = prior_steps(
            step.model, step.substeps, step.hold, here["t"], here["dt"], windows.x[rows],
            here["acting"], here["acting_next"], free.names,
        )[1]  # fmt: skip
        slopes = (slopes[:, :, : len(free.names)] * free.unit)[:, own] / left[:, None]
        basis = _basis(slopes.reshape(-1, len(free.names)))
        self._basis = torch.as_tensor(basis / np.sqrt(len(basis)))

    def __call__(self, core: nn.Module) -> torch.Tensor:
        """Return the overlap with every direction of the parameters; its square is the share."""
        seen = self._seen.to(next(core.parameters()).device)
        at_rest = getattr(core, "at_rest", None)
        output = core(seen) if at_rest is None else core(seen, at_rest(len(seen)))[0]
        said = torch.einsum("nso,no->ns", self._gain.to(output.device), output)
        if self._lossy:
            parts, root, dt, spread = (part.to(output.device) for part in self._lossy)
            said = said + dissipated(output, parts, root, dt) @ spread
        return self._basis.to(output.device).T @ said.reshape(-1)

    def with_slopes(self, core: nn.Module, weights: np.ndarray):
        """Return the overlap and its derivatives by the weights, (n_directions, n_weights)."""
        core = copy.deepcopy(core).cpu()
        nn.utils.vector_to_parameters(torch.as_tensor(weights), core.parameters())
        parts = list(core.parameters())
        overlap = self(core)
        slopes = [
            nn.utils.parameters_to_vector(torch.autograd.grad(each, parts, retain_graph=True))
            for each in overlap
        ]
        return overlap.detach().numpy(), np.array([each.numpy() for each in slopes])


def _basis(slopes: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the column space."""
    size = np.linalg.norm(slopes, axis=0)
    left, values, _ = np.linalg.svd(slopes / np.where(size > 0, size, 1.0), full_matrices=False)
    return left[:, values > RANK * values[:1].max(initial=0.0)]
