r"""The last phase: all weights at once, on the free-run simulation of whole trajectories.

The cost :math:`F = (1 - \lambda)\,L_{error} + \lambda\,L_{phy}` is minimised with the exact
gradient from the compiled sensitivities, by Levenberg-Marquardt steps or by L-BFGS, until it
hardly decreases any more. For the curvature, an inequality's ReLU is replaced by the parabola
that touches it, :math:`h \le h^2/(2 h_0) + h_0/2`.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import Bounds, minimize

from sklearn_pgnn.estimators.network.physics_loss import PhysicsLoss
from sklearn_pgnn.estimators.network.records import TrainingRecord
from sklearn_pgnn.estimators.network.torch_functions import outputs_of
from sklearn_pgnn.simulation.network_run import (
    FreeRun,
    NetworkStep,
)
from sklearn_pgnn.simulation.uncertainty import FLAT, invert
from sklearn_pgnn.threads import kept_pool

#: initial damping, and its largest value
DAMPING, MOST_DAMPING = 1e-3, 1e12
#: the search ends when this many steps lower the cost by no more than this share
SETTLED, TOLERANCE = 5, 0.001
#: maximum number of points that L-BFGS tries in one direction
LINE_SEARCH = 20
#: smallest gain that a step is compared with
TINY = np.finfo(float).tiny
#: least distance of an inequality from its edge, for its curvature
EDGE = 1e-6


@dataclass
class Sums:
    """Cost, gradient and curvature, summed up piece by piece."""

    cost: float
    gradient: np.ndarray
    curvature: np.ndarray

    @property
    def is_finite(self) -> bool:
        """Whether cost, gradient and curvature are finite, so that a step can be computed."""
        return all(np.isfinite(part).all() for part in (self.cost, self.gradient, self.curvature))

    def without(self, held) -> "Sums":
        """Return the sums as if the cost did not depend on some weights."""
        if not held.any():
            return self
        free = ~held
        return Sums(self.cost, self.gradient * free, self.curvature * np.outer(free, free))

    def add(self, residual, jacobian, factor: float) -> None:
        """Add ``factor`` times the squares of residuals."""
        self.cost += factor * float(residual @ residual)
        self.gradient += 2 * factor * (residual @ jacobian)
        self.curvature += 2 * factor * (jacobian.T @ jacobian)

    def add_linear(self, excess, jacobian, factor: float) -> None:
        """Add ``factor`` times the violation of an inequality."""
        over = excess > 0
        excess, jacobian = excess[over], jacobian[over]
        self.cost += factor * float(excess.sum())
        self.gradient += factor * jacobian.sum(axis=0)
        scaled = jacobian / np.sqrt(np.maximum(excess, EDGE))[:, None]
        self.curvature += factor * (scaled.T @ scaled)


class SimulationObjective:
    """The loss of a network in free run, at every `stride`-th sample, as a function of its weights.

    `overlap` is the cost of the output that the model's free parameters could express.
    """

    def __init__(
        self,
        step: NetworkStep,
        records: list[TrainingRecord],
        scale: np.ndarray,
        physics: PhysicsLoss | None,
        lambda_phy: float,
        stride: int = 1,
        threads: int = 1,
        overlap: "OverlapCost | None" = None,
    ):
        self.step, self.records, self.scale, self.stride = step, records, scale, stride
        self.threads, self.overlap = threads, overlap
        self.physics, self.lambda_phy = physics, lambda_phy if physics else 0.0
        self.n_errors = sum(int(np.isfinite(r.y[stride::stride]).sum()) for r in records)
        self._n_steps = sum(len(range(0, len(record.x) - 1, stride)) for record in records)

    def __call__(self, theta: np.ndarray) -> Sums:
        """Return cost, gradient and curvature; the cost is infinite if a simulation diverges."""
        parts = self.parts(theta)
        return Sums(
            sum(part.cost for part in parts),
            np.sum([part.gradient for part in parts], axis=0),
            np.sum([part.curvature for part in parts], axis=0),
        )

    def parts(self, theta: np.ndarray) -> list[Sums]:
        """Return the sums of every record, and last, if it has a cost, of the overlap."""
        parts = self._each(self._sums_of, theta)
        return parts if self.overlap is None else [*parts, self.overlap(theta)]

    def error(self, theta: np.ndarray) -> float:
        """Return the cost without that of the overlap."""
        return float(sum(self._each(self._cost_of, theta)))

    def weigh_overlap(self, theta: np.ndarray) -> float:
        """Weight the overlap by the present error, which is returned."""
        error = self.error(theta)
        if self.overlap is not None:
            self.overlap.error = error if np.isfinite(error) else 0.0
        return error

    def cost(self, theta: np.ndarray) -> float:
        """Return the cost alone, which is much cheaper."""
        cost = self.error(theta)
        return cost if self.overlap is None else cost + self.overlap(theta).cost

    def _each(self, task, theta) -> list:
        """Apply a task to every record, on threads of this process, not on a cluster."""
        threads = min(self.threads, len(self.records))
        work = kept_pool(threads).map if threads > 1 else map
        return list(work(lambda record: task(record, theta), self.records))

    def _cost_of(self, record, theta) -> float:
        x, failed = FreeRun(self.step, theta)(record.record)
        if failed >= 0:
            return np.inf
        n, samples = len(self.step.free), self._samples(record)
        changes = theta[theta.size - n :]
        only = Sums(0.0, np.zeros(n), np.zeros((n, n)))
        still = np.zeros((len(samples), x.shape[1], n))
        self._add(only, record, samples, x[samples], still, changes)
        return only.cost

    def _sums_of(self, record, theta) -> Sums:
        n = theta.size
        sums = Sums(0.0, np.zeros(n), np.zeros((n, n)))
        run = FreeRun(self.step, theta, differs=True)
        for samples, x, S in run.pieces(record.record, self._samples(record)):
            if not np.isfinite(x).all():
                return Sums(np.inf, sums.gradient, sums.curvature)
            self._add(sums, record, samples, x, S, theta[n - len(self.step.free) :])
        return sums

    def _samples(self, record) -> np.ndarray:
        """Return the samples in the cost; with a physical loss also the ends of their steps."""
        every = np.arange(0, len(record.x), self.stride)
        if not self.lambda_phy:
            return every
        return np.union1d(every, every[every + 1 < len(record.x)] + 1)

    def _add(self, sums, record, samples, x, S, changes) -> None:
        """Add a piece; its first sample is the last of the piece before."""
        self._add_errors(sums, record, samples, x, S, changes)
        if self.lambda_phy:
            self._add_physics(sums, record, samples, x, S, changes)

    def _add_errors(self, sums, record, samples, x, S, changes):
        rows = 1 + np.flatnonzero(samples[1:] % self.stride == 0)
        after, S = samples[rows], S[rows]
        states = torch.as_tensor(x[rows]).requires_grad_()
        u = torch.as_tensor(record.record.acting[after, : record.record.u.shape[1]])
        parameters = self._parameters(changes, len(rows))
        outputs = outputs_of(
            self.step.model, states, u, torch.as_tensor(record.record.t[after]),
            self.step.values_at(parameters),
        )  # fmt: skip
        factor = (1.0 - self.lambda_phy) / self.n_errors
        for i, scale in enumerate(self.scale):
            slope, by_parameter = _slopes(outputs[:, i], states, parameters)
            error = outputs[:, i].detach().numpy() - record.y[after, i]
            seen = np.isfinite(error)
            jacobian = np.einsum("nj,njw->nw", slope[seen], S[seen])
            _add_last(jacobian, by_parameter[seen])
            sums.add(error[seen] / scale, jacobian / scale, factor)

    def _add_physics(self, sums, record, samples, x, S, changes):
        before = np.flatnonzero((samples[:-1] % self.stride == 0) & (np.diff(samples) == 1))
        after, k = before + 1, samples[before]
        ends = torch.as_tensor(np.stack([x[before], x[after]], axis=1)).requires_grad_()
        u = torch.as_tensor(record.record.u[k, None])
        times = torch.as_tensor(np.stack([record.record.t[k], record.record.t[k + 1]], axis=1))
        parameters = self._parameters(changes, len(k))
        values = {name: each[:, None] for name, each in self.step.values_at(parameters).items()}
        found = self.physics.residuals(ends, u, times, values)
        for term, h in zip(self.physics.terms, found, strict=True):
            factor = self.lambda_phy * term.weight / (self._n_steps * h.shape[2])
            for column in range(h.shape[2]):
                slope, by_parameter = _slopes(h[:, 0, column], ends, parameters)
                jacobian = np.einsum("nj,njw->nw", slope[:, 0], S[before])
                jacobian += np.einsum("nj,njw->nw", slope[:, 1], S[after])
                _add_last(jacobian, by_parameter)
                add = sums.add_linear if term.kind == "inequality" else sums.add
                add(h[:, 0, column].detach().numpy(), jacobian, factor)

    def _parameters(self, changes, n: int) -> torch.Tensor:
        """Return the changes of the free parameters for every one of n samples."""
        return torch.tensor(np.tile(changes, (n, 1))).requires_grad_()


class OverlapCost:
    """The weighted overlap as sums over the weights and the free parameters.

    The weight is the cost of a complete overlap, as a share of the error.
    """

    def __init__(self, overlap, core, weight: float):
        self.overlap, self.core, self.weight, self.error = overlap, core, weight, 0.0

    def __call__(self, theta: np.ndarray) -> Sums:
        """Return cost, gradient and curvature."""
        n_weights = sum(part.numel() for part in self.core.parameters())
        found, slopes = self.overlap.with_slopes(self.core, theta[:n_weights])
        jacobian = np.zeros((len(found), theta.size))
        jacobian[:, :n_weights] = slopes
        sums = Sums(0.0, np.zeros(theta.size), np.zeros((theta.size, theta.size)))
        sums.add(found, jacobian, self.weight * self.error)
        return sums


def _add_last(jacobian, by_parameter) -> None:
    """Add derivatives by the free parameters, the last columns, in place."""
    jacobian[:, jacobian.shape[1] - by_parameter.shape[1] :] += by_parameter


def _slopes(values, *by) -> list[np.ndarray]:
    """Differentiate values, each of its own sample."""
    if not values.requires_grad:
        return [np.zeros(each.shape) for each in by]
    found = torch.autograd.grad(values.sum(), by, retain_graph=True, allow_unused=True)
    return [
        np.zeros(each.shape) if slope is None else slope.numpy()
        for each, slope in zip(by, found, strict=True)
    ]


def levenberg_marquardt(
    objective, theta: np.ndarray, iterations: int, on_step, bounds=(-np.inf, np.inf)
) -> np.ndarray:
    """Minimise by damped Gauss-Newton steps.

    `iterations` is the maximum number of steps that lower the cost; rejected steps are not counted.
    ``on_step(theta, cost)`` is called at every accepted step; True ends the search. A weight pushed
    beyond its bounds is held, and a step ends at the bound. The last weights that were accepted are
    returned.

    .. [1] D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters",
       SIAM Journal on Applied Mathematics 11(2), 1963, :doi:`10.1137/0111030`.
    .. [2] K. Madsen, H. B. Nielsen, O. Tingleff, "Methods for non-linear least squares problems",
       Technical University of Denmark, 2004: how the damping follows the gain.
    """
    now, damping = objective(theta), DAMPING
    if not now.is_finite:
        return theta
    size, costs = np.diag(now.curvature).copy(), [now.cost]
    for _ in range(iterations):
        size = np.maximum(size, np.diag(now.curvature))
        found = _next_step(objective, theta, now, damping, size, bounds)
        if found is None:
            break
        theta, now, damping = found
        costs.append(now.cost)
        if on_step(theta, now.cost) or _has_settled(costs):
            break
    return theta


def _next_step(objective, theta, now: Sums, damping: float, size: np.ndarray, bounds):
    """Increase the damping until a step lowers the cost; None if even the shortest does not.

    A step into a divergence, of the simulation or of its sensitivities, counts as a failed step.
    """
    stiffen, (low, high) = 2.0, bounds
    moves = ~((theta <= low) & (now.gradient > 0) | (theta >= high) & (now.gradient < 0))
    held = now.without(~moves)
    while damping <= MOST_DAMPING:
        step = _damped_step(held, damping * np.maximum(size, 1e-12 * size.max()))
        step = np.clip(theta + step * moves, low, high) - theta
        cost = objective.cost(theta + step)
        if cost < now.cost and (after := objective(theta + step)).is_finite:
            expected = -float(now.gradient @ step + step @ now.curvature @ step / 2)
            share = min((now.cost - cost) / max(expected, TINY), 1.0)
            return theta + step, after, damping * max(1 / 3, 1 - (2 * share - 1) ** 3)
        damping, stiffen = damping * stiffen, 2 * stiffen
    return None


def _has_settled(costs: list[float]) -> bool:
    """Return whether the last steps have lowered the cost by next to nothing."""
    return len(costs) > SETTLED and costs[-1] > (1.0 - TOLERANCE) * costs[-1 - SETTLED]


def _damped_step(sums: Sums, damping: np.ndarray) -> np.ndarray:
    for raised in (1.0, 1e3, 1e6):
        try:
            factor = cho_factor(sums.curvature + np.diag(raised * damping))
            return cho_solve(factor, -sums.gradient)
        except LinAlgError:
            continue
    return -sums.gradient / damping


def l_bfgs(
    objective, theta: np.ndarray, iterations: int, on_step, bounds=(-np.inf, np.inf)
) -> np.ndarray:
    """Minimise by the limited-memory BFGS method, as `levenberg_marquardt`."""
    costs: list[float] = []

    def both(weights):
        sums = objective(weights)
        return (sums.cost, sums.gradient) if sums.is_finite else (1e30, np.zeros(theta.size))

    def told(intermediate_result):
        costs.append(intermediate_result.fun)
        if on_step(intermediate_result.x, intermediate_result.fun) or _has_settled(costs):
            raise StopIteration

    options = {
        "maxiter": iterations,
        "maxls": LINE_SEARCH,
        "maxfun": LINE_SEARCH * iterations,
        "ftol": 0.0,  # `_has_settled` decides when to stop
        "gtol": 0.0,
    }
    return minimize(
        both, theta, jac=True, method="L-BFGS-B", bounds=Bounds(*bounds), callback=told,
        options=options,
    ).x  # fmt: skip


def parameter_errors(objective: SimulationObjective, theta: np.ndarray) -> np.ndarray:
    r"""Return the standard errors of the free parameters, with the weights adapting to them.

    .. math:: \mathrm{cov} = S^{-1} M S^{-1}, \qquad
              S = H_{pp} - H_{pw} H_{ww}^{-1} H_{wp},

    with the Hessian :math:`H` of the error, and, for every parameter, the larger result of two
    :math:`M`: that of white residuals, and the sum over the trajectories of the squared gradients
    after elimination of the weights. The records do not determine what the network can compensate.
    """
    n_free = len(objective.step.free)
    parts = objective.parts(theta)
    if not all(part.is_finite for part in parts):
        return np.full(n_free, np.inf)
    hessian = np.sum([part.curvature for part in parts], axis=0)
    following = _following(hessian, n_free)
    schur = hessian[-n_free:, -n_free:] - following @ hessian[:-n_free, -n_free:]
    inverse, flat = invert(schur)
    n = objective.n_errors
    variance = sum(part.cost for part in parts) * n / max(n - theta.size, 1)
    scores = np.array([p.gradient[-n_free:] - following @ p.gradient[:-n_free] for p in parts])
    scores -= scores.mean(axis=0)
    by_record = scores.T @ scores * len(parts) / max(len(parts) - 1, 1)
    meats = 2 / n * variance * schur, by_record
    variances = np.max([np.diag(inverse @ meat @ inverse) for meat in meats], axis=0)
    return np.where(flat | ~(variances > 0), np.inf, np.sqrt(np.maximum(variances, 0.0)))


def _following(hessian, n_free) -> np.ndarray:
    """Return how the weights adapt to the parameters, as the product that eliminates them."""
    of_weights, across = hessian[:-n_free, :-n_free], hessian[-n_free:, :-n_free]
    size = np.sqrt(np.maximum(np.diag(of_weights), np.finfo(float).tiny))
    inverse = np.linalg.pinv(of_weights / np.outer(size, size), rcond=FLAT, hermitian=True)
    return across / size @ inverse / size
