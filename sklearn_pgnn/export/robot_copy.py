"""Copies of a robot's URDF or MJCF file, into which is written what a model says of the joints."""

import math
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.export.joint_efforts import JointEffort, ends_of, joint_efforts
from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.base_parameters import SMALL, inertias_of
from sklearn_pgnn.priors.robot_file import parsed, read_mjcf, read_urdf, tree_of
from sklearn_pgnn.priors.robot_joint import Joint, controls, joints_of, name_of

#: relative difference of a number from that in the file which is not written
SAME = 1e-9


class RobotCopy:
    """A copy of a robot's file, and the model that it is to say."""

    kind, article = "", "a"

    def __init__(self, model: PhysicsModel, source: str, m: Any, root: ElementTree.Element):
        self.model, self.source, self.m, self.root = model, source, m, root
        self.joints = joints_of(m)
        self.efforts = joint_efforts(model, self.joints)

    def fill(self) -> Iterator[str]:
        """Write what can be said; yield what cannot."""
        yield from self._beside()
        for place, effort in enumerate(self.efforts):
            node = self.node("joint", self.m.joint(place).name, effort.joint)
            yield from (f"{each} at joint {effort.joint.name}" for each in effort.unsaid)
            yield from self.resist(node, effort)
            if effort.stops:
                yield from self.stop(node, effort)
        yield from self.drive()

    def _beside(self) -> Iterator[str]:
        """Yield what a model says of other things than joints and drives."""
        model, shown = self.model, {symbol(name) for name in self.model.states}
        own = {str(s) for joint in self.joints for s in (joint.q, joint.w)}
        others = [name for name in model.states if name not in own]
        faults = {name: each for name, each in model.outputs.items() if each not in shown}
        yield from (f"what its state {name} does" for name in others)
        yield from (f"what a sensor does, {name} = {to_text(e)}" for name, e in faults.items())
        yield from self._inertias()
        payload = model.parameters.get("payload")
        if payload is not None and payload.value:
            yield f"a payload of {payload.value:.6g} kg without its shape"

    def _inertias(self) -> Iterator[str]:
        """Yield inertial parameters that are others than in the file."""
        names = tuple(joint.name for joint in self.joints)
        for known in inertias_of(tree_of(self.m, names, None)):
            now = self.model.parameters.get(known.name)
            if now is not None and abs(now.value - known.known) > SAME * known.small / SMALL:
                yield (
                    f"{known.name} = {now.value:.6g} {known.unit} in place of {known.known:.6g}: "
                    f"with others held it stands for a combination, not for one link"
                )

    def node(self, tag: str, name: str, what: Joint | str) -> ElementTree.Element:
        """Return the element of a joint or an actuator."""
        found = [each for each in self.places(tag) if name and each.get("name") == name]
        if not found:
            shown = what.name if isinstance(what, Joint) else what
            raise ModelError(
                f"{self.source}: expected {tag} {shown!r} in the file itself, under its name. "
                f"Remedy: give it a name; where the file includes others, save it as one."
            )
        return found[0]

    def places(self, tag: str) -> Iterator[ElementTree.Element]:
        """Yield the elements that may be a joint or an actuator."""
        raise NotImplementedError

    def resist(self, node: ElementTree.Element, effort: JointEffort) -> Iterator[str]:
        """Write what resists a joint; yield what cannot be said."""
        raise NotImplementedError

    def stop(self, node: ElementTree.Element, effort: JointEffort) -> Iterator[str]:
        """Write where a joint stops; yield what cannot be said."""
        raise NotImplementedError

    def drive(self) -> Iterator[str]:
        """Write what drives the joints; yield what cannot be said."""
        raise NotImplementedError

    def changed(self, effort: JointEffort, word: str) -> bool:
        """Return whether a number is another one than in the file."""
        return differs(effort.resists[word], effort.joint.resists[word])


def drive_in_words(effort: JointEffort) -> str:
    """Return what drives a joint."""
    return f"the drive {to_text(effort.drive)} at joint {effort.joint.name}"


def child(node: ElementTree.Element, tag: str) -> ElementTree.Element:
    """Return an element's child, a new one where it has none."""
    found = node.find(tag)
    return ElementTree.SubElement(node, tag) if found is None else found


