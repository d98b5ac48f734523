"""The network in feedback as a torch module, and its free run, compiled where the core allows."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import torch
from torch import nn

from sklearn_pgnn.estimators.network.cores import FeedForward, Recurrent
from sklearn_pgnn.estimators.network.free_parameters import FreeParameters
from sklearn_pgnn.estimators.network.torch_functions import dissipated
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.network_run import (
    FreeRun,
    NetworkRecord,
    NetworkStep,
    energy_values,
    prior_steps,
    samples_of,
    term_values,
)
from sklearn_pgnn.simulation.pointwise import numpy_function


class StepNetwork(nn.Module):
    """A core in feedback, over windows of several steps.

    The core maps standardised features to the network's outputs; one that has ``at_rest`` also
    takes and gives a hidden state. `samples` has time ``t``, step ``dt``, acting inputs ``acting``
    and ``acting_next`` of every training sample, which the model's own step needs; `n_free` is the
    number of parameters of the model that are trained, too.

    With ``teacher_forcing`` the measured state is fed back; otherwise the predicted state.
    ``changes`` are the relative changes of the parameters ``free``, which are kept in their range.
    """

    free: FreeParameters | None = None

    def __init__(self, core: nn.Module, step: NetworkStep, samples: dict, n_free: int = 0):
        super().__init__()
        self.core, self.step, self.samples = core, step, samples
        self.changes = nn.Parameter(torch.zeros(n_free)) if n_free else None
        self.teacher_forcing = True
        self.gain_is_used = [bool(matrix.any()) for matrix in step.gain]
        for name in ("offset", "gain", "mean", "scale"):
            self.register_buffer(name, torch.tensor(getattr(step, name)), persistent=False)
        if step.loss:
            self.register_buffer("root", torch.tensor(step.loss.root), persistent=False)

    def forward(self, x, u, t, index, prior=None, terms=None, simulated=None, features=None):
        """Predict the states of windows.

        `x`, of shape (n, length + 1, n_states), are measured states; only the first is read, unless
        ``teacher_forcing``. `u`, (n, length, n_inputs), are inputs from each sample to the next,
        `t`, (n, length + 1), times [s], and `index`, (n, length), indices of the samples in
        `samples`. `prior` and `terms` are the model's step from, and its terms at, the measured
        states; `simulated` and `features` the open-loop simulation and further columns at the next
        sample. Return the states of the samples after the first, (n, length, n_states).
        """
        if self.free is not None and self.changes is not None:
            low, high = (self.changes.new_tensor(end) for end in (self.free.low, self.free.high))
            with torch.no_grad():
                self.changes.clamp_(low, high)
        hidden = self.core.at_rest(len(x)) if hasattr(self.core, "at_rest") else None
        dt, state, predicted = torch.diff(t, dim=1), x[:, 0], []
        for k in range(u.shape[1]):
            known: list = [None, None]
            if self.teacher_forcing:
                state = x[:, k]
                known = [None if part is None else part[:, k] for part in (prior, terms)]
            further = [part[:, k] for part in (simulated, features) if part is not None]
            state, hidden = self._advance(
                state, u[:, k], dt[:, k, None], index[:, k], *known, further, hidden
            )
            predicted.append(state)
        return torch.stack(predicted, dim=1)

    def prior(self, x, index) -> torch.Tensor:
        """Return the model's own step from states, with the parameters as they are now."""
        free: tuple[str, ...] = ()
        unit, model = np.zeros(0), self.step.model
        if self.free is not None and self.changes is not None:
            free, unit = self.free.names, self.free.unit
            model = model.with_parameters(**self.free.values(self.changes.detach().cpu().numpy()))
        here = self._samples_at(index)

        def compute(x):
            x_next, jacobian = prior_steps(
                model, self.step.substeps, self.step.hold, here["t"], here["dt"], x,
                here["acting"], here["acting_next"], free,
            )  # fmt: skip
            jacobian[:, :, : len(free)] *= unit
            return x_next, jacobian

        return _Compiled.apply(x, compute, self.changes if free else None)

    def _terms(self, x, index) -> torch.Tensor:
        step, here = self.step, self._samples_at(index)
        return _Compiled.apply(
            x,
            lambda x: term_values(step.terms_from, here["t"], x, here["acting"], step.state_spread),
        )

    def _samples_at(self, index) -> dict:
        rows = index.cpu().numpy()
        return {name: part[rows] for name, part in self.samples.items()}

    def _advance(self, x, u, dt, index, prior, terms, further, hidden):
        step = self.step
        if step.needs_prior and prior is None:
            prior = self.prior(x, index)
        at = x + step.seen_at * (prior - x) if step.seen_at else x
        seen = [at, u]
        if step.guide == "step":
            seen.append((prior - x) / dt)
        elif step.guide == "terms":
            seen.append(self._terms(at, index) if terms is None else terms)
        z = (torch.cat([*seen, *further], dim=1) - self.mean) / self.scale
        if hidden is None:
            output = self.core(z)
        else:
            output, hidden = self.core(z, hidden)
        base = {"constant": self.offset, "state": x, "prior": prior}[step.base]
        if step.loss:
            return self._lose(prior, output, dt, index), hidden
        at_once, rate, twice = (
            output @ matrix.T if used else 0.0
            for matrix, used in zip(self.gain, self.gain_is_used, strict=True)
        )
        return base + at_once + dt * (rate + dt * twice), hidden

    def _lose(self, prior, output, dt, index):
        """Return the states after the network has taken energy out."""
        step, here = self.step, self._samples_at(index)
        parts = _Compiled.apply(
            prior,
            lambda x: energy_values(step.model, step.loss.states, here["t"], x, here["acting"]),
        )
        places = [list(step.model.states).index(name) for name in step.loss.states]
        change = dissipated(output, parts, self.root, dt)
        return prior.index_add(1, torch.as_tensor(places, device=prior.device), change)


