"""A joint of a robot: its names, its parameters, what resists its motion, and what drives it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.port import Port

#: letters of velocity and effort, and their units, at a hinge and at a slide
HINGE = {"w": "w", "e": "tau", "x": "rad", "effort": "N m"}
SLIDE = {"w": "v", "e": "F", "x": "m", "effort": "N"}
#: what resists a joint, in the words of MJCF: its unit, and its force over stretch and velocity
RESISTS = {
    "damping": ("{effort}/({x}/s)", lambda q, w: w),
    "drag": ("{effort}/({x}/s)^2", lambda q, w: w * sympy.Abs(w)),
    "cubic_drag": ("{effort}/({x}/s)^3", lambda q, w: w**3),
    "friction": ("{effort}", lambda q, w: sympy.sign(w)),
    "stiffness": ("{effort}/{x}", lambda q, w: q),
    "quadratic_stiffness": ("{effort}/{x}^2", lambda q, w: q**2),
    "cubic_stiffness": ("{effort}/{x}^3", lambda q, w: q**3),
}
ARMATURE = "{effort}/({x}/s^2)"


@dataclass(frozen=True)
class Joint:
    """A joint with one coordinate, what it resists with, and where its spring is at rest."""

    name: str
    slides: bool
    resists: Mapping[str, float]
    armature: float | None
    rest: float

    @cached_property
    def kind(self) -> Mapping[str, str]:
        """Its letters and units."""
        return SLIDE if self.slides else HINGE

    @property
    def q(self) -> sympy.Symbol:
        """Its position."""
        return symbol(f"q_{self.name}")

    @property
    def w(self) -> sympy.Symbol:
        """Its velocity."""
        return symbol(f"{self.kind['w']}_{self.name}")

    @property
    def effort(self) -> sympy.Symbol:
        """Its torque or force."""
        return symbol(f"{self.kind['e']}_{self.name}")

    def unit(self, template: str) -> str:
        """Return a unit of angles or lengths."""
        return template.format(**self.kind)

    def symbol(self, word: str) -> sympy.Symbol:
        """Return one of its parameters."""
        return symbol(f"{word}_{self.name}")

    @property
    def parameters(self) -> dict[str, dict]:
        """What the file says of it, as parameters that may be fitted."""
        units = {word: unit for word, (unit, _) in RESISTS.items()} | {"armature": ARMATURE}
        values = {word: value for word, value in self.resists.items() if value}
        if self.armature is not None:
            values["armature"] = self.armature
        return {
            f"{word}_{self.name}": {
                "value": value,
                "unit": self.unit(units[word]),
                "bounds": (-np.inf if "quadratic" in word else 0.0, np.inf),
            }
            for word, value in values.items()
        }

    @property
    def stretch(self) -> sympy.Expr:
        """How far its spring is stretched."""
        return self.q - sympy.Float(self.rest) if self.rest else self.q

    @property
    def resistance(self) -> sympy.Expr:
        """The torque of all that resists it."""
        acting = (word for word, value in self.resists.items() if value)
        return sympy.Add(*(self.symbol(k) * RESISTS[k][1](self.stretch, self.w) for k in acting))

    def port(self, rates: Mapping[str, sympy.Expr]) -> Port:
        """Return the port of its effort."""
        return Port(self.name, self.w, self.q, rates, {}, self.unit("{effort}"))


def joints_of(m: Any, armatures: bool = False) -> list[Joint]:
    """Return the joints of MuJoCo's model of a robot, all with an armature or those that have."""
    names = [name_of(m, "joint", i) for i in range(m.nv)]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise ModelError(f"expected joints of different names, got {min(twice)!r} twice.")
    return [
        Joint(name, bool(m.jnt_type[i] == 2), _resists(m, i), armature, float(m.qpos_spring[i]))
        for i, name in enumerate(names)
        for armature in [armature_of(m, i) or (0.0 if armatures else None)]
    ]


def _resists(m: Any, i: int) -> dict[str, float]:
    """Return what resists a joint; older versions of MuJoCo know no polynomials."""
    none = np.zeros((m.nv, 2))
    drag = getattr(m, "dof_dampingpoly", none)[i]
    spring = getattr(m, "jnt_stiffnesspoly", none)[i]
    values = (m.dof_damping[i], *drag, m.dof_frictionloss[i], m.jnt_stiffness[i], *spring)
    return dict(zip(RESISTS, map(float, values), strict=True))


def armature_of(m: Any, joint: int) -> float:
    """Return the armature of a joint, and of its actuators through their gears."""
    own = float(m.dof_armature[joint])
    rotors = getattr(m, "actuator_armature", np.zeros(m.nu))
    at = (m.actuator_trntype <= 1) & (m.actuator_trnid[:, 0] == joint)
    return own + float(rotors[at] @ m.actuator_gear[at, 0] ** 2)


