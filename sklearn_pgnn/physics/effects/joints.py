"""Joints that give: an elastic shaft, and play between two inertias."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.friction import driving_force
from sklearn_pgnn.physics.effects.rates import PositionEffect
from sklearn_pgnn.physics.expressions import bounded, maximum, minimum, symbol
from sklearn_pgnn.physics.found_ports import column
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales, typical_inertia

#: share of the inertia behind a joint at which a fit begins
USUAL = 0.3
#: damping of a joint at which a fit begins, over that of the aperiodic limit
DAMPED = 0.05
#: frequencies at which a fit begins where no line stands out
LINES = 3


@dataclass(frozen=True)
class ElasticJoint(PositionEffect):
    r"""A part of the inertia behind an elastic joint: motor and load are two.

    .. math::
        T = k\,\varphi + d\,\dot\varphi, \qquad \dot\varphi = v - v_l, \qquad
        (1 - \lambda)\,m\,\dot v = F - T, \qquad \lambda\,m\,\dot v_l = T

    The forces :math:`F` of the model, and its sensors, stay at the side of :math:`v`; the load has
    the velocity :math:`v_l`.

    Parameters
    ----------
    target : str
        The velocity.
    share : float, default=0.3
        Share :math:`\lambda` of the inertia that is behind the joint.
    stiffness : float, default=1e9
        Stiffness :math:`k` of the joint [force per position]; a stiff one moves as one.
    damping : float, default=0
        Its damping :math:`d` [force per velocity].

    References
    ----------
    .. [1] M. W. Spong, "Modeling and control of elastic joint robots", Journal of Dynamic Systems,
       Measurement, and Control 109(4), 1987, :doi:`10.1115/1.3143860`.

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> two = cart_on_spring() + ElasticJoint("v", share=0.25, stiffness=900.0, damping=1.0)
    >>> list(two.states)
    ['x', 'v', 'twist_v', 'load_v']
    """

    share: float = quantity("lj", "", default=USUAL, low=0.0, high=0.99, role="shape")
    stiffness: float = quantity("kj", "{force}/({position})", default=1e9, low=0.0, role="end")
    damping: float = quantity("dj", "{force}/({velocity})", low=0.0, role="shape")
    id = "elastic_joint"
    phrase = "elastic joint behind {target}"
    lacking = "lacks an"
    summary = "A shaft, belt or gear that gives: a part of the inertia swings behind the rest."
    check = "Hold the load and turn the motor, or knock at the load: it gives, and rings."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the driven velocities with an inertia of their own and a position."""
        ports = ((name, model.port(name)) for name in super().targets(model))
        alone = (name for name, p in ports if set(p.rates) == {name} and name in model.inertia)
        return tuple(name for name in alone if driving_force(model, name) != 0)

    @property
    def states_of(self) -> tuple[str, str]:
        """The names of the added states: the twist of the joint, and the load's velocity."""
        return f"twist_{self.target}", f"load_{self.target}"

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the effort in the joint."""
        return p["stiffness"] * self._deflection(p) + p["damping"] * (v - symbol(self.states_of[1]))

    def _deflection(self, p: Symbols) -> sympy.Expr:
        """Return the deflection of the joint's spring."""
        return symbol(self.states_of[0])

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Divide the inertia, and add the twist and the load's velocity."""
        v, (twist, load) = symbol(self.target), self.states_of
        port, slip = model.port(self.target), v - symbol(load)
        torque = self.effort(model)
        rates, inertia = dict(model.equations), model.inertia[self.target]
        rates[self.target] = port.act(model, torque)["equations"][self.target] / (1 - p["share"])
        rates |= {twist: slip, load: torque * port.mobility / p["share"]}
        change = (rates[self.target] - model.equations[self.target]) / port.mobility
        shown = {name: model.outputs[name] + c * change for name, c in port.outputs.items()}
        rest = model.initial_state[self.target]
        units = {twist: model.unit_of(port.displacement), load: model.unit(self.target)}
        parts = {self.target: (1 - p["share"]) * inertia, load: p["share"] * inertia}
        return {
            "equations": rates,
            "outputs": {**model.outputs, **shown},
            "states": {**model.states, **units},
            "initial_state": {**model.initial_state, twist: 0.0, load: rest},
            "inertia": {**model.inertia, **parts},
            "energy": self._energy(model, p, slip),
        }

    def _energy(self, model: PhysicsModel, p: Symbols, slip: sympy.Expr) -> dict:
        """Return a model's energy with that of the load, of the spring, and of the damper."""
        if not model.energy:
            return {}
        v, load = symbol(self.target), symbol(self.states_of[1])
        moved = p["share"] * model.inertia[self.target] * (load**2 - v**2) / 2
        added = {
            "stored": moved + p["stiffness"] * self._deflection(p) ** 2 / 2,
            "dissipated": p["damping"] * slip**2,
        }
        return {
            **model.energy,
            **{part: model.energy.get(part, 0) + e for part, e in added.items()},
        }

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return no curve: the effort depends on two states that are not measured."""
        return None

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start at the lines that stand out in what is missing, or between window and sample."""
        inertia = typical_inertia(target, model, scales) * USUAL * (1 - USUAL)
        rates = [2 * math.pi * line for line in _lines(target, scales)]
        return tuple(cls(target, USUAL, *_spring(inertia, rate)) for rate in rates)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the vibration within what a window and what the samples show."""
        inertia = typical_inertia(target, model, scales)
        slow, fast = (2 * math.pi * line for line in _band(scales))
        return {
            "share": (0.01, 0.95),
            "stiffness": (0.01 * inertia * slow**2, 0.25 * inertia * fast**2),
            "damping": (0.0, inertia * fast),
        }


def _band(scales: Scales) -> tuple[float, float]:
    """Return the frequencies that windows and samples show [Hz]."""
    fast = 0.25 / scales.sample_time
    return min(1.0 / scales.window, 0.1 * fast), fast


def _lines(target: str, scales: Scales) -> tuple[float, ...]:
    """Return the frequencies at which a joint may vibrate [Hz]."""
    slow, fast = _band(scales)
    ratio = (0.5 * fast / (2 * slow)) ** (1 / (LINES - 1))
    found = [line for line in scales.tones.get(target, ()) if slow < line < fast]
    return (*found, *(2 * slow * ratio**step for step in range(LINES)))


def _spring(inertia: float, rate: float) -> tuple[float, float]:
    """Return stiffness and damping of a vibration."""
    return inertia * rate**2, 2 * DAMPED * inertia * rate


@dataclass(frozen=True)
class JointPlay(ElasticJoint):
    r"""A part of the inertia behind a gear with play: an elastic joint with a gap.

    .. math:: T = k\,\bigl(\max(\varphi - w/2, 0) + \min(\varphi + w/2, 0)\bigr) + d\,\dot\varphi

    Parameters
    ----------
    target : str
        The velocity.
    share : float, default=0.3
        Share :math:`\lambda` of the inertia that is behind the gear.
    stiffness : float, default=1e9
        Stiffness :math:`k` of the teeth in contact [force per position].
    damping : float, default=0
        Damping :math:`d` [force per velocity], also within the gap: oil between the teeth.
    width : float, default=0
        The whole gap :math:`w`, from flank to flank [position].

    References
    ----------
    .. [1] M. Nordin, P.-O. Gutman, "Controlling mechanical systems with backlash: a survey",
       Automatica 38(10), 2002, :doi:`10.1016/S0005-1098(02)00047-X`.

    Examples
    --------
    >>> JointPlay("w", 0.3, stiffness=900.0, width=0.02).names()
    {'share': 'lj_w', 'stiffness': 'kj_w', 'damping': 'dj_w', 'width': 'wj_w'}
    """

    width: float = quantity("wj", "{position}", low=0.0)
    id = "joint_play"
    phrase = "play behind {target}"
    lacking = "lacks the"
    generalises = (ElasticJoint.id,)
    excludes = (ElasticJoint.id,)
    summary = "A gear or coupling with play: after a reversal the load follows only beyond the gap."
    check = "Hold the load and turn the motor to and fro by hand: it moves freely by the gap."

    def _deflection(self, p: Symbols) -> sympy.Expr:
        """Return the deflection of the flanks in contact."""
        twist, side = symbol(self.states_of[0]), p["width"] / 2
        return maximum(twist - side, 0) + minimum(twist + side, 0)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with a narrow and with a wide gap in soft and in stiff contact."""
        travel = scales.typical[model.port(target).position]
        inertia = typical_inertia(target, model, scales) * USUAL * (1 - USUAL)
        springs = [_spring(inertia, 2 * math.pi * line) for line in _lines(target, scales)[-2:]]
        parts = itertools.product(springs, (0.03, 0.2))
        return tuple(cls(target, USUAL, *spring, gap * travel) for spring, gap in parts)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the gap within the travel."""
        travel = 2 * scales.peak[model.port(target).position]
        return {**super().limits(target, model, scales), "width": (0.0, travel)}


@dataclass(frozen=True)
class SpringPlay(Effect):
    r"""Play in a spring or shaft between two inertias.

    .. math:: k\,\varphi \;\to\; k\,\bigl(\max(\varphi - w/2, 0) + \min(\varphi + w/2, 0)\bigr)

    Parameters
    ----------
    target : str
        The stiffness :math:`k`, a parameter that multiplies a difference of positions
        :math:`\varphi`.
    width : float, default=0
        The whole gap :math:`w`, from flank to flank [position].

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> rates = {"a": "v", "b": "w", "v": "(u - k*(a - b))/m", "w": "k*(a - b)/n"}
    >>> units = {"a": "rad", "b": "rad", "v": "rad/s", "w": "rad/s"}
    >>> shaft = PhysicsModel(units, rates, {"k": 50.0, "m": 1.0, "n": 2.0}, {"u": "N m"})
    >>> SpringPlay.targets(shaft)
    ('k',)
    >>> print((shaft + SpringPlay("k", width=0.02)).equations["w"])
    k*(a - b)/n - k*Max(-wp_k/2, Min(wp_k/2, a - b))/n
    """

    width: float = quantity("wp", "{position}", low=0.0)
    id = "spring_play"
    phrase = "play in {target}"
    lacking = "lacks the"
    summary = "A gear or coupling between two inertias has play: within the gap no force passes."
    check = "Hold one side and move the other to and fro by hand: it moves freely by the gap."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the stiffnesses between two positions."""
        return tuple(name for name in model.parameters if _stretch(model, name) is not None)

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return the unit of the positions."""
        stretch = _stretch(model, self.target)
        return {"position": "" if stretch is None else model.unit_of(stretch)}

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Take what the gap gives out of the stretch, in every rate and output."""
        k, stretch = symbol(self.target), _stretch(model, self.target)
        given = k * bounded(stretch, p["width"] / 2)

        def less(expressions: Mapping[str, sympy.Expr]) -> dict[str, sympy.Expr]:
            shares = {name: sympy.cancel(e.diff(k) / stretch) for name, e in expressions.items()}
            return {name: e - shares[name] * given for name, e in expressions.items()}

        return {"equations": less(model.equations), "outputs": less(model.outputs)}

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a narrow to a wide gap."""
        reach = _reach(target, model, scales)
        return tuple(cls(target, share * reach) for share in (0.3, 2.0, 10.0))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the gap within many times the usual stretch."""
        return {"width": (0.0, 200.0 * _reach(target, model, scales))}

    @classmethod
    def typical(cls, target: str, model: PhysicsModel, scales: Scales) -> dict[str, float]:
        """Return the usual stretch."""
        return {"position": _reach(target, model, scales)}


