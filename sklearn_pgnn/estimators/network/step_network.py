"""The network in feedback as a torch module: the compiled loop's step, differentiable."""

import numpy as np
import torch
from torch import nn

from sklearn_pgnn.estimators.network.dissipation import dissipated
from sklearn_pgnn.estimators.network.free_parameters import FreeParameters
from sklearn_pgnn.simulation.network_run import (
    NetworkStep,
    energy_values,
    prior_steps,
    term_values,
)


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
        self._keep_in_range()
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

    def _keep_in_range(self) -> None:
        if self.free is not None and self.changes is not None:
            low, high = (self.changes.new_tensor(end) for end in (self.free.low, self.free.high))
            with torch.no_grad():
                self.changes.clamp_(low, high)

    def _prior(self, x, index):
        """Return the model's own step, with the parameters as they are now."""
        if self.free is None:
            return _PriorStep.apply(x, index, self)
        return _PriorStep.apply(x, index, self, self.changes)

    def _advance(self, x, u, dt, index, prior, terms, further, hidden):
        step = self.step
        if step.needs_prior and prior is None:
            prior = self._prior(x, index)
        at = x + step.seen_at * (prior - x) if step.seen_at else x
        seen = [at, u]
        if step.guide == "step":
            seen.append((prior - x) / dt)
        elif step.guide == "terms":
            seen.append(_Terms.apply(at, index, self) if terms is None else terms)
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
        change = dissipated(output, _Energy.apply(prior, index, self), self.root, dt)
        places = [list(self.step.model.states).index(name) for name in self.step.loss.states]
        return prior.index_add(1, torch.as_tensor(places, device=prior.device), change)


class _PriorStep(torch.autograd.Function):
    """The model's own step, compiled, with its Jacobian as the backward pass."""

    @staticmethod
    def forward(ctx, x, index, network, changes=None):
        rows, samples, step = index.cpu().numpy(), network.samples, network.step
        model, free, unit = step.model, (), np.zeros(0)
        if changes is not None:
            free, unit = network.free.names, network.free.unit
            model = model.with_parameters(**network.free.values(changes.detach().cpu().numpy()))
        x_next, jacobian = prior_steps(
            model,
            step.substeps,
            step.hold,
            samples["t"][rows],
            samples["dt"][rows],
            x.detach().cpu().numpy(),
            samples["acting"][rows],
            samples["acting_next"][rows],
            free,
        )
        jacobian[:, :, : len(free)] *= unit
        ctx.save_for_backward(torch.as_tensor(jacobian, device=x.device))
        return torch.as_tensor(x_next, device=x.device)

    @staticmethod
    def backward(ctx, grad):
        (jacobian,) = ctx.saved_tensors
        slopes = torch.einsum("ni,nij->nj", grad, jacobian)
        n_free = slopes.shape[1] - grad.shape[1]
        return slopes[:, n_free:], None, None, slopes[:, :n_free].sum(dim=0) if n_free else None


class _Terms(torch.autograd.Function):
    """The model's terms, compiled, with their Jacobian as the backward pass."""

    @staticmethod
    def forward(ctx, x, index, network):
        rows, samples, step = index.cpu().numpy(), network.samples, network.step
        values, jacobian = term_values(
            step.terms_from,
            samples["t"][rows],
            x.detach().cpu().numpy(),
            samples["acting"][rows],
            step.state_spread,
        )
        ctx.save_for_backward(torch.as_tensor(jacobian, device=x.device))
        return torch.as_tensor(values, device=x.device)

    @staticmethod
    def backward(ctx, grad):
        (jacobian,) = ctx.saved_tensors
        return torch.einsum("ni,nij->nj", grad, jacobian), None, None


class _Energy(torch.autograd.Function):
    """Slopes and Hessian of the stored energy, compiled, with their Jacobian as backward pass."""

    @staticmethod
    def forward(ctx, x, index, network):
        rows, samples, step = index.cpu().numpy(), network.samples, network.step
        t, acting = samples["t"][rows], samples["acting"][rows]
        values, jacobian = energy_values(
            step.model, step.loss.states, t, x.detach().cpu().numpy(), acting
        )
        ctx.save_for_backward(torch.as_tensor(jacobian, device=x.device))
        return torch.as_tensor(values, device=x.device)

    @staticmethod
    def backward(ctx, grad):
        (jacobian,) = ctx.saved_tensors
        return torch.einsum("ni,nij->nj", grad, jacobian), None, None
