"""Effects on any rate: bounds on the rate and on its state, a rim, and a linear loss."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.rates import is_velocity
from sklearn_pgnn.physics.expressions import bounded, maximum, minimum, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_units import rate_unit
from sklearn_pgnn.physics.repeated_rates import with_rates
from sklearn_pgnn.physics.scales import Scales


def first_order_states(model: PhysicsModel) -> tuple[str, ...]:
    """Return the names of the states that are neither velocities nor their positions."""
    known = set(model.kinematic_pairs.values())
    return tuple(s for s in model.states if s not in known and not is_velocity(model, s))


@dataclass(frozen=True)
class StateEffect(Effect):
    """A state whose rate is replaced by an expression of it."""

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the first-order states: neither velocities nor their positions."""
        return first_order_states(model)

    def rate(self, state: sympy.Expr, rate: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the new rate from the state and its old rate."""
        raise NotImplementedError

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Replace the target's rate."""
        old = model.equations[self.target]
        new = self.rate(symbol(self.target), old, p)
        return with_rates(model, {self.target: new})

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the missing rate over the state."""
        return Characteristic("force", self.target, symbol(self.target))

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return the units of the state and of its rate."""
        unit = model.unit(self.target)
        return {"target": unit, "rate": rate_unit(unit)}


@dataclass(frozen=True)
class RateLimit(StateEffect):
    r"""A state that cannot change faster than a limit, :math:`|\dot x| \le R`.

    Parameters
    ----------
    target : str
        The state.
    limit : float, default=1e9
        Limit :math:`R` [state per second].

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> print((lag + RateLimit("y", limit=0.5)).to_text())
    y' = max(-R_y, min(R_y, (u - y)/T))
    """

    limit: float = quantity("R", "{rate}", default=1e9, low=0.0, role="end")
    id = "rate_limit"
    summary = "The state cannot change faster than a limit: flow, power or current at its maximum."
    check = "Command steps of growing size: the slope of the response stops growing."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of all states."""
        return tuple(model.states)

    def rate(self, state: sympy.Expr, rate: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the rate, bounded."""
        return bounded(rate, p["limit"])

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the rate over the rate without the limit."""
        return Characteristic("rate", self.target)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from light to heavy limiting."""
        return tuple(cls(target, share * scales.rate[target]) for share in (2.0, 1.0, 0.5))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the limit low enough to act."""
        return {"limit": (0.05 * scales.rate[target], 10.0 * scales.rate[target])}


@dataclass(frozen=True)
class StateLimit(StateEffect):
    r"""A state that cannot leave a range: a level that overflows, a value at its stop.

    .. math:: \dot x = \max(\min(f, (L - x)\,c), -(L + x)\,c)

    Parameters
    ----------
    target : str
        The state.
    limit : float, default=1e9
        Limit :math:`L` of the magnitude [state].
    steepness : float, default=1
        Rate :math:`c` at which the state comes to rest at its limit [1/s].

    Examples
    --------
    >>> StateLimit("level", limit=12.0).names()
    {'limit': 'L_level', 'steepness': 'cL_level'}
    """

    limit: float = quantity("L", "{target}", default=1e9, low=0.0, role="end")
    steepness: float = quantity("cL", "1/s", default=1.0, low=0.0, role="shape")
    id = "state_limit"
    summary = "The state cannot go beyond a limit: a tank that spills, a slider at its stop."
    check = "Drive the state to its limit: it stays there although the command increases."

    def rate(self, state: sympy.Expr, rate: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the rate that comes to rest at the limits."""
        top = (p["limit"] - state) * p["steepness"]
        bottom = -(p["limit"] + state) * p["steepness"]
        return maximum(minimum(rate, top), bottom)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a light to a heavy limit."""
        steepness = 0.3 / scales.sample_time
        peak = scales.peak[target]
        return tuple(cls(target, share * peak, steepness) for share in (0.95, 0.8, 0.6))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the limit low enough to act, and the stop no faster than the samples resolve."""
        steepness = (1.0 / scales.window, 1.0 / scales.sample_time)
        return {"limit": limits_of_a_level(target, scales), "steepness": steepness}


def limits_of_a_level(target: str, scales: Scales) -> tuple[float, float]:
    """Return the least and the largest limit for a level that slows down towards it.

    A level with inflow comes to rest below its limit, and even at its peak it is slowed down by a
    limit above.
    """
    peak = scales.peak[target]
    return 0.1 * peak, peak + scales.rate[target] * scales.window


@dataclass(frozen=True)
class Leak(StateEffect):
    r"""A loss in proportion to the state, :math:`\dot x = f - \lambda x`.

    Parameters
    ----------
    target : str
        The state.
    coefficient : float, default=0
        Loss :math:`\lambda` [1/s].

    Examples
    --------
    >>> Leak("level", coefficient=0.01).names()
    {'coefficient': 'lk_level'}
    """

    coefficient: float = quantity("lk", "1/s", low=0.0)
    id = "leak"
    summary = "The state loses what it holds, in proportion to it: a leak, a heat loss, a drain."
    check = "Fill, switch off all inputs and record: the state falls exponentially."

    def rate(self, state: sympy.Expr, rate: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the rate less the loss."""
        return rate - p["coefficient"] * state


@dataclass(frozen=True)
class LeakToLevel(StateEffect):
    r"""An exchange with constant surroundings, :math:`\dot x = f - \lambda (x - c)`.

    Parameters
    ----------
    target : str
        The state.
    coefficient : float, default=0
        Exchange :math:`\lambda` [1/s].
    level : float, default=0
        Value :math:`c` [state] that the state tends to if left alone.

    Examples
    --------
    >>> LeakToLevel("T", coefficient=0.01, level=293.0).names()
    {'coefficient': 'lc_T', 'level': 'c_T'}
    """

    coefficient: float = quantity("lc", "1/s", low=0.0)
    level: float = quantity("c", "{target}", role="shape")
    id = "leak_to_level"
    generalises = (Leak.id,)
    excludes = (Leak.id,)
    summary = "The state tends to a level of its surroundings: a heat loss to a room, a leak."
    check = "Switch off all inputs and record: the state tends to a level that is not zero."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the states without a linear loss: with one, a constant load acts as the level."""
        slopes = {s: model.equations[s].diff(symbol(s)) for s in super().targets(model)}
        numbers = {symbol(name) for name in model.parameters}
        return tuple(s for s, a in slopes.items() if a == 0 or not a.free_symbols <= numbers)

    def rate(self, state: sympy.Expr, rate: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the rate less the loss."""
        return rate - p["coefficient"] * (state - p["level"])

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start at a loss within about a window, to the lower or the upper end of the state."""
        low, high = scales.ends(target)
        return tuple(cls(target, 0.1 / scales.window, level) for level in (low, high))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the level within three ranges of the state."""
        low, high = scales.ends(target)
        return {"level": (2 * low - high, 2 * high - low)}


@dataclass(frozen=True)
class Overflow(StateEffect):
    r"""A level that overflows at a rim, partly into the vessel that it flows into.

    .. math:: \dot x = \min(f, c (L - x)), \qquad
              \dot x_\mathrm{next} = f_\mathrm{next} + \rho \max(f - c (L - x), 0)

    The next vessel is the one first-order state of the same unit whose rate depends on the level
    and that does not act back on it.

    Parameters
    ----------
    target : str
        The level.
    limit : float, default=1e9
        Rim :math:`L` [state].
    steepness : float, default=1
        Rate :math:`c` at which the level comes to rest at its rim [1/s].
    share : float, default=0
        Gain of the next level per loss of this one, :math:`\rho`.

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import two_tanks
    >>> spilling = two_tanks() + Overflow("x1", limit=9.0, share=0.6)
    >>> spilling.with_parameters(Lo_x1=8.0).parameters["so_x1"].value
    0.6
    """

    limit: float = quantity("Lo", "{target}", default=1e9, low=0.0, role="end")
    steepness: float = quantity("co", "1/s", default=1.0, low=0.0, role="shape")
    share: float = quantity("so", "", low=0.0, role="shape")
    id = "overflow"
    summary = "A vessel spills over its rim, and part of it enters the next one."
    check = "Fill the vessel to its rim and watch where the excess goes."
    generalises = (StateLimit.id,)
    excludes = (StateLimit.id,)

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the levels that flow into exactly one other."""
        return tuple(state for state in super().targets(model) if len(_next(model, state)) == 1)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Subtract the overflow from the target, and add a share of it to the next level."""
        (below,) = _next(model, self.target)
        inflow = model.equations[self.target]
        room = (p["limit"] - symbol(self.target)) * p["steepness"]
        spilled = p["share"] * maximum(inflow - room, 0)
        rates = {self.target: minimum(inflow, room), below: model.equations[below] + spilled}
        return with_rates(model, rates)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a small to a large overflow, half of it caught."""
        steepness, peak = 0.3 / scales.sample_time, scales.peak[target]
        return tuple(cls(target, part * peak, steepness, 0.5) for part in (0.95, 0.8, 0.6))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep some overflow; come to rest within a tenth of a window, as samples can resolve."""
        fastest = 1.0 / scales.sample_time
        return {
            "limit": limits_of_a_level(target, scales),
            "steepness": (min(10.0 / scales.window, fastest), fastest),
            "share": (0.0, 2.0),
        }


def _next(model: PhysicsModel, state: str) -> tuple[str, ...]:
    """Return the names of the levels into which a level flows."""
    unit = model.unit(state)
    return tuple(
        other
        for other in first_order_states(model)
        if other != state
        and model.unit(other) == unit
        and model.equations[other].has(symbol(state))
        and not model.equations[state].has(symbol(other))
    )
