"""What drives the joints of a robot: torques themselves, or MJCF's actuators and their commands."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.priors.robot_joint import Joint, name_of

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
