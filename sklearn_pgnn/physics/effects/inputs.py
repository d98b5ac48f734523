"""Effects on an input: the machine receives something other than the command."""

import re
from dataclasses import dataclass
from types import MappingProxyType

import sympy

from sklearn_pgnn.physics.channel_kinds import ACTUATOR
from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.losses import ABSOLUTE
from sklearn_pgnn.physics.effects.targets import free_name
from sklearn_pgnn.physics.expressions import TIME, bounded, maximum, minimum, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales


@dataclass(frozen=True)
class InputEffect(Effect):
    """An input that is replaced by an expression of it, wherever the model uses it."""

    phrase = "{effect} of {target}"
    fault = ACTUATOR

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the inputs of the model."""
        return tuple(model.inputs)

    def seen(self, u: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the input as it acts on the machine."""
        raise NotImplementedError

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Replace the input in every equation."""
        u = symbol(self.target)
        return substitute(model, u, self.seen(u, p))

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the input as it acts on the machine over the commanded one."""
        return Characteristic("input", self.target)

    def is_shown(self, model: PhysicsModel, scales: Scales) -> bool:
        """Return whether the input is ever other than zero, so that more than a bias shows."""
        return not scales.is_zero(self.target)


def substitute(model: PhysicsModel, old: sympy.Expr, new: sympy.Expr) -> dict:
    """Return the changes that replace `old` by `new` in every expression of a model."""
    return model.changed(lambda expression: expression.subs(old, new))


