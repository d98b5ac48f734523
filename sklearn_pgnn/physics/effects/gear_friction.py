"""Dry friction of loaded gears: by the direction of the power, and with a peak at rest."""

import itertools
from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.friction import LOAD, CoulombFriction, LoadFriction
from sklearn_pgnn.physics.effects.friction import StribeckFriction as Stribeck
from sklearn_pgnn.physics.effects.rates import force_scale
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales


@dataclass(frozen=True)
class GearLoss(LoadFriction):
    r"""Dry friction that grows with the load, by the direction in which the power flows.

    .. math::
        F = (F_c + \mu_+\,|F_d|)\,\mathrm{sign}(v) \;(F_d v > 0), \qquad
        F = (F_c + \mu_-\,|F_d|)\,\mathrm{sign}(v) \;(F_d v < 0)

    A gear that is driven has the efficiency :math:`1 - \mu_+`; driven back by its load it has
    another, and none with :math:`\mu_- \ge 1`, where it locks itself. For the load :math:`F_d` see
    `LoadFriction`.

    Parameters
    ----------
    target : str
        The velocity.
    level : float, default=0
        Friction level :math:`F_c` without load [force].
    share : float, default=0
        Fraction :math:`\mu_+` of the load that is lost as it is driven.
    backward : float, default=0
        Fraction :math:`\mu_-` of the load that is lost as it drives back.

    References
    ----------
    .. [1] A. Wang, S. Kim, "Directional efficiency in geared transmissions: characterization of
       backdrivability towards improved proprioceptive control", IEEE International Conference on
       Robotics and Automation, 2015.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "F/m"}, {"m": 2.0}, {"F": "N"}, inertia={"v": "m"})
    >>> print((cart + GearLoss("v", level=0.5, share=0.1, backward=0.4)).to_text())
    v' = (-F*(-mub_v/2 + mud_v/2) + F - (Fl_v + (mub_v/2 + mud_v/2)*abs(F))*sign(v))/m
    """

    share: float = quantity("mud", "", low=0.0, high=1.0)
    backward: float = quantity("mub", "", low=0.0)
    id = "gear_loss"
    generalises = (CoulombFriction.id, LoadFriction.id)
    excludes = (CoulombFriction.id, LoadFriction.id, "load_stribeck_friction")
    summary = "A gear that loses more as it is driven back than as it drives, or less."
    check = "Lift and lower a weight at one speed: the losses differ by more than the friction."

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the mean loss, and the half of the difference that depends on the direction."""
        mean, half = (p["share"] + p["backward"]) / 2, (p["share"] - p["backward"]) / 2
        return (p["level"] + mean * sympy.Abs(LOAD)) * sympy.sign(v) + half * LOAD

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with a larger loss in one direction of the power, or in the other."""
        level = 0.02 * force_scale(target, model, scales)
        return (cls(target, level, 0.05, 0.3), cls(target, level, 0.3, 0.05))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the driven load above zero, and the losses of a size."""
        return {"share": (0.0, 0.95), "backward": (0.0, 3.0)}


@dataclass(frozen=True)
class LoadStribeckFriction(LoadFriction):
    r"""Dry friction with a peak at rest, all of which grows with the transmitted load.

    .. math::
        F = (F_c + \mu\,|F_d|)\left(1 + \rho\,e^{-(v/v_s)^2}\right)\mathrm{sign}(v)

    For the load :math:`F_d` see `LoadFriction`.

    Parameters
    ----------
    target : str
        The velocity.
    level : float, default=0
        Sliding friction :math:`F_c` without load [force].
    share : float, default=0
        Fraction :math:`\mu` of the load that is lost in sliding.
    peak : float, default=0
        Static over sliding friction, less one, :math:`\rho`.
    velocity : float, default=1
        Stribeck velocity :math:`v_s`, over which the peak fades.

    References
    ----------
    .. [1] A. C. Bittencourt, S. Gunnarsson, "Static friction in a robot joint: modeling and
       identification of load and temperature effects", Journal of Dynamic Systems, Measurement,
       and Control 134(5), 2012, :doi:`10.1115/1.4006589`.

    Examples
    --------
    >>> LoadStribeckFriction("w", 0.05, share=0.1, peak=0.4, velocity=0.1).names()
    {'level': 'Fl_w', 'share': 'mul_w', 'peak': 'rl_w', 'velocity': 'vl_w'}
    """

    peak: float = quantity("rl", "", low=0.0)
    velocity: float = quantity("vl", "{velocity}", default=1.0, low=0.0, role="shape")
    id = "load_stribeck_friction"
    phrase = "Stribeck friction with load on {target}"
    generalises = (CoulombFriction.id, LoadFriction.id, Stribeck.id)
    excludes = (CoulombFriction.id, LoadFriction.id, Stribeck.id, "gear_loss")
    summary = "Dry friction that grows with the load and is higher at rest: a loaded, slow gear."
    check = "Drive at constant low speeds with two weights: the peak at rest grows with the weight."

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the Stribeck curve in proportion to the load."""
        fading = sympy.exp(-((v / p["velocity"]) ** 2))
        return super().force(v, position, p) * (1 + p["peak"] * fading)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with a narrow and with a wide peak."""
        force, v = force_scale(target, model, scales), scales.typical[target]
        parts = itertools.product((0.1,), (0.1, 0.5))
        return tuple(cls(target, 0.02 * force, mu, 0.5, at * v) for mu, at in parts)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the load above zero; for the peak see `StribeckFriction`."""
        widths = Stribeck.limits(target, model, scales)
        return {**super().limits(target, model, scales), **widths, "peak": (0.0, 10.0)}
