"""A vessel that overflows into the next one below."""

from dataclasses import dataclass

from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.levels import (
    StateEffect,
    StateLimit,
    first_order_states,
    limits_of_a_level,
)
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.extremes import maximum, minimum
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.repeated_rates import with_rates
from sklearn_pgnn.physics.scales import Scales


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
