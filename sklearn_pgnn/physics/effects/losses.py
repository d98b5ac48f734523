"""Losses to surroundings: in proportion, by radiation, by convection."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.levels import first_order_states
from sklearn_pgnn.physics.effects.targets import pair, parts
from sklearn_pgnn.physics.expressions import maximum, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.repeated_rates import with_rates
from sklearn_pgnn.physics.scales import Scales

#: what is added to a temperature to make it absolute, by its unit
ABSOLUTE = {"K": sympy.Integer(0), "degC": sympy.Rational(27315, 100)}
#: temperature [K] about which a loss by radiation begins to be sought
ROOM = 300.0
#: share of the typical rate that a loss has at which a fit starts
FAINT = 0.05
#: share of a typical difference below which a power of it is that of the share
SMALL = 1e-6


@dataclass(frozen=True)
class LossEffect(Effect):
    """A loss of a first-order state to surroundings that its own rate, or an input, names."""

    coefficient: float = 0.0

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the first-order states, each with the surroundings that it loses to."""
        stores = first_order_states(model)
        return tuple(pair(state, around) for state in stores for around in _around(model, state))

    @classmethod
    def title(cls, target: str) -> str:
        """Return state and surroundings in words."""
        return "{} of {} to {}".format(cls.id.replace("_", " "), *parts(target))

    def loss(self, state: sympy.Expr, around: sympy.Expr, unit: str, p: Symbols) -> sympy.Expr:
        """Return the loss."""
        raise NotImplementedError

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Subtract the loss from the state's rate."""
        state, around = parts(self.target)
        loss = self.loss(symbol(state), symbol(around), model.unit(state), p)
        return {"equations": {**model.equations, state: model.equations[state] - loss}}

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return none: the exchange is a rate."""
        return {}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the missing rate over the difference of state and surroundings."""
        state, around = parts(self.target)
        difference = symbol(state) - symbol(around)
        return Characteristic("force", state, difference, unit=model.unit(state))


def _around(model: PhysicsModel, state: str) -> tuple[str, ...]:
    """Return what a state loses to by its rate; inputs of its unit where it has no loss."""
    unit = model.unit(state)
    alike = (name for name, known in model.inputs.items() if unit and known == unit)
    return surroundings(model, state) or tuple(alike)


def surroundings(model: PhysicsModel, state: str) -> tuple[str, ...]:
    """Return the inputs and parameters of a state's unit that its rate tends to in proportion.

    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> oven = PhysicsModel({"T": "K"}, {"T": "h*(To - T)"}, {"h": 0.1}, {"P": "W", "To": "K"})
    >>> surroundings(oven, "T")
    ('To',)
    """
    unit, rate = model.unit(state), model.equations[state]
    units = {**model.inputs, **{name: p.unit for name, p in model.parameters.items()}}
    numbers = {symbol(name) for name in model.parameters}
    slopes = {n: rate.diff(symbol(n)) for n, known in units.items() if unit and known == unit}
    return tuple(n for n, by in slopes.items() if by != 0 and by.free_symbols <= numbers)


def _faint(target: str, scales: Scales) -> float:
    """Return the exchange [1/s] of a small loss."""
    state = parts(target)[0]
    return FAINT * scales.rate[state] / (scales.typical[state] or 1.0)


@dataclass(frozen=True)
class RadiationLoss(LossEffect):
    r"""A loss by radiation to surroundings, between absolute temperatures.

    .. math:: \dot T = f - r\,(T_\mathrm{abs}^4 - T_{a,\mathrm{abs}}^4)

    Temperatures may be in K or degC.

    Parameters
    ----------
    target : str
        State and surroundings (an input or a parameter of the same unit), as ``"T(T_room)"``.
    coefficient : float, default=0
        Exchange :math:`r = \epsilon \sigma A/C` [1/(s K^3)] of a body of surface :math:`A`,
        emissivity :math:`\epsilon` and heat capacity :math:`C`.

    References
    ----------
    .. [1] T. L. Bergman, A. S. Lavine, "Fundamentals of Heat and Mass Transfer", 8th edition,
       Wiley, 2017, equation 1.7.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> oven = PhysicsModel({"T": "K"}, {"T": "P/C"}, {"C": 80.0}, {"P": "W", "T_room": "K"})
    >>> print((oven + RadiationLoss("T(T_room)", coefficient=1e-10)).to_text())
    T' = -ra_T_T_room*(T**4 - T_room**4) + P/C
    """

    coefficient: float = quantity("ra", "1/s/K^3", low=0.0)
    id = "radiation_loss"
    summary = "A loss by radiation: it grows with the fourth power of the absolute temperature."
    check = "Cool down from a high temperature: the first part is faster than an exponential."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the temperatures, each with the surroundings that it loses to."""
        return tuple(
            t for t in super().targets(model) if model.unit(parts(t)[0]).strip() in ABSOLUTE
        )

    def loss(self, state: sympy.Expr, around: sympy.Expr, unit: str, p: Symbols) -> sympy.Expr:
        """Return the loss of the temperature by radiation."""
        zero = ABSOLUTE[unit.strip()]
        return p["coefficient"] * ((state + zero) ** 4 - (around + zero) ** 4)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from faint radiation about room temperature."""
        return (cls(target, _faint(target, scales) / (4 * ROOM**3)),)


