"""Effects on the rate of a velocity: friction, springs, loads."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import sympy

from sklearn_pgnn.physics.effect import Effect, quantity
from sklearn_pgnn.physics.expressions import symbol

#: units that make a state a velocity even where no other state is its integral
SPEED_UNITS = frozenset(
    {"m/s", "mm/s", "km/h", "rad/s", "deg/s", "rpm", "1/s", "rev/s", "r/min", "1/min"}
)
#: unit of a force by the unit of the inertia that it accelerates
FORCE_UNITS = {"kg": "N", "kg m^2": "N m", "kg*m^2": "N m", "kg m²": "N m", "t": "kN"}


def is_velocity(model, state: str) -> bool:
    """Tell whether a state is a velocity: by a kinematic pair, an inertia or its unit."""
    return (
        state in model.kinematic_pairs
        or state in model.inertia
        or model.states[state].strip() in SPEED_UNITS
    )


#: periods of a ripple that are looked for within the travel
MOST_CYCLES = 40.0


@dataclass(frozen=True)
class RateEffect(Effect):
    """A force (or, without an inertia, a deceleration) that resists a velocity's rate."""

    @classmethod
    def targets(cls, model):
        """Name the velocities of the model."""
        return tuple(state for state in model.states if is_velocity(model, state))

    def force(self, v, position, p):
        """Give the resisting force as an expression of velocity and position."""
        raise NotImplementedError

    def potential(self, position, p):
        """Give the energy the force stores, zero for a dissipative one."""
        return sympy.Integer(0)

    def rewrite(self, model, p):
        """Subtract the force, divided by the inertia, from the target's rate."""
        v = symbol(self.target)
        pair = model.kinematic_pairs.get(self.target)
        position = None if pair is None else symbol(pair)
        force = self.force(v, position, p)
        inertia = model.inertia.get(self.target, sympy.Integer(1))
        equations = dict(model.equations)
        equations[self.target] = _over_common_inertia(equations[self.target], force, inertia)
        return {"equations": equations, "energy": self._energy(model, force * v, position, p)}

    def _energy(self, model, power, position, p):
        energy = dict(model.energy)
        if energy and self.target in model.inertia:
            potential = self.potential(position, p)
            if potential != 0:
                energy["stored"] = energy.get("stored", 0) + potential
            else:
                energy["dissipated"] = energy.get("dissipated", 0) + power
        return energy

    def units(self, model):
        """Give the units of force, velocity and position at the target."""
        velocity = model.unit(self.target)
        pair = model.kinematic_pairs.get(self.target)
        return {
            "force": force_unit(model, self.target),
            "velocity": velocity,
            "position": "" if pair is None else model.unit(pair),
        }


def force_unit(model, target: str) -> str:
    """Give the unit of inertia times rate of a velocity."""
    rate = f"{model.unit(target)}/s".lstrip("/") if model.unit(target) else "1/s"
    rate = {"m/s/s": "m/s^2", "rad/s/s": "rad/s^2"}.get(rate, rate)
    inertia = model.inertia.get(target)
    if inertia is None:
        return rate
    unit = model.unit(str(inertia))
    return FORCE_UNITS.get(unit, f"{unit} {rate}".strip())


def _over_common_inertia(rate, force, inertia):
    """Subtract force/inertia, keeping the form (sum of forces)/inertia where there is one."""
    if inertia == 1:
        return rate - force
    numerator = rate * inertia
    if not numerator.has(1 / inertia):
        return (numerator - force) / inertia
    return rate - force / inertia


@dataclass(frozen=True)
class PositionEffect(RateEffect):
    """A force that depends on the position, so the velocity must have one."""

    @classmethod
    def targets(cls, model):
        """Name the velocities of kinematic pairs."""
        return tuple(state for state in model.states if state in model.kinematic_pairs)


def _force_scale(target, model, scales):
    """Give the force that makes up the typical rate of the target."""
    inertia = model.inertia.get(target, sympy.Integer(1))
    values = {symbol(n): p.value for n, p in model.parameters.items()}
    value = inertia.subs(values)
    size = abs(float(value)) if value.is_number else 1.0
    return size * scales.rate[target]


@dataclass(frozen=True)
class ViscousFriction(RateEffect):
    r"""Friction in proportion to the velocity, :math:`F = d\,v`.

    Parameters
    ----------
    target : str
        The velocity.
    coefficient : float, default=0
        Damping :math:`d` [force per velocity].

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "F/m"}, {"m": 2.0}, {"F": "N"}, inertia={"v": "m"})
    >>> print((cart + ViscousFriction("v", coefficient=0.5)).to_text())
    v' = (F - d_v*v)/m
    """

    coefficient: float = quantity("d", "{force}/({velocity})", low=0.0)
    id = "viscous_friction"
    summary = "Friction that grows in proportion to the velocity (oil, bearings, back-EMF)."
    check = "Coast down from several speeds: the speed decays exponentially."

    def force(self, v, position, p):
        """Give d*v."""
        return p["coefficient"] * v

    @classmethod
    def starts(cls, target, model, scales):
        """Start without friction."""
        return (cls(target),)


