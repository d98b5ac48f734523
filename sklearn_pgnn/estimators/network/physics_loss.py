# what torch and skorch set is not typed
# mypy: disable-error-code="has-type,assignment,operator,misc,union-attr,arg-type"
r"""Residuals of physical relations, as terms of a loss.

A term is a dimensionless residual :math:`h(x, u, t)`, evaluated from each sample to the next, and
either an equality, which costs :math:`h^2`, or an inequality :math:`h \le 0`, which costs
:math:`\mathrm{ReLU}(h)`. The weight of the loss is a constant, or balanced by the gradients.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from sklearn.base import BaseEstimator

from sklearn_pgnn.estimators.network.torch_functions import torch_value, values_of
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter

KINDS = ("equality", "inequality")
ADAPTIVE = "adaptive"
#: share of a new weight in the moving average
FORGETTING = 0.1


class NotFinite(ValueError):
    """Raised where a loss is not finite."""


class PhysicsTerm(BaseEstimator):
    """A physical relation given as a function.

    Parameters
    ----------
    residual : callable
        ``residual(x, u, t)`` of the states at both ends of every step, Tensor of shape
        (n, length + 1, n_states), the inputs from sample to sample, (n, length, n_inputs), and the
        time [s], (n, length + 1); gives the dimensionless residual, (n, length) or (n, length, m).
        All are in physical units, whatever scaler is in the pipeline.
    kind : {"equality", "inequality"}, default="equality"
        Whether the residual shall be zero, or not above zero.
    weight : float, default=1
        Weight among several terms.

    Examples
    --------
    >>> slow = PhysicsTerm(lambda x, u, t: x[:, 1:, 1].abs() - 2.0, kind="inequality")
    >>> slow.kind
    'inequality'
    """

    #: whether it is an energy term: in joules unless scaled, with the parameters being trained
    is_energy = False

    def __init__(
        self,
        residual: Callable[..., Any] | None = None,
        *,
        kind: str = "equality",
        weight: float = 1.0,
    ):
        self.residual = residual
        self.kind = kind
        self.weight = weight

    def bind(self, model: PhysicsModel, motion: "Motion") -> Callable[..., Any]:
        """Bind to a model and the motion it is trained on.

        Parameters
        ----------
        model : PhysicsModel
            Names the states and inputs.
        motion : Motion
            The training data, from which references are taken.

        Returns
        -------
        callable
            ``residual(x, u, t)``.
        """
        if not callable(self.residual):
            raise ValueError(
                f"{type(self).__name__}: expected a function residual(x, u, t), "
                f"got {self.residual!r}."
            )
        return self.residual


class EnergyBalance(PhysicsTerm):
    r"""The energy of a step: what is stored grows by what is supplied less what is dissipated.

    .. math:: h = \frac{\Delta E_{kin} + \Delta E_{pot} + \Delta E_{diss} - \Delta E_{con}}
              {\Delta t\,P_{ref}}

    The powers are taken in the middle of the step; :math:`P_{ref}` is the root mean square of the
    supplied power of the training data (of the change of the stored energy, where nothing is
    supplied), so that the residual does not depend on the units.

    The dissipation is that of the prior, which may lack what is to be learnt. If its form is known,
    `dissipated` replaces it, with parameters that are trained with the network.

    Parameters
    ----------
    weight : float, default=1
        Weight among several terms.
    dissipated : str, optional
        Power that is lost [W], as an expression of the model's quantities and of `parameters`; by
        default as in the model's energy.
    parameters : mapping of str to float, optional
        Parameters in `dissipated` that the model does not have, with their initial values for the
        training; they are kept from becoming negative.

    References
    ----------
    .. [1] R.-S. Goette, J. Timmermann, "Composed Physics- and Data-driven System Identification
       for Non-autonomous Systems in Control Engineering", 2021, arXiv:2112.08148.

    Examples
    --------
    >>> EnergyBalance(dissipated="d*v**2 + Fc*abs(v)", parameters={"Fc": 0.1}).kind
    'equality'
    """

    is_energy = True

    def __init__(
        self,
        weight: float = 1.0,
        *,
        dissipated: str | None = None,
        parameters: Mapping[str, Any] | None = None,
    ):
        super().__init__(None, kind="equality", weight=weight)
        self.dissipated = dissipated
        self.parameters = parameters

    def with_dissipation(self, model: PhysicsModel) -> PhysicsModel:
        """Return a model whose energy is dissipated as this balance says.

        Parameters
        ----------
        model : PhysicsModel
            The model.

        Returns
        -------
        PhysicsModel
            The same machine; parameters that it has already keep their values.

        Raises
        ------
        ValueError
            If there are `parameters`, but no `dissipated` that holds them.
        """
        own = dict(self.parameters or {})
        if self.dissipated is None:
            if own:
                raise ValueError(
                    f"EnergyBalance: expected 'dissipated' with {', '.join(own)} in it, got none."
                )
            return model
        added = [
            Parameter(name, value, bounds=(0.0, np.inf), spread=np.inf)
            for name, value in own.items()
            if name not in model.parameters
        ]
        return model.replace(
            parameters=[*model.parameters.values(), *added],
            energy={**model.energy, "dissipated": self.dissipated},
        )

    def bind(self, model: PhysicsModel, motion: Any, scaled: bool = True) -> Callable[..., Any]:
        """Bind to a model and its motion, see `PhysicsTerm.bind`; in joules if not scaled."""
        energy = _Energy(self.with_dissipation(model), motion, scaled)
        return partial(energy.surplus, dissipates=True)


class Passivity(PhysicsTerm):
    r"""An inequality: no more energy comes out than went in.

    .. math:: h = \frac{\Delta E_{kin} + \Delta E_{pot} - \Delta E_{con}}
              {\Delta t\,P_{ref}} \le 0

    It holds whatever dissipates the energy, so that a wrong friction model does no harm.

    Parameters
    ----------
    weight : float, default=1
        Weight among several terms.

    Examples
    --------
    >>> Passivity().kind
    'inequality'
    """

    is_energy = True

    def __init__(self, weight: float = 1.0):
        super().__init__(None, kind="inequality", weight=weight)

    def bind(self, model: PhysicsModel, motion: Any, scaled: bool = True) -> Callable[..., Any]:
        """Bind to a model and its motion, see `PhysicsTerm.bind`; in joules if not scaled."""
        return partial(_Energy(model, motion, scaled).surplus, dissipates=False)


class Bounds(PhysicsTerm):
    r"""An inequality: states stay between two bounds.

    .. math:: h = \max\left(\frac{l - x}{h - l}, \frac{x - h}{h - l}\right) \le 0

    Parameters
    ----------
    bounds : mapping of str to (float, float), default=None
        Lower and upper bound by state, in its unit.
    weight : float, default=1
        Weight among several terms.

    Examples
    --------
    >>> Bounds({"y": (-1.0, 1.0)}).bounds["y"]
    (-1.0, 1.0)
    """

    def __init__(
        self, bounds: Mapping[str, tuple[float, float]] | None = None, weight: float = 1.0
    ):
        super().__init__(None, kind="inequality", weight=weight)
        self.bounds = bounds

    def bind(self, model: PhysicsModel, motion: Any) -> Callable[..., Any]:
        """Bind to a model and the motion it is trained on; see `PhysicsTerm.bind`."""
        return partial(_state_excess, *_limits(self, model))


class RateBounds(Bounds):
    r"""An inequality: rates of change stay between two bounds.

    .. math:: h = \max\left(\frac{l - \Delta x/\Delta t}{h - l},
              \frac{\Delta x/\Delta t - h}{h - l}\right) \le 0

    Parameters
    ----------
    bounds : mapping of str to (float, float), default=None
        Lower and upper bound of the rate by state, in its unit per second.
    weight : float, default=1
        Weight among several terms.

    Examples
    --------
    >>> RateBounds({"v": (-9e5, 9e5)}).kind
    'inequality'
    """

    def bind(self, model: PhysicsModel, motion: Any) -> Callable[..., Any]:
        """Bind to a model and the motion it is trained on; see `PhysicsTerm.bind`."""
        return partial(_rate_excess, *_limits(self, model))


@dataclass(frozen=True)
class Motion:
    """Motion of the machine in the training data, from each sample to the next.

    States at both ends have shape (n, 2, n_states), inputs (n, 1, n_inputs), and times [s] (n, 2).
    """

    x: np.ndarray
    u: np.ndarray
    t: np.ndarray


class PhysicsLoss:
    """Terms, bound to a model, as one loss.

    Energy residuals are relative to a power if `scaled`; otherwise they are in joules.
    """

    def __init__(self, terms, model: PhysicsModel, motion: Motion, scaled: bool = True):
        self.terms = terms
        self._residuals = [
            term.bind(model, motion, scaled) if term.is_energy else term.bind(model, motion)
            for term in terms
        ]

    def residuals(self, x, u, t, tuned=None) -> list[torch.Tensor]:
        """Return every term's residual, each of shape (n, length, m).

        States have shape (n, length + 1, n_states), inputs (n, length, n_inputs) and times [s] (n,
        length + 1); `tuned` are values of parameters, each of shape (n, 1) or (), in place of the
        model's. Of an inequality it is only the part above zero. A user-defined term that returns
        another shape, or non-finite values for finite states, raises `ValueError`.
        """
        found = []
        for term, residual in zip(self.terms, self._residuals, strict=True):
            h = residual(x, u, t, tuned=tuned) if term.is_energy else residual(x, u, t)
            if tuple(h.shape[:2]) != tuple(u.shape[:2]):
                raise ValueError(
                    f"physics_loss: {type(term).__name__} gave shape {tuple(h.shape)}; expected "
                    f"{tuple(u.shape[:2])}, a residual for every step."
                )
            if not torch.isfinite(h).all() and torch.isfinite(x).all():
                name = getattr(term.residual, "__name__", type(term).__name__)
                raise NotFinite(
                    f"physics_loss: {name} is not finite, though the states are. Remedy: "
                    f"keep roots, logarithms and divisions of it inside their domain "
                    f"(torch.clamp), or leave the term out."
                )
            h = h.reshape(*h.shape[:2], -1)
            found.append(torch.relu(h) if term.kind == "inequality" else h)
        return found

    def __call__(self, x, u, t, tuned=None) -> torch.Tensor:
        """Return the weighted mean cost of all terms."""
        costs = [
            term.weight * (h.mean() if term.kind == "inequality" else (h**2).mean())
            for term, h in zip(self.terms, self.residuals(x, u, t, tuned), strict=True)
        ]
        return torch.stack(costs).sum()


def as_terms(physics_loss, model: PhysicsModel | None) -> list[PhysicsTerm]:
    """Read ``physics_loss``: a function, terms, or one; None is the energy balance."""
    given: list[Any] = [EnergyBalance()]
    if physics_loss is not None:
        several = isinstance(physics_loss, list | tuple)
        given = list(physics_loss) if several else [physics_loss]
    terms = [
        PhysicsTerm(item) if callable(item) and not isinstance(item, PhysicsTerm) else item
        for item in given
    ]
    for term in terms:
        if not isinstance(term, PhysicsTerm):
            raise ValueError(
                f"physics_loss: expected terms such as EnergyBalance() or functions of (x, u, t), "
                f"got {term!r}."
            )
        if term.kind not in KINDS:
            raise ValueError(f"kind: expected one of {', '.join(KINDS)}, got {term.kind!r}.")
    if model is None:
        raise ValueError(
            "physics_loss: expected a model, got none. Remedy: give model=, or do without a "
            "physical loss (lambda_phy=0, physics_loss=None)."
        )
    if not terms:
        raise ValueError(
            "physics_loss: expected at least one term, got none. Remedy: give it, or leave out."
        )
    return terms


def with_dissipation(model: PhysicsModel, terms) -> PhysicsModel:
    """Return a model whose energy is dissipated as a balance among the terms says."""
    for term in terms:
        if isinstance(term, EnergyBalance):
            model = term.with_dissipation(model)
    return model


def own_parameters(model: PhysicsModel, terms) -> tuple[str, ...]:
    """Name, once each, the parameters of balances; the model may have no such names."""
    balances = [term for term in terms if isinstance(term, EnergyBalance)]
    names = tuple(dict.fromkeys(name for each in balances for name in each.parameters or {}))
    taken = [name for name in names if name in model.parameters]
    if taken:
        raise ValueError(
            f"EnergyBalance: expected parameters that {model.name!r} does not have, got "
            f"{taken[0]!r}. Remedy: free=[{taken[0]!r}] trains the model's own."
        )
    return names


class _Energy:
    """The energy of a model's motion."""

    def __init__(self, model: PhysicsModel, motion: Motion, scaled: bool):
        if "stored" not in model.energy:
            raise ValueError(
                f"the energy of {model.name!r} is not known: expected the model's 'energy' with "
                f"'stored', 'supplied' and 'dissipated', got "
                f"{', '.join(model.energy) or 'nothing'}. Remedy: give the model its energy, set "
                f"lambda_phy=0, or name another physics_loss."
            )
        self.model, self.scaled = model, scaled
        x, u, t = (torch.as_tensor(part) for part in (motion.x, motion.u, motion.t))
        supplied = self._power("supplied", *_middle(x, u, t))
        stored = self._stored(x, u, t)
        change = torch.diff(stored, dim=1) / torch.diff(t, dim=1)
        rms = [float(torch.sqrt(torch.mean(power**2))) for power in (supplied, change)]
        self.reference = rms[0] or rms[1] or 1.0

    def surplus(self, x, u, t, *, dissipates: bool, tuned=None):
        """Return the growth of the stored energy beyond the supplied energy, over the scale."""
        x_middle, u_middle, t_middle = _middle(x, u, t)
        change = torch.diff(self._stored(x, u, t, tuned), dim=1) / torch.diff(t, dim=1)
        surplus = change - self._power("supplied", x_middle, u_middle, t_middle, tuned)
        if dissipates:
            surplus = surplus + self._power("dissipated", x_middle, u_middle, t_middle, tuned)
        return surplus / self.reference if self.scaled else surplus * torch.diff(t, dim=1)

    def _stored(self, x, u, t, tuned=None):
        return self._power("stored", x, torch.cat([u, u[:, -1:]], dim=1), t, tuned)

    def _power(self, part, x, u, t, tuned=None):
        if part not in self.model.energy:
            return torch.zeros_like(t)
        return torch_value(self.model.energy[part], values_of(self.model, x, u, t, tuned))