@dataclass(frozen=True)
class PowerLoss(LossEffect):
    r"""A loss to surroundings that grows with a power of the difference: free convection.

    .. math:: \dot x = f - \lambda\,d\,|d|^{m}, \qquad d = x - x_a

    Parameters
    ----------
    target : str
        State and surroundings (an input or a parameter of the same unit), as ``"T(T_room)"``.
    coefficient : float, default=0
        Exchange :math:`\lambda` [1/s] at a difference of one unit of the state.
    power : float, default=0.25
        Power :math:`m` [-] of the exchange itself: 1/4 and 1/3 for free laminar and turbulent
        convection, 1 for a loss with the square.

    References
    ----------
    .. [1] T. L. Bergman, A. S. Lavine, "Fundamentals of Heat and Mass Transfer", 8th edition,
       Wiley, 2017, chapter 9.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> oven = PhysicsModel({"T": "K"}, {"T": "P/C"}, {"C": 80.0}, {"P": "W", "T_room": "K"})
    >>> PowerLoss.targets(oven)
    ('T(T_room)',)
    """

    coefficient: float = quantity("pc", "1/s", low=0.0)
    power: float = quantity("pm", "", default=0.25, low=0.0, high=4.0, role="shape")
    id = "power_loss"
    summary = "A loss that grows faster than the difference: free convection, a turbulent flow."
    check = "Hold several differences at rest: the supply over them bends upward."

    def loss(self, state: sympy.Expr, around: sympy.Expr, unit: str, p: Symbols) -> sympy.Expr:
        """Return the loss by the difference."""
        difference = state - around
        size = maximum(sympy.Abs(difference), SMALL)  # the slope by the power stays finite
        return p["coefficient"] * difference * size ** p["power"]

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a faint loss with a small and a large power."""
        size = scales.typical[parts(target)[0]] or 1.0
        return tuple(cls(target, _faint(target, scales) / size**m, m) for m in (0.25, 1.0))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the power where it differs from a loss in proportion."""
        return {"power": (0.1, 3.0)}


@dataclass(frozen=True)
class LeakToInput(LossEffect):
    r"""An exchange with surroundings given by an input, :math:`\dot x = f - \lambda (x - u)`.

    Parameters
    ----------
    target : str
        State and input, as ``"T(T_room)"``.
    coefficient : float, default=0
        Exchange :math:`\lambda` [1/s].

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> oven = PhysicsModel({"T": "K"}, {"T": "P/C"}, {"C": 80.0}, {"P": "W", "T_room": "K"})
    >>> print((oven + LeakToInput("T(T_room)", coefficient=0.01)).to_text())
    T' = -lu_T_T_room*(T - T_room) + P/C
    """

    coefficient: float = quantity("lu", "1/s", low=0.0)
    id = "leak_to_input"
    summary = "The state tends to the value of a measured input: a heat loss to a measured room."
    check = "Switch off all other inputs and record: the state tends to that input's value."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the first-order states, each with every input of the same unit, if it has one."""
        return tuple(
            pair(state, name)
            for state in first_order_states(model)
            for name, unit in model.inputs.items()
            if unit and unit == model.unit(state)
        )

    @classmethod
    def title(cls, target: str) -> str:
        """Return state and input in words."""
        return "leak of {} to {}".format(*parts(target))

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Subtract the loss from the state's rate."""
        state, name = parts(self.target)
        loss = p["coefficient"] * (symbol(state) - symbol(name))
        return with_rates(model, {state: model.equations[state] - loss})
