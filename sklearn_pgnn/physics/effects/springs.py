"""Forces that depend on the position: springs, ripple, end stops, a spring that remembers."""

import itertools
from dataclasses import dataclass
from typing import ClassVar

import sympy

from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.friction import goes_both_ways
from sklearn_pgnn.physics.effects.rates import FAINT, PositionEffect, force_scale
from sklearn_pgnn.physics.expressions import maximum, minimum, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales

#: largest number of periods of a ripple within the travel
MOST_CYCLES = 40.0
#: share of the travel at each of its ends in which a stop may stand
OUTER = 0.25
#: least and most by which the stiffness of a loop changes over the travel, in powers of e
LEAST_LOOP, MOST_BENT = 0.1, 20.0


@dataclass(frozen=True)
class PowerOfPosition(PositionEffect):
    r"""A spring whose force is a power of the position, :math:`F = k\,x^n`."""

    power: ClassVar[int]

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return k*x^n."""
        return p["stiffness"] * position**self.power

    def potential(self, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return k*x^(n+1)/(n+1)."""
        return p["stiffness"] * position ** (self.power + 1) / (self.power + 1)


@dataclass(frozen=True)
class LinearStiffness(PowerOfPosition):
    r"""A spring, :math:`F = k\,x`.

    Parameters
    ----------
    target : str
        The velocity whose position the spring acts on.
    stiffness : float, default=0
        Stiffness :math:`k` [force per position].

    Examples
    --------
    >>> LinearStiffness("v", stiffness=50.0).names()
    {'stiffness': 'k_v'}
    """

    stiffness: float = quantity("k", "{force}/({position})")
    id = "linear_stiffness"
    summary = "A spring, a cable or a gravity slope: a force in proportion to the position."
    check = "Hold several positions at rest and plot the force over the position."
    power = 1


@dataclass(frozen=True)
class QuadraticStiffness(PowerOfPosition):
    r"""A spring that is stiffer on one side than on the other, :math:`F = k_2\,x^2`.

    Parameters
    ----------
    target : str
        The velocity whose position the spring acts on.
    stiffness : float, default=0
        Stiffness :math:`k_2` [force per position squared].

    Examples
    --------
    >>> QuadraticStiffness("v", stiffness=5.0).names()
    {'stiffness': 'k2_v'}
    """

    stiffness: float = quantity("k2", "{force}/({position})^2")
    id = "quadratic_stiffness"
    summary = "A spring that is stiffer on one side: preloaded, sagging, or bent."
    check = "Push and pull with the same force: the deflections differ."
    power = 2


@dataclass(frozen=True)
class CubicStiffness(PowerOfPosition):
    r"""A hardening or softening spring, :math:`F = k_3\,x^3`.

    Parameters
    ----------
    target : str
        The velocity whose position the spring acts on.
    stiffness : float, default=0
        Stiffness :math:`k_3` [force per position cubed].

    Examples
    --------
    >>> CubicStiffness("v", stiffness=50.0).names()
    {'stiffness': 'k3_v'}
    """

    stiffness: float = quantity("k3", "{force}/({position})^3")
    id = "cubic_stiffness"
    summary = "A spring that hardens (or softens) with the deflection."
    check = "Compare the resonance frequency at small and at large amplitude."
    power = 3


@dataclass(frozen=True)
class Cogging(PositionEffect):
    r"""A force periodic in the position, :math:`F = A\sin(2\pi x/P) + B\cos(2\pi x/P)`.

    Parameters
    ----------
    target : str
        The velocity whose position the force depends on.
    sine, cosine : float, default=0
        Amplitudes :math:`A, B` [force].
    period : float, default=1
        Period :math:`P` [position].

    Examples
    --------
    >>> Cogging("omega", sine=0.1, period=0.5).names()
    {'sine': 'As_omega', 'cosine': 'Ac_omega', 'period': 'P_omega'}
    """

    sine: float = quantity("As", "{force}")
    cosine: float = quantity("Ac", "{force}")
    period: float = quantity("P", "{position}", default=1.0, low=0.0, role="shape")
    id = "cogging"
    summary = "A ripple that repeats with the position: cogging of a motor, an eccentric gear."
    check = "Move slowly over the whole range: the force repeats at the same positions."

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the first harmonic."""
        angle = 2 * sympy.pi * position / p["period"]
        return p["sine"] * sympy.sin(angle) + p["cosine"] * sympy.cos(angle)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with small amplitudes at prominent periods of the missing rate, or half travel."""
        force = FAINT * force_scale(target, model, scales)
        periods = scales.ripples.get(target) or (scales.peak[model.port(target).position],)
        return tuple(cls(target, force, force, period) for period in periods)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep at least one and a half periods within the travel."""
        travel = 2 * scales.peak[model.port(target).position]
        return {"period": (travel / (2 * MOST_CYCLES), travel / 1.5)}


@dataclass(frozen=True)
class EndStop(PositionEffect):
    r"""Stiff stops at the ends of the travel.

    .. math:: F = k \left(\max(x - x_+, 0) + \min(x - x_-, 0)\right)

    Parameters
    ----------
    target : str
        The velocity whose position the stops limit.
    upper, lower : float, default=1e9, -1e9
        Positions of the stops, :math:`x_+, x_-` [position].
    stiffness : float, default=0
        Their stiffness :math:`k` [force per position].

    Examples
    --------
    >>> EndStop("v", upper=0.4, lower=-0.4, stiffness=1e4).names()
    {'upper': 'xu_v', 'lower': 'xl_v', 'stiffness': 'ks_v'}
    """

    upper: float = quantity("xu", "{position}", default=1e9, role="end")
    lower: float = quantity("xl", "{position}", default=-1e9, role="end")
    stiffness: float = quantity("ks", "{force}/({position})", low=0.0, role="shape")
    id = "end_stop"
    summary = "The motion runs into a stop, a bumper or a hard bearing at an end of the travel."
    check = "Move slowly to both ends: the force rises steeply where the motion ends."
    generalises = ("linear_stiffness", "constant_load")

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the stops' force."""
        beyond = maximum(position - p["upper"], 0) + minimum(position - p["lower"], 0)
        return p["stiffness"] * beyond

    def potential(self, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the energy that the stops store."""
        above = maximum(position - p["upper"], 0)
        below = minimum(position - p["lower"], 0)
        return p["stiffness"] * (above**2 + below**2) / 2

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with stops at both ends or at one."""
        position = model.port(target).position
        stiffness = 5.0 * force_scale(target, model, scales) / scales.peak[position]
        cuts = ((0.05, 0.05), (0.2, 0.2), (0.1, 0.0), (0.0, 0.1))
        places = (scales.ends(position, below, above) for above, below in cuts)
        return tuple(cls(target, upper, lower, stiffness) for lower, upper in places)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep each stop near its end of the travel: what acts further inside is a spring."""
        position = model.port(target).position
        low, high = scales.ends(position)
        inner_low, inner_high = scales.ends(position, OUTER, OUTER)
        return {"upper": (inner_high, high), "lower": (low, inner_low)}


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
