"""Friction on a velocity: viscous, dry, by direction, with hysteresis; drag."""

import itertools
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import sympy

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.levels import first_order_states
from sklearn_pgnn.physics.effects.rates import (
    PositionEffect,
    RateEffect,
    force_scale,
    may_be_speed,
)
from sklearn_pgnn.physics.expressions import bounded, expanded, symbol
from sklearn_pgnn.physics.mass_matrix import balances_of, own_entry
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port
from sklearn_pgnn.physics.scales import Scales

#: placeholder for the load until the model defines it
LOAD = sympy.Symbol("_load", real=True)
#: least fraction of a speed's range on either side of rest for motion in two directions; less is
#: within the noise of a speed obtained from differences
BOTH_WAYS = 0.05


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

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return d*v."""
        return p["coefficient"] * v


@dataclass(frozen=True)
class SpeedEffect(RateEffect):
    """A force that needs only a speed, whether or not the model declares it as one."""

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the velocities of the model, and of signals that may be speeds."""
        known = super().targets(model)
        flows = {name: str(model.port(name).flow) for name in model.ports}
        speeds = [s for s in flows.values() if s in model.states and may_be_speed(model, s)]
        return tuple(name for name, flow in flows.items() if name in known or flow in speeds)


@dataclass(frozen=True)
class CoulombFriction(SpeedEffect):
    r"""Dry friction of constant level, :math:`F = F_c\,\mathrm{sign}(v)`.

    The simulation treats the jump at rest exactly: for forces below the level the target sticks.

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
    phrase = "Coulomb friction on {target}"
    summary = "Dry friction: a force of constant size against the direction of motion."
    check = "Raise the drive slowly from rest: nothing moves up to the friction level."

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return Fc*sign(v)."""
        return p["level"] * sympy.sign(v)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start at two small levels."""
        force = force_scale(target, model, scales)
        return (cls(target, 0.02 * force), cls(target, 0.2 * force))


@dataclass(frozen=True)
class LoadFriction(SpeedEffect):
    r"""Dry friction that grows with the transmitted load, as in a gear.

    .. math:: F = (F_c + \mu\,|F_d|)\,\mathrm{sign}(v)

    The load :math:`F_d` is the driving force of the velocity: the part of the inputs or, where no
    input acts on it, that of first-order states, such as a motor's current.

    Parameters
    ----------
    target : str
        The velocity.
    level : float, default=0
        Friction level :math:`F_c` without load [force].
    share : float, default=0
        Fraction :math:`\mu` of the load that is lost; from 1 on, nothing would move.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "F/m"}, {"m": 2.0}, {"F": "N"}, inertia={"v": "m"})
    >>> print((cart + LoadFriction("v", level=0.5, share=0.1)).to_text())
    v' = (F - (Fl_v + mul_v*abs(F))*sign(v))/m
    """

    level: float = quantity("Fl", "{force}", low=0.0)
    share: float = quantity("mul", "", low=0.0, high=1.0)
    id = "load_friction"
    generalises: ClassVar[tuple[str, ...]] = (CoulombFriction.id,)
    excludes: ClassVar[tuple[str, ...]] = (CoulombFriction.id,)
    summary = "Dry friction that grows with the load: a worm gear, a spindle, a toothed gear."
    check = "Lift and lower different weights: the friction grows with the weight."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the velocities with a driving force."""
        return tuple(name for name in super().targets(model) if driving_force(model, name) != 0)

    @classmethod
    def can_act(cls, target: str, model: PhysicsModel) -> bool:
        """Return whether the target may have dry friction."""
        return target in super().targets(model)

    def effort(self, model: PhysicsModel) -> sympy.Expr:
        """Return the friction, with the driving force in the place of the load's symbol."""
        return super().effort(model).xreplace({LOAD: driving_force(model, self.target)})

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return (Fc + mu*abs(Fd))*sign(v)."""
        return (p["level"] + p["share"] * sympy.Abs(LOAD)) * sympy.sign(v)

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the force over the load, by the direction of motion."""
        port = model.port(self.target)
        load = sympy.Abs(driving_force(model, self.target)) * sympy.sign(port.flow)
        return Characteristic("force", self.target, load, unit=port.unit)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with a small and with a larger loss."""
        force = force_scale(target, model, scales)
        return (cls(target, 0.02 * force, 0.02), cls(target, 0.02 * force, 0.2))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the transmitted load above zero."""
        return {"share": (0.0, 0.95)}


