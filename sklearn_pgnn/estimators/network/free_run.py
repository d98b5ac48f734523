"""Free run of a trained network: compiled for the package's own cores, else in torch."""

from dataclasses import replace
from functools import partial

import numpy as np
import torch
from torch import nn

from sklearn_pgnn.estimators.network.cores import FeedForward, Recurrent
from sklearn_pgnn.estimators.network.step_network import StepNetwork
from sklearn_pgnn.estimators.network.torch_functions import torch_value
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.network_run import (
    FreeRun,
    NetworkRecord,
    NetworkStep,
    parameter_units,
)


def is_compiled(core: nn.Module) -> bool:
    """Return whether a core has a compiled loop."""
    return type(core) in (FeedForward, Recurrent)


def step_with(core: nn.Module, step: NetworkStep) -> NetworkStep:
    """Complete a step by the core's sizes, for the compiled loop."""
    if type(core) is FeedForward:
        return replace(step, sizes=core.sizes, activation=core.activation)
    if type(core) is Recurrent:
        return replace(step, sizes=core.sizes, core="recurrent")
    return step


def tuned(step: NetworkStep, changes: np.ndarray) -> NetworkStep:
    """Return a step with its free parameters set to their values; the guide stays the same."""
    units = parameter_units(step.model, step.free)
    values = {
        name: step.model.parameters[name].value + float(unit * change)
        for name, unit, change in zip(step.free, units, changes, strict=True)
    }
    model = step.model.with_parameters(**values)
    return replace(step, model=model, guide_model=step.terms_from, free=())


def weights_of(core: nn.Module) -> np.ndarray:
    """Return all weights of a core in one array."""
    return nn.utils.parameters_to_vector(core.parameters()).detach().cpu().numpy().astype(float)


def compiled_run(core: nn.Module, step: NetworkStep, changes=()) -> FreeRun:
    """Prepare the free run of a compiled core, with its present weights.

    `changes` are relative ones of the step's free parameters; for the core see `is_compiled`.
    """
    return FreeRun(step_with(core, step), np.append(weights_of(core), changes))


def ready_to_run(core: nn.Module, step: NetworkStep, changes=()):
    """Prepare a network's free run, once for many trajectories.

    Return a function that takes a `NetworkRecord` and returns the same as `run_core`. `changes` are
    relative ones of the step's free parameters.
    """
    if is_compiled(core):
        return compiled_run(core, step, changes)
    return partial(_run_within_reach, core, tuned(step, changes) if step.free else step)


def run_core(core: nn.Module, step: NetworkStep, record: NetworkRecord, changes=()):
    """Run a network in free run along a trajectory.

    Return the states, of shape (n_samples, n_states), the last ones within reach being repeated
    once they leave it, and the first sample out of reach, -1 if there is none. `changes` are
    relative ones of the step's free parameters.
    """
    return ready_to_run(core, step, changes)(record)


def _run_within_reach(core, step, record):
    x = record.x0[None] if len(record.t) == 1 else _run_torch(core, step, record)
    inside = np.all((step.reach[0] <= x) & (x <= step.reach[1]), axis=1)
    failed = -1 if inside.all() else int(np.argmin(inside))
    if failed > 0:
        x[failed:] = x[failed - 1]
    return x, failed


def _run_torch(core, step, record):
    """Run a user's own core, step by step."""
    n = len(record.t) - 1
    samples = {
        "t": record.t,
        "dt": np.append(np.diff(record.t), 0.0),
        "acting": record.acting,
        "acting_next": np.vstack([record.acting[1:], record.acting[-1:]]),
    }
    device = next(core.parameters()).device
    network = StepNetwork(core, step, samples).to(device)
    network.teacher_forcing = False

    def tensor(values):
        return torch.as_tensor(values, device=device)[None]

    further = {}
    if step.guide == "simulation":
        further["simulated"] = tensor(record.simulated[1:])
    if record.features.shape[1]:
        further["features"] = tensor(record.features[1:])
    core.eval()
    with torch.no_grad():
        x = network(
            tensor(record.x0[None]), tensor(record.u[:-1]), tensor(record.t),
            tensor(np.arange(n)), **further,
        )[0]  # fmt: skip
    return np.vstack([record.x0[None], x.cpu().numpy()])


def outputs_of(model: PhysicsModel, x: torch.Tensor, u: torch.Tensor, t: torch.Tensor, tuned=None):
    """Return the outputs of states.

    States have shape (..., n_states), inputs (..., n_inputs) and times [s] (...); `tuned` are
    values of parameters in place of the model's.
    """
    values: dict[str, torch.Tensor | float] = {"t": t}
    values |= {name: x[..., i] for i, name in enumerate(model.states)}
    values |= {name: u[..., i] for i, name in enumerate(model.inputs)}
    values |= {name: parameter.value for name, parameter in model.parameters.items()}
    values |= tuned or {}
    return torch.stack([torch_value(g, values) for g in model.outputs.values()], dim=-1)
