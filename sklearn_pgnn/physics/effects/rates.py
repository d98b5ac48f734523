"""Effects on the rate of a velocity: their common base, and external forces."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.channel_kinds import is_measured
from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.found_ports import is_velocity
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port
from sklearn_pgnn.physics.scales import Scales, typical_inertia

#: units of a sensor's signal, which do not define what the sensor measures
SIGNAL_UNITS = frozenset({"", "1", "-", "%", "V", "mV"})

#: start amplitude of a wave per typical force: small, so that a linear model shows its benefit
FAINT = 0.001


def may_be_speed(model: PhysicsModel, state: str) -> bool:
    """Return whether a state may be a speed that is not declared as one.

    A sensor measures it in a unit that does not define the quantity, and its rate depends on
    itself, though not through a root, as that of a level does.

    >>> from sklearn_pgnn import PhysicsModel
    >>> hoop = PhysicsModel({"y": "V"}, {"y": "(K*u - y)/T"}, {"K": 11.6, "T": 1.6}, {"u": ""})
    >>> may_be_speed(hoop, "y")
    True
    """
    x, rate = symbol(state), model.equations[state]
    roots = any(p.base.has(x) and not p.exp.is_integer for p in rate.atoms(sympy.Pow))
    shown = any(output.has(x) for output in model.outputs.values())
    signal = model.states[state].strip() in SIGNAL_UNITS
    return (
        signal
        and shown
        and rate.has(x)
        and not roots
        and state not in model.kinematic_pairs.values()
    )


@dataclass(frozen=True)
class RateEffect(Effect):
    """A force at a port (or, without an inertia, a deceleration) that resists its flow."""

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the ports of the model whose flow is a velocity."""
        return tuple(name for name, port in model.ports.items() if is_moving(model, port))

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the resisting force as an expression of velocity and position."""
        raise NotImplementedError

    def effort(self, model: PhysicsModel) -> sympy.Expr:
        """Return the resisting force at the port of a model, with the names of its parameters."""
        port, p = model.port(self.target), {k: symbol(name) for k, name in self.names().items()}
        return self.force(port.flow, port.displacement, p)

    def potential(self, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the energy the force stores, zero for a dissipative one."""
        return sympy.Integer(0)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Let the force act at the port, against its flow."""
        port = model.port(self.target)
        changes = port.act(model, self.effort(model))
        if model.energy and port.is_power(model):
            potential = self.potential(port.displacement, p)
            if potential != 0:
                stored = model.energy.get("stored", 0) + potential
                changes["energy"] = {**model.energy, "stored": stored}
        return changes

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the force over the velocity."""
        return Characteristic("force", self.target, model.port(self.target).flow)

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return the units of force, velocity and position at the target."""
        port = model.port(self.target)
        return {
            "force": port.unit,
            "velocity": model.unit_of(port.flow),
            "position": model.unit_of(port.displacement),
        }


def is_moving(model: PhysicsModel, port: Port) -> bool:
    """Return whether the flow of a port is a velocity, or a difference of velocities."""
    states = map(str, port.flow.free_symbols)
    return all(is_velocity(model, state) for state in states if state in model.states)


def worded_for(model: PhysicsModel, effect: Effect) -> tuple[str, str]:
    """Return an effect's summary and check: of a torque where it turns, of an input's reading."""
    told = effect.of_reading if is_measured(model, effect.target) else ()
    summary, check = told or (effect.summary, effect.check)
    if effect.target in model.ports and model.port(effect.target).unit.endswith("N m"):
        return _of_torque(summary), _of_torque(check)
    return summary, check


def _of_torque(text: str) -> str:
    return text.replace("force", "torque").replace("Force", "Torque")


@dataclass(frozen=True)
class PositionEffect(RateEffect):
    """A force that depends on the position, so the port must have one."""

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the ports with a displacement."""
        ports = model.ports.items()
        return tuple(n for n, p in ports if p.displacement is not None and is_moving(model, p))

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the force over the position."""
        return Characteristic("force", self.target, model.port(self.target).displacement)


def force_scale(target: str, model: PhysicsModel, scales: Scales) -> float:
    """Return the force that causes the typical rate of the target."""
    return typical_inertia(target, model, scales) * scales.rate[target]


@dataclass(frozen=True)
class ConstantLoad(RateEffect):
    r"""A constant force, :math:`F = F_0`.

    Parameters
    ----------
    target : str
        The velocity.
    load : float, default=0
        Load :math:`F_0` [force]; a positive load acts in the negative direction.

    Examples
    --------
    >>> ConstantLoad("v", load=3.0).names()
    {'load': 'F0_v'}
    """

    load: float = quantity("F0", "{force}")
    id = "constant_load"
    summary = (
        "A force of constant size and direction: weight, a tilted axis, a tensioned cable. Beside "
        "dry friction, also what this differs by in the two directions."
    )
    check = "Release the unpowered machine: it drifts to one side, or needs force to stay."

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return F0."""
        return p["load"]


@dataclass(frozen=True)
class PeriodicDisturbance(RateEffect):
    r"""A force that is periodic in time, :math:`F = A\sin(2\pi f t) + B\cos(2\pi f t)`.

    Parameters
    ----------
    target : str
        The velocity.
    sine, cosine : float, default=0
        Amplitudes :math:`A, B` [force], over the time of the record.
    frequency : float, default=1
        Frequency :math:`f` [Hz].

    Examples
    --------
    >>> PeriodicDisturbance("v", sine=0.3, frequency=4.0).names()
    {'sine': 'Ds_v', 'cosine': 'Dc_v', 'frequency': 'f_v'}
    """

    sine: float = quantity("Ds", "{force}")
    cosine: float = quantity("Dc", "{force}")
    frequency: float = quantity("f", "Hz", default=1.0, low=0.0, role="shape")
    id = "periodic_disturbance"
    summary = "A force that repeats in time whatever the machine does: a fan, a pump, the mains."
    check = "Hold the machine still and look for a line in the spectrum of the force or position."

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the wave."""
        angle = 2 * sympy.pi * p["frequency"] * TIME
        return p["sine"] * sympy.sin(angle) + p["cosine"] * sympy.cos(angle)

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the force over the time within a period."""
        return Characteristic("force", self.target, TIME, 1 / symbol(self.names()["frequency"]))

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with small amplitudes at prominent frequencies, or at one period per window."""
        force = FAINT * force_scale(target, model, scales)
        lines = scales.tones.get(target) or (1.0 / scales.window,)
        return tuple(cls(target, force, force, line) for line in lines)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep a period within the longest record, and stay below half the sampling rate."""
        return {"frequency": (1.0 / scales.duration, 0.5 / scales.sample_time)}
