"""Inputs that act by a curve: a power, or straight pieces whose slopes have one sign."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.inputs import InputDeadZone, InputEffect, InputSaturation
from sklearn_pgnn.physics.effects.losses import ABSOLUTE
from sklearn_pgnn.physics.extremes import bounded, maximum
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales

#: share of the input at which the model is right below which a power is that of the share
SMALL = sympy.Rational(1, 10**6)


@dataclass(frozen=True)
class CurvedInput(InputEffect):
    """An input that acts by a curve through zero: no temperature of surroundings."""

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the inputs that are no temperatures."""
        return tuple(name for name, unit in model.inputs.items() if unit.strip() not in ABSOLUTE)


@dataclass(frozen=True)
class InputPower(CurvedInput):
    r"""An input that acts with a power of it, :math:`u\,|u/U|^{m}`.

    Parameters
    ----------
    target : str
        The input.
    power : float, default=0
        The power :math:`m` beyond proportion [-]: -1/2 for a root, 1 for a square.
    reference : float, default=1
        The input :math:`U` at which it acts as the model says [input].

    Examples
    --------
    >>> InputPower("u", power=0.5, reference=10.0).names()
    {'power': 'pw_u', 'reference': 'pr_u'}
    """

    power: float = quantity("pw", "", low=-0.95, high=5.0)
    reference: float = quantity("pr", "{target}", default=1.0, low=1e-12, role="shape")
    id = "input_power"
    summary = (
        "The input acts with a power of it, 1 + power: a fan, a lamp, a valve, a photo resistor."
    )
    check = (
        "Hold several values of the input: the logarithm of its effect over that of it is a line "
        "of slope 1 + power."
    )

    def seen(self, u: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return u*|u/U|^m; the power stays finite at zero."""
        return u * maximum(sympy.Abs(u) / p["reference"], SMALL) ** p["power"]

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a root and from a square, right at half of the largest input."""
        usual = 0.5 * (scales.peak[target] or 1.0)
        return tuple(cls(target, power, usual) for power in (-0.3, 0.3))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the power finite, and the model right within a decade of the largest input."""
        peak = scales.peak[target] or 1.0
        return {"power": (-0.9, 3.0), "reference": (1e-3 * peak, 1e3 * peak)}


@dataclass(frozen=True)
class InputCurve(CurvedInput):
    r"""An input that acts by a curve of three straight pieces that never falls.

    .. math:: u + g_1\,\bar u(c_1) + g_3\,(u - \bar u(c_2)), \qquad
              \bar u(c) = \min(\max(u, -c), c)

    Its slope is :math:`1 + g_1 \geq 0` up to :math:`c_1`, one up to :math:`c_2`, and
    :math:`1 + g_3 \geq 0` beyond: as a table of a valve, a pump or an amplifier.

    Parameters
    ----------
    target : str
        The input.
    below, above : float, default=0
        Relative changes :math:`g_1, g_3` of the slope of the first and of the last piece [-].
    first, second : float, default=0, 1e9
        Magnitudes :math:`c_1 < c_2` at which the slope changes [input].

    Examples
    --------
    >>> InputCurve("u", below=-0.8, above=-0.5, first=1.0, second=4.0).names()
    {'below': 'g1_u', 'above': 'g3_u', 'first': 'c1_u', 'second': 'c2_u'}
    """

    below: float = quantity("g1", "", low=-1.0)
    above: float = quantity("g3", "", low=-1.0)
    first: float = quantity("c1", "{target}", low=0.0, role="shape")
    second: float = quantity("c2", "{target}", default=1e9, low=0.0, role="shape")
    id = "input_curve"
    generalises = (InputDeadZone.id, InputSaturation.id)
    excludes = (InputDeadZone.id, InputSaturation.id)
    summary = "The input acts by a curve: weak at first, or levelling off, as a valve or a pump."
    check = "Hold several values of the input, and plot its effect over them."

    def seen(self, u: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the curve."""
        low, high = bounded(u, p["first"]), bounded(u, p["second"])
        return u + p["below"] * low + p["above"] * (u - high)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a curve that is weak at first, and from one that levels off."""
        peak = scales.peak[target] or 1.0
        bends = ((-0.5, 0.0), (0.0, -0.5), (-0.5, -0.5))
        return tuple(cls(target, a, b, 0.25 * peak, 0.65 * peak) for a, b in bends)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep every piece of the curve within the input's range."""
        peak = scales.peak[target] or 1.0
        slopes = (-0.98, 10.0)
        return {
            "below": slopes,
            "above": slopes,
            "first": (0.02 * peak, 0.45 * peak),
            "second": (0.5 * peak, 0.95 * peak),
        }