def driving_force(model: PhysicsModel, target: str) -> sympy.Expr:
    """Return the addends of a port's effort with inputs, or else with first-order states."""
    port = model.port(target)
    state, forces = _forces_at(model, port)
    if forces is None:
        return _drive_of_several(model, port)
    known = {state, port.position}
    addends = sympy.Add.make_args(expanded(forces))
    others = [set(map(str, part.free_symbols)) - known for part in addends]
    free = [not part.has(symbol(state)) for part in addends]
    for driving in _driving(model):
        drive = [
            part
            for part, names, is_free in zip(addends, others, free, strict=True)
            if is_free and names & driving
        ]
        if drive:
            return sympy.Add(*drive)
    return sympy.Integer(0)


def _forces_at(model: PhysicsModel, port: Port) -> tuple[str, sympy.Expr | None]:
    """Return the velocity of a port and the sum of forces on it, where the model tells them."""
    for other, slopes in balances_of(model, port.flow, port.rates).items():
        if len(slopes) == 1:
            ((state, slope),) = slopes.items()
            return state, getattr(model, other)[state] / slope
    if len(port.rates) > 1:
        return "", None
    ((state, mobility),) = port.rates.items()
    inertia = own_entry(model.inertia, state) or 1 / mobility
    return state, _unbounded(model.equations[state]) * inertia


def _driving(model: PhysicsModel) -> tuple[set[str], set[str]]:
    """Return the names of what may drive: inputs, or else first-order states."""
    return {*model.inputs, *model.settled}, set(first_order_states(model))


def _drive_of_several(model: PhysicsModel, port: Port) -> sympy.Expr:
    """Return what enters every rate of a port as the port's effort does."""
    for driving in _driving(model):
        columns = {
            name: {s: slope for s, r in model.equations.items() if (slope := r.diff(symbol(name)))}
            for name in sorted(driving)
        }
        shares = {n: {c / port.rates.get(s, 0) for s, c in of.items()} for n, of in columns.items()}
        drive = [
            symbol(n) * next(iter(share))
            for n, share in shares.items()
            if len(share) == 1 and set(columns[n]) == set(port.rates)
        ]
        if drive:
            return sympy.Add(*drive)
    return sympy.Integer(0)


def _unbounded(rate: sympy.Expr) -> sympy.Expr:
    """Return a rate without its bounds: of the values it compares, the one with most symbols."""
    while isinstance(rate, sympy.Max | sympy.Min):
        rate = max(rate.args, key=lambda part: len(part.free_symbols))
    return rate


@dataclass(frozen=True)
class StribeckFriction(SpeedEffect):
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
    velocity: float = quantity("vs", "{velocity}", default=1.0, low=0.0, role="shape")
    id = "stribeck_friction"
    phrase = "Stribeck friction on {target}"
    words = MappingProxyType({"peak": "peak above the level"})
    generalises = ("coulomb_friction",)
    summary = (
        "Dry friction that is higher at rest and at low speed than when sliding (stick-slip): the "
        "break-away force is the level plus the peak."
    )
    check = "Drive at constant low speeds: the force falls as the speed rises, or motion jerks."

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the Stribeck curve."""
        fading = sympy.exp(-((v / p["velocity"]) ** 2))
        return (p["level"] + p["peak"] * fading) * sympy.sign(v)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from narrow to wide peaks."""
        force, v = force_scale(target, model, scales), scales.typical[target]
        return tuple(cls(target, 0.02 * force, 0.05 * force, share * v) for share in (0.1, 0.5))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the peak narrower than the speeds seen and wider than their finest part."""
        return {"velocity": (0.005 * scales.typical[target], 2.0 * scales.typical[target])}


def goes_both_ways(velocity: str, scales: Scales) -> bool:
    """Return whether a motion goes in both directions, by more than the error of an estimate."""
    low, high = scales.ends(velocity)
    return min(-low, high) > BOTH_WAYS * (high - low)


@dataclass(frozen=True)
class AsymmetricFriction(SpeedEffect):
    r"""Dry and viscous friction that differ by the direction of motion.

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

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the two half-lines as even and odd parts."""
        fp, fn = p["level_forward"], p["level_backward"]
        dp, dn = p["viscous_forward"], p["viscous_backward"]
        dry = (fp - fn) / 2 + (fp + fn) / 2 * sympy.sign(v)
        return dry + (dp + dn) / 2 * v + (dp - dn) / 2 * sympy.Abs(v)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start at a small symmetric level."""
        force = 0.02 * force_scale(target, model, scales)
        return (cls(target, force, force),)

    def is_distinct(self, scales: Scales) -> bool:
        """Return whether the motion goes in both directions."""
        return goes_both_ways(self.target, scales)