@dataclass(frozen=True)
class CoulombFriction(RateEffect):
    r"""Dry friction of constant level, :math:`F = F_c\,\mathrm{sign}(v)`.

    The simulation treats the jump at rest exactly: below the level the target sticks.

    Parameters
    ----------
    target : str
        The velocity.
    level : float, default=0
        Friction level :math:`F_c` [force].

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "F/m"}, {"m": 2.0}, {"F": "N"}, inertia={"v": "m"})
    >>> print((cart + CoulombFriction("v", level=0.5)).to_text())
    v' = (F - Fc_v*sign(v))/m
    """

    level: float = quantity("Fc", "{force}", low=0.0)
    id = "coulomb_friction"
    summary = "Dry friction: a force of constant size against the direction of motion."
    check = "Raise the drive slowly from rest: nothing moves up to the friction level."

    def force(self, v, position, p):
        """Give Fc*sign(v)."""
        return p["level"] * sympy.sign(v)

    @classmethod
    def starts(cls, target, model, scales):
        """Start at two small levels."""
        force = _force_scale(target, model, scales)
        return (cls(target, 0.02 * force), cls(target, 0.2 * force))


@dataclass(frozen=True)
class StribeckFriction(RateEffect):
    r"""Dry friction with a peak at rest.

    .. math:: F = \left(F_c + (F_s - F_c)\, e^{-(v/v_s)^2}\right) \mathrm{sign}(v)

    Parameters
    ----------
    target : str
        The velocity.
    level : float, default=0
        Sliding friction :math:`F_c` [force].
    peak : float, default=0
        Static friction above sliding friction, :math:`F_s - F_c` [force].
    velocity : float, default=1
        Stribeck velocity :math:`v_s`, over which the peak fades.

    References
    ----------
    .. [1] B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, "A survey of models, analysis
       tools and compensation methods for the control of machines with friction", Automatica
       30(7), 1994, :doi:`10.1016/0005-1098(94)90209-7`.

    Examples
    --------
    >>> StribeckFriction("omega", level=0.05, peak=0.03, velocity=0.1).names()
    {'level': 'Fk_omega', 'peak': 'Fp_omega', 'velocity': 'vs_omega'}
    """

    level: float = quantity("Fk", "{force}", low=0.0)
    peak: float = quantity("Fp", "{force}", low=0.0)
    velocity: float = quantity("vs", "{velocity}", default=1.0, low=0.0)
    id = "stribeck_friction"
    generalises = ("coulomb_friction",)
    summary = "Dry friction that is higher at rest and low speed than when sliding (stick-slip)."
    check = "Drive at constant low speeds: the force falls as the speed rises, or motion jerks."

    def force(self, v, position, p):
        """Give the Stribeck curve."""
        fading = sympy.exp(-((v / p["velocity"]) ** 2))
        return (p["level"] + p["peak"] * fading) * sympy.sign(v)

    @classmethod
    def starts(cls, target, model, scales):
        """Start from narrow to wide peaks."""
        force, v = _force_scale(target, model, scales), scales.typical[target]
        return tuple(cls(target, 0.02 * force, 0.05 * force, share * v) for share in (0.1, 0.5))

    @classmethod
    def limits(cls, target, model, scales):
        """Keep the peak narrower than the speeds seen and wider than their finest part."""
        return {"velocity": (0.005 * scales.typical[target], 2.0 * scales.typical[target])}


@dataclass(frozen=True)
class AsymmetricFriction(RateEffect):
    r"""Dry and viscous friction that differ by direction.

    .. math:: F = F_+ + d_+ v \;(v > 0), \qquad F = -F_- + d_- v \;(v < 0)

    Parameters
    ----------
    target : str
        The velocity.
    level_forward, level_backward : float, default=0
        Friction levels :math:`F_+, F_-` [force].
    viscous_forward, viscous_backward : float, default=0
        Damping :math:`d_+, d_-` [force per velocity].

    Examples
    --------
    >>> AsymmetricFriction("v", 3.0, 2.0).id
    'asymmetric_friction'
    """

    level_forward: float = quantity("Fcp", "{force}", low=0.0)
    level_backward: float = quantity("Fcn", "{force}", low=0.0)
    viscous_forward: float = quantity("dp", "{force}/({velocity})")
    viscous_backward: float = quantity("dn", "{force}/({velocity})")
    id = "asymmetric_friction"
    generalises = ("coulomb_friction", "viscous_friction", "constant_load")
    shared = MappingProxyType({"coulomb_friction": ("level_forward", "level_backward")})
    summary = "Friction that is different in the two directions of motion."
    check = "Run at the same speed forward and backward and compare the force."

    def force(self, v, position, p):
        """Give the two half-lines as even and odd parts."""
        fp, fn = p["level_forward"], p["level_backward"]
        dp, dn = p["viscous_forward"], p["viscous_backward"]
        dry = (fp - fn) / 2 + (fp + fn) / 2 * sympy.sign(v)
        return dry + (dp + dn) / 2 * v + (dp - dn) / 2 * sympy.Abs(v)

    @classmethod
    def starts(cls, target, model, scales):
        """Start at a small symmetric level."""
        force = 0.02 * _force_scale(target, model, scales)
        return (cls(target, force, force),)