def name_of(m: Any, kind: str, number: int) -> str:
    """Return the name of a joint or an actuator as it may stand in equations."""
    name = re.sub(r"\W+", "_", getattr(m, kind)(number).name).strip("_")
    return name if name[:1].isalpha() else f"{kind}{name or number + 1}"


# -- torques themselves, or MJCF's actuators and their commands ------------------------------------

_OWN_TORQUES = "Remedy: from_mjcf(..., controls=False), which takes the joints' torques as inputs."


@dataclass
class Drive:
    """Inputs of a robot, and the efforts that they make at its joints."""

    efforts: list[sympy.Expr]
    inputs: dict[str, str] = field(default_factory=dict)
    parameters: dict[str, dict] = field(default_factory=dict)
    delays: dict[str, str] = field(default_factory=dict)

    def constant(self, name: str, value: float, usual: float, unit: str = "") -> sympy.Expr:
        """Return a number of the file as a fixed parameter, or itself where it is the usual one."""
        if value == usual:
            return sympy.Float(value) if value % 1 else sympy.Integer(value)
        self.parameters[name] = {"value": float(value), "unit": unit, "fixed": True}
        return symbol(name)


def torques(m: Any, joints: list[Joint], limited: bool = False) -> Drive:
    """Return a drive whose inputs are the joints' own torques and forces, between their limits."""
    units = {str(joint.effort): joint.unit("{effort}") for joint in joints}
    drive = Drive([joint.effort for joint in joints], units)
    if limited:
        _limit(drive, m, joints)
    return drive


def _limit(drive: Drive, m: Any, joints: list[Joint]) -> None:
    """Keep efforts between the limits that joints have."""
    for joint in np.flatnonzero(m.jnt_actfrclimited):
        name, ends = joints[joint].name, m.jnt_actfrcrange[joint]
        drive.efforts[joint] = _between(drive, drive.efforts[joint], name, ends)


def controls(path: str, m: Any, joints: list[Joint]) -> Drive:
    r"""Return a drive whose inputs are the commands of the file's actuators.

    .. math:: \tau = G\, [k u + b_0 + b_1 G q + b_2 G w],

    with command and force between their limits.
    """
    drive = Drive([sympy.Integer(0)] * m.nv)
    for number in range(m.nu):
        _require_plain(path, m, number)
        joint = m.actuator_trnid[number, 0]
        drive.efforts[joint] += _effort(drive, m, number, joints[joint])
    _limit(drive, m, joints)
    return drive


def _require_plain(path: str, m: Any, number: int) -> None:
    """Refuse actuators that do more than a gain, an offset, a spring and a damper at a joint."""
    kinds = (("trntype", 1), ("dyntype", 0), ("gaintype", 0), ("biastype", 1))
    for kind, most in kinds:
        if getattr(m, f"actuator_{kind}")[number] > most:
            name = m.actuator(number).name or f"number {number + 1}"
            raise ModelError(
                f"{path}: actuator {name}: expected a motor, or a servo of position or velocity, "
                f"at a joint and without a state of its own, got another {kind}. {_OWN_TORQUES}"
            )


def _effort(drive: Drive, m: Any, number: int, joint: Joint) -> sympy.Expr:
    name, gain, bias = name_of(m, "actuator", number), m.actuator_gainprm, m.actuator_biasprm
    gear, is_servo = m.actuator_gear[number, 0], m.actuator_biastype[number]
    plain = not is_servo and gear * gain[number, 0] == 1
    drive.inputs[name] = joint.unit("{effort}") if plain else ""
    if getattr(m, "actuator_delay", np.zeros(m.nu))[number] > 0:
        value = {"value": float(m.actuator_delay[number]), "unit": "s", "bounds": (0.0, np.inf)}
        drive.delays[name], drive.parameters[f"delay_{name}"] = f"delay_{name}", value
    command = symbol(name)
    if m.actuator_ctrllimited[number]:
        command = _between(drive, command, f"{name}_command", m.actuator_ctrlrange[number])
    by = drive.constant(f"gear_{name}", gear, 1.0)
    force = drive.constant(f"gain_{name}", gain[number, 0], 1.0) * command
    if is_servo:
        terms = zip(bias[number, :3], (1, by * joint.q, by * joint.w), strict=True)
        force += sum((sympy.Float(b) * of for b, of in terms if b), sympy.Integer(0))
    if m.actuator_forcelimited[number]:
        force = _between(drive, force, f"{name}_force", m.actuator_forcerange[number])
    return by * force


def _between(drive: Drive, expression, name: str, ends) -> sympy.Expr:
    """Return an expression between the two ends that the file gives."""
    low, high = (drive.constant(f"{end}_{name}", value, np.nan)
                 for end, value in zip(("low", "high"), ends, strict=True))  # fmt: skip
    return sympy.Max(low, sympy.Min(high, expression))
