"""Forces that remember the motion: a spring that closes a loop."""

import itertools
from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.friction import goes_both_ways
from sklearn_pgnn.physics.effects.rates import PositionEffect, force_scale
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales

#: least and most by which the stiffness of a loop changes over the travel, in powers of e
LEAST_LOOP, MOST_BENT = 0.1, 20.0


@dataclass(frozen=True)
class HystereticSpring(PositionEffect):
    r"""A spring that is stiffer, or softer, as it is unloaded than as it is loaded: Bouc-Wen.

    .. math:: \dot z = k\,v - \gamma\,|v|\,z - \delta\,v\,|z|, \qquad F = z

    The stiffness :math:`dz/dx` is :math:`k - (\gamma + \delta)|z|` as the force grows, and
    :math:`k + (\gamma - \delta)|z|` as it falls. With :math:`\gamma + \delta > 0` the force levels
    off; below zero the spring hardens. With :math:`\delta > 0` it is the law of a `Hysteresis`,
    which a diagnosis names in its place.

    Parameters
    ----------
    target : str
        The velocity.
    stiffness : float, default=0
        Stiffness :math:`k` at no force [force per position].
    loss : float, default=0
        Coefficient :math:`\gamma` of the loop, which loses energy [1/position].
    bend : float, default=0
        Coefficient :math:`\delta`, of any sign [1/position].

    References
    ----------
    .. [1] Y.-K. Wen, "Method for random vibration of hysteretic systems", Journal of the
       Engineering Mechanics Division 102(2), 1976, :doi:`10.1061/JMCEA3.0002106`.
    .. [2] J.-P. Noel, M. Schoukens, "Hysteretic benchmark with a dynamic nonlinearity", Workshop
       on Nonlinear System Identification Benchmarks, Brussels, 2016.

    Examples
    --------
    >>> HystereticSpring("v", 5e4, loss=800.0, bend=-1100.0).names()
    {'stiffness': 'kh_v', 'loss': 'gh_v', 'bend': 'bh_v'}
    """

    stiffness: float = quantity("kh", "{force}/({position})", low=0.0)
    loss: float = quantity("gh", "1/({position})", low=0.0, role="shape")
    bend: float = quantity("bh", "1/({position})", role="shape")
    id = "hysteretic_spring"
    summary = (
        "A spring that remembers: it is stiffer, or softer, as it is unloaded than as it is loaded."
    )
    check = "Load and unload slowly over strokes of several sizes: the force over position loops."
    generalises = ("hysteresis",)
    excludes = ("hysteresis",)

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the state, which is the force."""
        return symbol(self.state)

    @property
    def state(self) -> str:
        """Return the name of the added state."""
        return f"z_{self.target}"

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Subtract the force and add it to the states."""
        changes = super().rewrite(model, p)
        v, z = model.port(self.target).flow, symbol(self.state)
        bend = p["loss"] * sympy.Abs(v) * z + p["bend"] * v * sympy.Abs(z)
        changes["equations"][self.state] = p["stiffness"] * v - bend
        changes["states"] = {**model.states, self.state: self.units(model)["force"]}
        changes["initial_state"] = {**model.initial_state, self.state: 0.0}
        return changes

    def is_shown(self, model: PhysicsModel, scales: Scales) -> bool:
        """Return whether the motion goes in both directions, as a loop needs."""
        return goes_both_ways(self.target, scales)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with weak and strong springs that level off, or do not."""
        travel = scales.typical[model.port(target).position]
        stiffness = force_scale(target, model, scales) / travel
        parts = itertools.product((0.1, 0.5), ((0.25, -0.25), (0.5, -0.1)))
        return tuple(
            cls(target, share * stiffness, loss / travel, bend / travel)
            for share, (loss, bend) in parts
        )

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep a loop that no `Hysteresis` has, and bound the force's growth over the travel.

        Without a loop this is a linear spring, with a new load in every window.
        """
        travel = scales.peak[model.port(target).position]
        return {
            "loss": (LEAST_LOOP / travel, MOST_BENT / travel),
            "bend": (-MOST_BENT / travel, 0.0),
        }