def number_text(value: float) -> str:
    """Return a number as a file has it, with all its digits."""
    return repr(float(value)).removesuffix(".0")


def differs(value: float, known: float) -> bool:
    """Return whether a number is another one but for rounding."""
    return not math.isclose(value, known, rel_tol=SAME, abs_tol=SAME**2)


def alike(one: sympy.Expr, other: sympy.Expr) -> bool:
    """Return whether two expressions are the same but for rounding."""
    left = sympy.expand(one - other)
    terms = sympy.Add.make_args(left)
    return all(abs(float(term.as_coeff_Mul()[0])) <= SAME for term in terms)


def unclipped(
    expression: sympy.Expr, command: sympy.Symbol
) -> tuple[sympy.Expr, tuple[float, float] | None]:
    """Return an expression with a command instead of the command between two ends, and the ends."""
    for outer in sorted(expression.atoms(sympy.Min, sympy.Max), key=sympy.count_ops, reverse=True):
        ends = {kind: _end(outer, kind, command) for kind in (sympy.Min, sympy.Max)}
        if None not in ends.values():
            low, high = ends[sympy.Max], ends[sympy.Min]
            return expression.xreplace({outer: command}), (low, high)  # type: ignore[return-value]
    return expression, None


def _end(outer: sympy.Expr, kind: type, command: sympy.Symbol) -> float | None:
    """Return the nearest number beside the command in minima of maxima, or the other way round."""
    level, found = outer, None
    while isinstance(level, sympy.Min | sympy.Max) and len(level.args) == 2:
        numbers = [arg for arg in level.args if arg.is_number]
        others = [arg for arg in level.args if not arg.is_number]
        if len(numbers) != 1:
            return None
        if isinstance(level, kind):
            found = float(numbers[0] if found is None else kind(numbers[0], found))
        level = others[0]
    return found if level == command else None


# -- URDF ------------------------------------------------------------------------------------------


class UrdfCopy(RobotCopy):
    """A copy of a URDF, which knows damping, friction and limits of joints."""

    kind = "URDF"

    def __init__(self, model: PhysicsModel, source: str):
        super().__init__(model, source, read_urdf(source), parsed(source, "robot", "a URDF"))

    def places(self, tag):
        """Yield the elements with a name, wherever they are."""
        return self.root.iter(tag)

    def resist(self, node, effort):
        """Write damping and friction; yield all else."""
        says = {"damping": "damping", "friction": "friction"}
        for word, attribute in says.items():
            if self.changed(effort, word):
                child(node, "dynamics").set(attribute, number_text(effort.resists[word]))
        for word in effort.resists:
            if word not in says and effort.resists[word]:
                yield f"{word.replace('_', ' ')} at joint {effort.joint.name}"
        armature = self.model.parameters.get(str(effort.joint.symbol("armature")))
        if armature is not None and armature.value:
            yield (
                f"an armature of {armature.value:.6g} {armature.unit} at joint "
                f"{effort.joint.name}, which MJCF can: MuJoCo saves a URDF as such"
            )

    def stop(self, node, effort):
        """Write the ends of the travel into the limit."""
        limit = node.find("limit")
        if limit is None or node.get("type") == "continuous":
            yield (
                f"an end stop at joint {effort.joint.name} without a <limit>, which a joint of "
                f"the type {'prismatic' if effort.joint.slides else 'revolute'} has"
            )
            return
        for end, place in effort.stops.items():
            limit.set(end, number_text(place))

    def drive(self):
        """Write limits of torques; yield delays and all else."""
        yield from (f"a delay of {name}" for name in self.model.delays)
        for place, effort in enumerate(self.efforts):
            bare, ends = unclipped(effort.drive, effort.joint.effort)
            if bare != effort.joint.effort or (ends and ends[0] != -ends[1]):
                yield drive_in_words(effort)
            elif ends:
                node = self.node("joint", self.m.joint(place).name, effort.joint)
                limit = node.find("limit")
                if limit is None:
                    yield f"a limit of the torque at joint {effort.joint.name} without a <limit>"
                else:
                    limit.set("effort", number_text(ends[1]))


# -- MJCF ------------------------------------------------------------------------------------------


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