def _state_excess(columns, low, high, x, u, t):
    return _excess(x[:, 1:, columns], low, high)


def _rate_excess(columns, low, high, x, u, t):
    rate = torch.diff(x[..., columns], dim=1) / torch.diff(t, dim=1)[..., None]
    return _excess(rate, low, high)


def _excess(values, low, high):
    """Return how far values lie outside of their bounds, in widths of the range."""
    low, high = values.new_tensor(low), values.new_tensor(high)
    return torch.maximum(low - values, values - high) / (high - low)


def _middle(x, u, t):
    """Return the states, the inputs and the time in the middle of every step."""
    return (x[:, 1:] + x[:, :-1]) / 2, u, (t[:, 1:] + t[:, :-1]) / 2


def _limits(term, model):
    """Return the columns of the states that a term bounds, and their lower and upper bounds."""
    bounds = dict(term.bounds or {})
    unknown = [name for name in bounds if name not in model.states]
    if unknown or not bounds:
        raise ValueError(
            f"{type(term).__name__}: expected bounds of states among {', '.join(model.states)}, "
            f"got {', '.join(map(repr, unknown)) or 'none'}."
        )
    for name, (low, high) in bounds.items():
        if not low < high:
            raise ValueError(
                f"{type(term).__name__}: expected a lower and a higher bound of {name!r}, "
                f"got {low:g} and {high:g}."
            )
    columns = [list(model.states).index(name) for name in bounds]
    low, high = np.array(list(bounds.values()), dtype=float).T
    return columns, low, high


