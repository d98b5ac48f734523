"""A copy of an MJCF file: what its words can say of joints and actuators."""

import math
from collections.abc import Iterator
from xml.etree import ElementTree

import sympy

from sklearn_pgnn.export.joint_efforts import JointEffort
from sklearn_pgnn.export.joint_stops import ends_of
from sklearn_pgnn.export.robot_copy import (
    RobotCopy,
    alike,
    differs,
    drive_in_words,
    number_text,
    unclipped,
)
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.actuators import controls
from sklearn_pgnn.priors.robot_file import parsed, read_mjcf
from sklearn_pgnn.priors.robot_joint import Joint, name_of


class MjcfCopy(RobotCopy):
    """A copy of an MJCF file, whose actuators have limits, gears and delays."""

    kind, article = "MJCF", "an"

    def __init__(self, model: PhysicsModel, source: str):
        super().__init__(model, source, read_mjcf(source), parsed(source, "mujoco", "an MJCF"))

    def places(self, tag):
        """Yield joints of the bodies, or all actuators."""
        inside = "worldbody" if tag == "joint" else "actuator"
        for part in self.root.iter(inside):
            yield from part.iter("joint") if tag == "joint" else part

    def resist(self, node, effort):
        """Write damping, friction, springs and armature."""
        rows = {"damping": ("damping", "drag", "cubic_drag"), "frictionloss": ("friction",),
                "stiffness": ("stiffness", "quadratic_stiffness", "cubic_stiffness")}  # fmt: skip
        for attribute, words in rows.items():
            values = [effort.resists[word] for word in words]
            if any(values[1:]) and not hasattr(self.m, "dof_dampingpoly"):
                yield f"{words[1]} or {words[2]} at joint {effort.joint.name} (MuJoCo is too old)"
            elif any(self.changed(effort, word) for word in words):
                kept = values if any(values[1:]) else values[:1]
                node.set(attribute, " ".join(map(number_text, kept)))
        if effort.resists["stiffness"] and differs(effort.rest, effort.joint.rest):
            node.set("springref", number_text(effort.rest * self._angle(effort.joint)))
        armature = self.model.parameters.get(str(effort.joint.symbol("armature")))
        known = effort.joint.armature or 0.0
        if armature is not None and differs(armature.value, known):
            own = float(self.m.dof_armature[self.joints.index(effort.joint)])
            if own + armature.value < known:
                of = f"joint {effort.joint.name} below that of its actuators, {known - own:.6g}"
                yield f"an armature at {of} {armature.unit}"
            node.set("armature", number_text(own + armature.value - known))

    def stop(self, node, effort):
        """Write the range, which has two ends."""
        place = self.joints.index(effort.joint)
        known = tuple(self.m.jnt_range[place].tolist()) if self.m.jnt_limited[place] else None
        ends = ends_of(effort.stops, known)
        if ends is None:
            yield f"an end stop at one end of joint {effort.joint.name} without a range"
            return
        angle = self._angle(effort.joint)
        node.set("range", " ".join(number_text(end * angle) for end in ends))
        node.set("limited", "true")

    def _angle(self, joint: Joint) -> float:
        """Return how many units of the file a radian has."""
        said = [each.get("angle") for each in self.root.iter("compiler") if each.get("angle")]
        return 1.0 if joint.slides or said[-1:] == ["radian"] else 180.0 / math.pi

    def drive(self):
        """Write what the actuators do, if their commands are the inputs."""
        own = {str(joint.effort) for joint in self.joints}
        if set(self.model.inputs) <= own:
            yield from self._torques()
        else:
            yield from self._controls()

    def _torques(self) -> Iterator[str]:
        for effort in self.efforts:
            if effort.drive != effort.joint.effort:
                yield f"{drive_in_words(effort)}, which has no actuator"
        yield from (f"a delay of {name}, which is no actuator" for name in self.model.delays)

    def _controls(self) -> Iterator[str]:
        known = controls(self.source, self.m, self.joints)
        values = {symbol(name): sympy.Float(p["value"]) for name, p in known.parameters.items()}
        for place, effort in enumerate(self.efforts):
            usual = sympy.expand(known.efforts[place].xreplace(values))
            yield from self._actuated(effort, usual)
        for name, delay in self.model.delays.items():
            yield from self._delayed(name, self.model.parameters[delay].value)

    def _actuated(self, effort: JointEffort, usual: sympy.Expr) -> Iterator[str]:
        """Write the limits and the gear of a joint's actuators, which are to make its drive."""
        found = effort.drive
        for name in self.model.inputs:
            command = symbol(name)
            bare, ends = unclipped(found, command)
            before, known = unclipped(usual, command)
            if ends and ends != known:
                node = self._actuator(name)
                node.set("ctrlrange", " ".join(map(number_text, ends)))
                node.set("ctrllimited", "true")
            found, usual = bare, before
        if alike(found, usual):
            return
        ratio = sympy.simplify(found / usual) if usual else sympy.nan
        inputs = [name for name in self.model.inputs if usual.has(symbol(name))]
        if (
            len(inputs) != 1
            or not ratio.is_number
            or not ratio.is_finite
            or usual.free_symbols != {symbol(inputs[0])}
        ):
            yield drive_in_words(effort)
            return
        node = self._actuator(inputs[0])
        place = self._numbers()[inputs[0]]
        node.set("gear", number_text(float(ratio) * float(self.m.actuator_gear[place, 0])))

    def _delayed(self, name: str, delay: float) -> Iterator[str]:
        now = getattr(self.m, "actuator_delay", None)
        if now is None:
            yield f"a delay of {name} (MuJoCo is too old)"
        elif differs(delay, float(now[self._numbers()[name]])):
            node = self._actuator(name)
            node.set("delay", number_text(delay))
            node.set("nsample", str(math.ceil(delay / self.m.opt.timestep) + 2))

    def _numbers(self) -> dict[str, int]:
        return {name_of(self.m, "actuator", i): i for i in range(self.m.nu)}

    def _actuator(self, name: str) -> ElementTree.Element:
        return self.node("actuator", self.m.actuator(self._numbers()[name]).name, name)
