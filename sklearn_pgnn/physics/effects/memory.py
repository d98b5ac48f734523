"""Forces that remember the motion: a spring that closes a loop."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

from sklearn_pgnn.physics.effect import quantity
from sklearn_pgnn.physics.effects.rates import PositionEffect, force_scale
from sklearn_pgnn.physics.expressions import symbol

if TYPE_CHECKING:
    from sklearn_pgnn.physics.effect import Effect
    from sklearn_pgnn.physics.model import PhysicsModel
    from sklearn_pgnn.physics.scales import Scales

#: most by which the stiffness of a loop bends over the travel, in powers of e
MOST_BENT = 20.0


@dataclass(frozen=True)
class HystereticSpring(PositionEffect):
    r"""A spring whose stiffness depends on its force, and on loading or unloading: Bouc-Wen.

    .. math::
        \dot z = k\,v - \frac{s + r}{2}\,|v|\,z - \frac{s - r}{2}\,v\,|z|, \qquad F = z

    The stiffness :math:`dz/dx` is :math:`k - s|z|` as the force grows and :math:`k + r|z|` as it
    falls. With :math:`s > 0` the force levels off at :math:`k/s`, which is a `Hysteresis`; with
    :math:`s < 0` the spring hardens. In the letters of the literature, :math:`A = k`,
    :math:`\gamma\beta = (s + r)/2`, :math:`\delta\beta = (s - r)/2`.

    Parameters
    ----------
    target : str
        The velocity.
    stiffness : float, default=0
        Stiffness :math:`k` at no force [force per position].
    softening : float, default=0
        Loss :math:`s` of stiffness per force as the force grows [1/position]; below 0 it hardens.
    stiffening : float, default=0
        Gain :math:`r` of stiffness per force as the force falls [1/position].

    References
    ----------
    .. [1] Y.-K. Wen, "Method for random vibration of hysteretic systems", Journal of the
       Engineering Mechanics Division 102(2), 1976, :doi:`10.1061/JMCEA3.0002106`.
    .. [2] J.-P. Noel, M. Schoukens, "Hysteretic benchmark with a dynamic nonlinearity", Workshop
       on Nonlinear System Identification Benchmarks, Brussels, 2016.

    Examples
    --------
    >>> HystereticSpring("v", 5e4, softening=-300.0, stiffening=1900.0).names()
    {'stiffness': 'kh_v', 'softening': 'sf_v', 'stiffening': 'rf_v'}
    """

    stiffness: float = quantity("kh", "{force}/({position})", low=0.0)
    softening: float = quantity("sf", "1/({position})", role="shape")
    stiffening: float = quantity("rf", "1/({position})", role="shape")
    id = "hysteretic_spring"
    summary = (
        "A spring that remembers: it is stiffer, or softer, as it is unloaded than as it is loaded."
    )
    check = "Load and unload slowly over strokes of several sizes: the force over position loops."
    generalises = ("hysteresis",)
    excludes = ("hysteresis",)

    def force(
        self, v: sympy.Expr, position: sympy.Expr, p: Mapping[str, sympy.Symbol]
    ) -> sympy.Expr:
        """Return the state, which is the force."""
        return symbol(self.state)

    @property
    def state(self) -> str:
        """Return the name of the added state."""
        return f"z_{self.target}"

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Subtract the force and add it to the states."""
        changes = super().rewrite(model, p)
        v, z = model.port(self.target).flow, symbol(self.state)
        soft, stiff = p["softening"], p["stiffening"]
        bend = (soft + stiff) / 2 * sympy.Abs(v) * z + (soft - stiff) / 2 * v * sympy.Abs(z)
        changes["equations"][self.state] = p["stiffness"] * v - bend
        changes["states"] = {**model.states, self.state: self.units(model)["force"]}
        changes["initial_state"] = {**model.initial_state, self.state: 0.0}
        return changes

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with weak and strong springs that unload steeply, soften or not."""
        travel = scales.typical[model.port(target).position]
        stiffness = force_scale(target, model, scales) / travel
        parts = itertools.product((0.1, 0.5), (0.0, 0.5), (0.5,))
        return tuple(
            cls(target, k * stiffness, soft / travel, stiff / travel) for k, soft, stiff in parts
        )

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Bound the growth of the force over the travel."""
        most = MOST_BENT / scales.peak[model.port(target).position]
        return {"softening": (-most / 4, most), "stiffening": (0.0, most)}