def check_lambda(lambda_phy) -> None:
    """Raise `ValueError` unless the weight is a number from 0 to below 1, or ``"adaptive"``."""
    if isinstance(lambda_phy, str) and lambda_phy == ADAPTIVE:
        return
    if isinstance(lambda_phy, int | float | np.number) and 0 <= lambda_phy < 1:
        return
    raise ValueError(
        f"lambda_phy: expected a number from 0 to below 1, or {ADAPTIVE!r}, got {lambda_phy!r}."
    )


def balanced_lambda(error, physics, weights, before: float | None) -> float:
    r"""Weight both losses so that neither gradient dominates.

    With the data's weight :math:`w = \max|\nabla L_{phy}|\,/\,\mathrm{mean}|\nabla L_{error}|` of
    [1]_ in :math:`L_{phy} + w L_{error}`, :math:`\lambda = 1/(1 + w)`; a moving average of it.

    `before` is the average so far, if any; the losses have their graphs.

    .. [1] S. Wang, Y. Teng, P. Perdikaris, "Understanding and mitigating gradient flow pathologies
       in physics-informed neural networks", SIAM Journal on Scientific Computing 43(5), 2021,
       :doi:`10.1137/20M1318043`.
    """
    by_error = _gradient(error, weights).abs().mean()
    by_physics = _gradient(physics, weights).abs().max()
    if by_physics <= 0:  # nothing to balance: all inequalities hold
        return 0.0 if before is None else before
    now = float(by_error / (by_error + by_physics))
    return now if before is None else (1 - FORGETTING) * before + FORGETTING * now


def _gradient(loss, weights):
    if not loss.requires_grad:
        return torch.zeros(1)
    parts = torch.autograd.grad(loss, weights, retain_graph=True, allow_unused=True)
    return torch.cat([part.reshape(-1) for part in parts if part is not None])