@dataclass(frozen=True)
class QuadraticDrag(SpeedEffect):
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

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return c*v*abs(v)."""
        return p["coefficient"] * v * sympy.Abs(v)


@dataclass(frozen=True)
class Hysteresis(PositionEffect):
    r"""A force with hysteresis: the normalised Bouc-Wen model.

    .. math::
        F = F_h\,\zeta, \qquad
        \dot\zeta = \frac{1}{x_y} \left(v - (1 - s)\,|v|\,\zeta - s\,v\,|\zeta|\right)

    The force reaches :math:`\pm F_h` after a motion of some yield deflections; below, it acts as a
    spring of stiffness :math:`F_h/x_y`. A window may start with any :math:`\zeta`; a value beyond
    :math:`\pm 1`, from which the equation would diverge, counts as :math:`\pm 1`.

    Parameters
    ----------
    target : str
        The velocity.
    level : float, default=0
        Largest force :math:`F_h` [force].
    deflection : float, default=1
        Yield deflection :math:`x_y` [position].
    shape : float, default=0.5
        Difference of unloading from loading, :math:`s` [-]: 0 gives Dahl friction, 0.5 unloads
        along a straight line.

    References
    ----------
    .. [1] Y.-K. Wen, "Method for random vibration of hysteretic systems", Journal of the
       Engineering Mechanics Division 102(2), 1976, :doi:`10.1061/JMCEA3.0002106`.

    Examples
    --------
    >>> Hysteresis("v", level=3.0, deflection=0.01).names()
    {'level': 'Fh_v', 'deflection': 'xy_v', 'shape': 'sh_v'}
    """

    level: float = quantity("Fh", "{force}", low=0.0)
    deflection: float = quantity("xy", "{position}", default=1.0, low=1e-12, role="shape")
    shape: float = quantity("sh", "", default=0.5, low=-0.5, high=1.0, role="shape")
    id = "hysteresis"
    summary = "A force that lags the position and closes a loop: presliding, rubber, cables, gears."
    check = "Move slowly back and forth over small strokes: force over position encloses an area."

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the largest force times the state of the hysteresis."""
        return p["level"] * self.bounded

    @property
    def state(self) -> str:
        """Return the name of the added state."""
        return f"zeta_{self.target}"

    @property
    def bounded(self) -> sympy.Expr:
        """The state, limited to its admissible range."""
        return bounded(symbol(self.state), 1)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Subtract the force and add the state."""
        changes = super().rewrite(model, p)
        v, zeta = model.port(self.target).flow, self.bounded
        bend = (1 - p["shape"]) * sympy.Abs(v) * zeta + p["shape"] * v * sympy.Abs(zeta)
        changes["equations"][self.state] = (v - bend) / p["deflection"]
        changes["states"] = {**model.states, self.state: ""}
        changes["initial_state"] = {**model.initial_state, self.state: 0.0}
        return changes

    def is_shown(self, model: PhysicsModel, scales: Scales) -> bool:
        """Return whether the motion goes in both directions, as a loop needs."""
        return goes_both_ways(self.target, scales)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a small to a large deflection, of a weak and of a strong force."""
        force = force_scale(target, model, scales)
        travel = scales.typical[model.port(target).position]
        sizes = itertools.product((0.02, 0.2), (0.02, 0.06, 0.2))
        return tuple(cls(target, level * force, share * travel) for level, share in sizes)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the deflection well below the travel and above the motion within one sample.

        A deflection of the size of the travel is a spring, with a new load in every window.
        """
        travel, step = scales.typical[model.port(target).position], scales.sample_time
        least = max(0.002 * travel, step * scales.typical[target])
        return {"deflection": (least, max(0.3 * travel, 2.0 * least))}