def _stretch(model: PhysicsModel, parameter: str) -> sympy.Expr | None:
    """Return the difference of positions that a parameter multiplies in all rates with it."""
    places = {symbol(q) for q in model.kinematic_pairs.values()}
    slopes = column(model, parameter).values()
    found = {None if s.has(symbol(parameter)) else _along(s, places) for s in slopes}
    return found.pop() if len(found) == 1 else None


def _along(slope: sympy.Expr, places: set[sympy.Symbol]) -> sympy.Expr | None:
    """Return a slope over its factor of the first position, if it is a difference of positions."""
    held = sorted(slope.free_symbols & places, key=str)
    if len(held) < 2:
        return None
    first = slope.diff(held[0])
    stretch = sympy.expand(sympy.cancel(slope / first)) if first != 0 else slope
    linear = all(not stretch.diff(q).free_symbols & places for q in held)
    return stretch if linear and not stretch.subs(dict.fromkeys(held, 0)) else None


def _reach(target: str, model: PhysicsModel, scales: Scales) -> float:
    """Return the stretch that causes the usual rate, by the inertia that moves least."""
    stretch = _stretch(model, target)
    known = {symbol(n): p.value for n, p in model.parameters.items()}
    known |= {symbol(n): value for n, value in scales.typical.items()}
    gains = {s: sympy.cancel(a / stretch) for s, a in column(model, target).items()}
    pulls = {s: abs(float((symbol(target) * g).subs(known))) for s, g in gains.items()}
    return min(scales.rate[state] / pull for state, pull in pulls.items() if pull)