@dataclass(frozen=True)
class InputBias(InputEffect):
    r"""A constant offset of the input, :math:`u + b`.

    Parameters
    ----------
    target : str
        The input.
    bias : float, default=0
        Bias :math:`b` [input].

    Examples
    --------
    >>> InputBias("torque", bias=0.02).names()
    {'bias': 'bu_torque'}
    """

    bias: float = quantity("bu", "{target}")
    id = "input_bias"
    fault = "bias"
    of_reading = (
        "The reading has a constant offset: the zero is set incorrectly.",
        "Compare the reading with a second instrument at one known value.",
    )
    summary = "The actuator output has a constant offset from its command."
    check = "Command zero and measure the actuator output."

    def seen(self, u: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return u + b."""
        return u + p["bias"]

    def is_shown(self, model: PhysicsModel, scales: Scales) -> bool:
        """Return true: a bias shows where the input is zero, too."""
        return True


@dataclass(frozen=True)
class InputGain(InputEffect):
    r"""An actuator with a gain error, :math:`(1 + g)\,u`.

    Parameters
    ----------
    target : str
        The input.
    error : float, default=0
        Relative error :math:`g` of the gain [-].

    Examples
    --------
    >>> InputGain("torque", error=-0.1).names()
    {'error': 'gu_torque'}
    """

    error: float = quantity("gu", "", low=-0.95)
    id = "input_gain"
    fault = "gain"
    of_reading = (
        "The scale of the sensor is off: amplifier gain, shunt, conversion.",
        "Compare the reading with a second instrument at two known values.",
    )
    summary = "The actuator output differs from its command by a constant factor."
    check = (
        "Command two values and compare the difference of the outputs with that of the commands."
    )

    def seen(self, u: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return (1 + g)*u."""
        return (1 + p["error"]) * u


@dataclass(frozen=True)
class InputDeadZone(InputEffect):
    r"""An input with a dead zone.

    .. math:: \max(u - w, 0) + \min(u + w, 0)

    Parameters
    ----------
    target : str
        The input.
    threshold : float, default=0
        Largest magnitude :math:`w` of the input without effect [input].

    Examples
    --------
    >>> InputDeadZone("u", threshold=0.3).names()
    {'threshold': 'w_u'}
    """

    threshold: float = quantity("w", "{target}", low=0.0)
    id = "input_dead_zone"
    summary = (
        "Small commands have no effect: valve overlap, amplifier dead band, play at the drive."
    )
    check = "Raise the command slowly from zero in both directions until something moves."

    def seen(self, u: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the dead zone of u."""
        w = p["threshold"]
        return maximum(u - w, 0) + minimum(u + w, 0)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from small to large fractions of the input."""
        return tuple(cls(target, share * scales.peak[target]) for share in (0.03, 0.15, 0.4))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Let some of the input through."""
        return {"threshold": (0.0, 0.95 * scales.peak[target])}


@dataclass(frozen=True)
class AsymmetricDeadZone(InputEffect):
    r"""An input with a dead zone whose thresholds differ on its two sides.

    .. math:: \max(u - w_+, 0) + \min(u + w_-, 0)

    Parameters
    ----------
    target : str
        The input.
    above, below : float, default=0
        Thresholds :math:`w_+, w_-` of the positive and the negative side [input].

    Examples
    --------
    >>> AsymmetricDeadZone("u", above=0.3, below=0.1).names()
    {'above': 'wp_u', 'below': 'wn_u'}
    """

    above: float = quantity("wp", "{target}", low=0.0)
    below: float = quantity("wn", "{target}", low=0.0)
    id = "asymmetric_dead_zone"
    generalises = (InputDeadZone.id,)
    excludes = (InputDeadZone.id,)
    summary = "Small commands have no effect, over a wider range on one side: a valve off centre."
    check = "Raise the command slowly from zero, once up and once down, until something moves."

    def seen(self, u: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the dead zone of u."""
        return maximum(u - p["above"], 0) + minimum(u + p["below"], 0)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start wider on one side, on the other, or on none."""
        peak = scales.peak[target]
        return tuple(cls(target, a * peak, b * peak) for a, b in ((0.3, 0.03), (0.03, 0.3)))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Let some of the input through."""
        widest = (0.0, 0.95 * scales.peak[target])
        return {"above": widest, "below": widest}


@dataclass(frozen=True)
class InputSaturation(InputEffect):
    r"""An input that saturates at a limit, :math:`\min(\max(u, -L), L)`.

    Parameters
    ----------
    target : str
        The input.
    limit : float, default=1e9
        Limit :math:`L` [input].

    Examples
    --------
    >>> InputSaturation("u", limit=5.0).names()
    {'limit': 'L_u'}
    """

    limit: float = quantity("L", "{target}", default=1e9, low=0.0, role="end")
    id = "input_saturation"
    summary = "The actuator output is limited: current limit, supply pressure."
    check = "Command large steps of growing size: the response stops growing."

    def seen(self, u: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return u clipped at the limit."""
        return minimum(maximum(u, -p["limit"]), p["limit"])

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from light to heavy clipping."""
        return tuple(cls(target, share * scales.peak[target]) for share in (0.95, 0.75, 0.5))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Clip some and pass some of the input; for an input of one sign, pass its least value."""
        (low, high), peak = scales.ends(target), scales.peak[target]
        least = max(low, -high, 0.0)
        return {"limit": (least + 0.02 * (peak - least), peak)}


@dataclass(frozen=True)
class Delay(Effect):
    """A delayed signal, by a delay of at most half a window."""

    phrase = "{effect} of {target}"
    fault = "delay"

    delay: float = quantity("tau", "s", low=0.0)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from one sample to a fifth of a window."""
        shortest, longest = scales.sample_time, 0.2 * scales.window
        delays = sorted({shortest, (shortest * longest) ** 0.5, longest})
        return tuple(cls(target, delay) for delay in delays)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Stay below half a window."""
        return {"delay": (0.0, 0.5 * scales.window)}


@dataclass(frozen=True)
class InputDelay(Delay):
    r"""An input that acts with a delay, :math:`u(t - \tau)`.

    Parameters
    ----------
    target : str
        The input.
    delay : float, default=0
        Delay :math:`\tau` [s].

    Examples
    --------
    >>> InputDelay("u", delay=0.02).names()
    {'delay': 'tau_u'}
    """

    id = "input_delay"
    resembles = MappingProxyType({"actuator_lag": ("delay", "time_constant")})
    of_reading = (
        "The machine meets what is read later: transport from the sensor to the machine, or clocks "
        "that differ.",
        "Change the quantity at once and compare the reading with the machine's first answer.",
    )
    summary = "The command acts after a delay: bus, sampling, transport of material."
    check = "Step the command and measure the time until anything moves at all."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the inputs that have no delay yet."""
        return tuple(name for name in model.inputs if name not in model.delays)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Add the delay to the input."""
        return {"delays": {**model.delays, self.target: str(p["delay"])}}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the input as it acts on the machine over the time."""
        return Characteristic("input", self.target, TIME)


@dataclass(frozen=True)
class ActuatorEffect(Effect):
    """An input that acts on the machine through a state of the actuator."""

    phrase = "{effect} of {target}"
    fault = ACTUATOR
    #: suffix to the input's name in the name of the state
    ending = ""

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the inputs whose actuator has no such state yet."""
        return tuple(name for name in model.inputs if cls.state_of(name, model) is None)

    @classmethod
    def state_of(cls, name: str, model: PhysicsModel) -> str | None:
        """Return the actuator's own state that the effect has given an input, if any."""
        named = re.compile(re.escape(name + cls.ending) + r"(_\d+)?")
        followers = (state for state, followed in model.settled.items() if followed == name)
        return next((state for state in followers if named.fullmatch(state)), None)

    def rate(self, u: sympy.Expr, acting: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the rate of the acting input, from the commanded one."""
        raise NotImplementedError

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the input as it acts on the machine over the time."""
        return Characteristic("input", self.target, TIME)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Add the actuator's state and use it in the equations."""
        u, acting = symbol(self.target), symbol(free_name(model, self.target + self.ending))
        changes = substitute(model, u, acting)
        changes["equations"][str(acting)] = self.rate(u, acting, p)
        changes["states"] = {**model.states, str(acting): model.inputs[self.target]}
        changes["settled"] = {**model.settled, str(acting): self.target}
        return changes


@dataclass(frozen=True)
class Lag(Effect):
    """A signal that follows with a first-order lag, as records can show it."""

    time_constant: float = 1.0

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a few samples to a third of a window."""
        shortest, longest = 3 * scales.sample_time, 0.3 * scales.window
        return tuple(cls(target, value) for value in sorted({shortest, max(shortest, longest)}))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Stay between what one sample and what two windows can show."""
        return {"time_constant": (0.5 * scales.sample_time, 2.0 * scales.window)}


@dataclass(frozen=True)
class ActuatorLag(Lag, ActuatorEffect):
    r"""An actuator that follows its command with a first-order lag.

    .. math:: T\,\dot u_a = u - u_a

    Parameters
    ----------
    target : str
        The input.
    time_constant : float, default=1
        Time constant :math:`T` [s].

    Examples
    --------
    >>> ActuatorLag("u", time_constant=0.05).names()
    {'time_constant': 'T_u'}
    """

    time_constant: float = quantity("T", "s", default=1.0, low=1e-9)
    id = "actuator_lag"
    summary = "The actuator needs time to build up: motor current, valve, pressure, heater."
    check = (
        "Step the command and measure the actuator output itself: a sensor filter has nearly the "
        "same effect."
    )
    ending = "_lagged"

    def rate(self, u: sympy.Expr, acting: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the rate of the lag."""
        return (u - acting) / p["time_constant"]


@dataclass(frozen=True)
class InputRateLimit(ActuatorEffect):
    r"""An actuator with a limited slew rate: it follows its command no faster than a limit.

    .. math:: \dot u_a = \max(\min((u - u_a)/T, R), -R)

    Parameters
    ----------
    target : str
        The input.
    limit : float, default=1e9
        Largest rate :math:`R` [input per second].
    time_constant : float, default=1
        Time constant :math:`T` [s] for small changes; a diagnosis keeps it at a sample or two,
        because a noticeable one is an `ActuatorLag`.

    Examples
    --------
    >>> InputRateLimit("u", limit=5.0, time_constant=0.01).names()
    {'limit': 'Ru_u', 'time_constant': 'Tr_u'}
    """

    limit: float = quantity("Ru", "{target}/s", default=1e9, low=0.0, role="end")
    time_constant: float = quantity("Tr", "s", default=1.0, low=1e-9, role="shape")
    id = "input_rate_limit"
    summary = "The actuator cannot change faster than a limit: a slewing valve, a ramp in a drive."
    check = "Command a large and a small step: the larger one takes longer in proportion."
    generalises = ("actuator_lag",)
    ending = "_slewed"

    def rate(self, u: sympy.Expr, acting: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the rate of the lag, bounded."""
        return bounded((u - acting) / p["time_constant"], p["limit"])

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a fast to a slow actuator that follows small changes at once."""
        quick = scales.sample_time
        slews = (max(share * scales.window, quick) for share in (0.05, 0.2, 1.0, 5.0))
        return tuple(cls(target, scales.peak[target] / slew, quick) for slew in slews)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Bound the command, at most a step between its extremes; follow it within samples."""
        peak, quickest = scales.peak[target], 0.5 * scales.sample_time
        return {
            "limit": (0.02 * peak / scales.window, 2.0 * peak / quickest),
            "time_constant": (quickest, 4.0 * quickest),
        }


@dataclass(frozen=True)
class InputBacklash(ActuatorEffect):
    r"""Backlash (play) between the command and the machine.

    .. math:: T\,\dot u_a = \max(u - u_a - w/2, 0) + \min(u - u_a + w/2, 0)

    The width is the whole gap, as makers of gears state it: the way that the command travels after
    a reversal, from one flank to the other, before the machine follows.

    Parameters
    ----------
    target : str
        The input.
    width : float, default=0
        Width :math:`w` of the play, from flank to flank [input].
    time_constant : float, default=1
        Time constant :math:`T` [s] of the contact; a diagnosis keeps it at a sample or two.

    Examples
    --------
    >>> InputBacklash("u", width=0.2, time_constant=0.01).names()
    {'width': 'wb_u', 'time_constant': 'Tb_u'}
    """

    width: float = quantity("wb", "{target}", low=0.0)
    time_constant: float = quantity("Tb", "s", default=1.0, low=1e-9, role="shape")
    id = "input_backlash"
    summary = (
        "Play: after a reversal the command must travel through it before the machine follows."
    )
    check = "Reverse the command slowly: nothing moves until it has travelled the width."
    generalises = ("actuator_lag",)
    ending = "_engaged"

    def rate(self, u: sympy.Expr, acting: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the rate in contact, zero within the play."""
        gap, side = u - acting, p["width"] / 2
        return (maximum(gap - side, 0) + minimum(gap + side, 0)) / p["time_constant"]

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a small to a wide play in stiff contact."""
        quick = scales.sample_time
        return tuple(cls(target, share * scales.peak[target], quick) for share in (0.06, 0.3, 0.8))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the play narrower than the command's travel, and the contact stiff."""
        step = scales.sample_time
        return {
            "width": (0.0, 1.9 * scales.peak[target]),
            "time_constant": (0.5 * step, 2.0 * step),
        }


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