@dataclass(frozen=True)
class QuadraticDrag(RateEffect):
    r"""Drag that grows with the square of the velocity, :math:`F = c\,v|v|`.

    Parameters
    ----------
    target : str
        The velocity.
    coefficient : float, default=0
        Drag :math:`c` [force per velocity squared].

    Examples
    --------
    >>> QuadraticDrag("v", coefficient=0.3).names()
    {'coefficient': 'cq_v'}
    """

    coefficient: float = quantity("cq", "{force}/({velocity})^2", low=0.0)
    id = "quadratic_drag"
    summary = "Drag of a fluid or a fan: it grows with the square of the speed."
    check = "Hold several high speeds and plot the force over the speed squared."

    def force(self, v, position, p):
        """Give c*v*abs(v)."""
        return p["coefficient"] * v * sympy.Abs(v)

    @classmethod
    def starts(cls, target, model, scales):
        """Start without drag."""
        return (cls(target),)


@dataclass(frozen=True)
class LinearStiffness(PositionEffect):
    r"""A spring, :math:`F = k\,x`.

    Parameters
    ----------
    target : str
        The velocity whose position the spring holds.
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

    def force(self, v, position, p):
        """Give k*x."""
        return p["stiffness"] * position

    def potential(self, position, p):
        """Give k*x^2/2."""
        return p["stiffness"] * position**2 / 2

    @classmethod
    def starts(cls, target, model, scales):
        """Start without a spring."""
        return (cls(target),)


@dataclass(frozen=True)
class CubicStiffness(PositionEffect):
    r"""A hardening or softening spring, :math:`F = k_3\,x^3`.

    Parameters
    ----------
    target : str
        The velocity whose position the spring holds.
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

    def force(self, v, position, p):
        """Give k3*x^3."""
        return p["stiffness"] * position**3

    def potential(self, position, p):
        """Give k3*x^4/4."""
        return p["stiffness"] * position**4 / 4

    @classmethod
    def starts(cls, target, model, scales):
        """Start without the cubic part."""
        return (cls(target),)


@dataclass(frozen=True)
class ConstantLoad(RateEffect):
    r"""A constant force, :math:`F = F_0`.

    Parameters
    ----------
    target : str
        The velocity.
    load : float, default=0
        Load :math:`F_0` [force]; positive pulls backward.

    Examples
    --------
    >>> ConstantLoad("v", load=3.0).names()
    {'load': 'F0_v'}
    """

    load: float = quantity("F0", "{force}")
    id = "constant_load"
    summary = "A force of constant size and direction: weight, a tilted axis, a tensioned cable."
    check = "Release the unpowered machine: it drifts to one side, or needs force to stay."

    def force(self, v, position, p):
        """Give F0."""
        return p["load"]

    @classmethod
    def starts(cls, target, model, scales):
        """Start without a load."""
        return (cls(target),)


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
    period: float = quantity("P", "{position}", default=1.0, low=0.0)
    id = "cogging"
    summary = "A ripple that repeats with the position: cogging of a motor, an eccentric gear."
    check = "Move slowly over the whole range: the force repeats at the same positions."

    def force(self, v, position, p):
        """Give the first harmonic."""
        angle = 2 * sympy.pi * position / p["period"]
        return p["sine"] * sympy.sin(angle) + p["cosine"] * sympy.cos(angle)

    @classmethod
    def starts(cls, target, model, scales):
        """Start at every period that the travel can tell from its neighbours."""
        travel = 2 * scales.peak[model.kinematic_pairs[target]]
        force = 1e-3 * _force_scale(target, model, scales)
        cycles = np.arange(1.5, MOST_CYCLES, 0.35)
        return tuple(cls(target, force, force, travel / count) for count in cycles)

    @classmethod
    def limits(cls, target, model, scales):
        """Keep at least one and a half periods within the travel."""
        travel = 2 * scales.peak[model.kinematic_pairs[target]]
        return {"period": (travel / (2 * MOST_CYCLES), travel / 1.5)}