class _Compiled(torch.autograd.Function):
    """What compiled code makes of states; its derivatives, by changes and states, lead backward."""

    @staticmethod
    def forward(ctx, x, compute, changes=None):
        values, jacobian = compute(x.detach().cpu().numpy())
        ctx.n_free = jacobian.shape[2] - x.shape[1]
        ctx.save_for_backward(torch.as_tensor(jacobian, device=x.device))
        return torch.as_tensor(values, device=x.device)

    @staticmethod
    def backward(ctx, grad):
        (jacobian,), n = ctx.saved_tensors, ctx.n_free
        slopes = torch.einsum("ni,nij->nj", grad, jacobian)
        return slopes[:, n:], None, slopes[:, :n].sum(dim=0) if n else None


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
    values = {name: float(value) for name, value in step.values_at(changes).items()}
    model = step.model.with_parameters(**values)
    return replace(step, model=model, guide_model=step.terms_from, free=())


def weights_of(core: nn.Module) -> np.ndarray:
    """Return all weights of a core in one array."""
    return nn.utils.parameters_to_vector(core.parameters()).detach().cpu().numpy().astype(float)


def ready_to_run(core: nn.Module, step: NetworkStep, changes=()) -> Callable:
    """Prepare a network's free run, once for many trajectories, with its present weights.

    Return a function of a `NetworkRecord` that returns the states, of shape (n_samples, n_states),
    the last ones within reach being repeated once they leave it, and the first sample out of reach,
    -1 if there is none. `changes` are relative ones of the step's free parameters.
    """
    if is_compiled(core):
        return FreeRun(step_with(core, step), np.append(weights_of(core), changes))
    return partial(_run_within_reach, core, tuned(step, changes) if step.free else step)


def _run_within_reach(core, step, record):
    x = record.x0[None] if len(record.t) == 1 else _run_torch(core, step, record)
    inside = np.all((step.reach[0] <= x) & (x <= step.reach[1]), axis=1)
    failed = -1 if inside.all() else int(np.argmin(inside))
    if failed > 0:
        x[failed:] = x[failed - 1]
    return x, failed


def _run_torch(core, step, record):
    """Run a user's own core, step by step."""
    device = next(core.parameters()).device
    network = StepNetwork(core, step, samples_of(record.t, record.acting)).to(device)
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
            tensor(np.arange(len(record.t) - 1)), **further,
        )[0]  # fmt: skip
    return np.vstack([record.x0[None], x.cpu().numpy()])


def piece_run(core: nn.Module, step: NetworkStep) -> Callable:
    """Prepare a network's runs along pieces of trajectories, of which a filter needs very many.

    Return a function of a trajectory, the places of its own samples, two of these, and a state
    there, which returns the states and outputs of its own samples from one to the other.
    """
    run, outputs = ready_to_run(core, step), output_function(step.model)

    def along(ready: NetworkRecord, kept: np.ndarray, a: int, b: int, x):
        piece = ready.piece(kept[a], kept[b] + 1, x)
        own = kept[a : b + 1] - kept[a]
        x, t, u = run(piece)[0][own], piece.t[own], piece.acting[own, : len(step.model.inputs)]
        return x, np.array(np.broadcast_arrays(*outputs(t, *x.T, *u.T), t)[:-1]).T

    return along


def output_function(model: PhysicsModel) -> Callable:
    """Return the outputs as a function of time, states and inputs."""
    fixed = {symbol(name): parameter.value for name, parameter in model.parameters.items()}
    outputs = [output.xreplace(fixed) for output in model.outputs.values()]
    return numpy_function(["t", *model.states, *model.inputs], outputs)
