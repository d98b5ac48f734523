"""What was found at a robot's joints, written into a copy of its URDF or MJCF file."""

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import sympy

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.export.joint_efforts import JointEffort, joint_efforts
from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.actuators import controls
from sklearn_pgnn.priors.robot_file import parsed, read_mjcf, read_urdf
from sklearn_pgnn.priors.robot_joint import Joint, joints_of, name_of
from sklearn_pgnn.whole_file import write_whole

#: relative difference of a number from that in the file which is not written
SAME = 1e-9


def to_urdf(model: PhysicsModel, source: FilePath, path: FilePath) -> Path:
    r"""Write what a model says of a robot's joints into a copy of its URDF.

    Damping :math:`d` and dry friction :math:`F_c` of a joint become ``<dynamics damping friction>``
    [N m s/rad and N m, or N s/m and N], a limit of the torque the ``effort`` of its ``<limit>``.

    Parameters
    ----------
    model : PhysicsModel
        A model that `sklearn_pgnn.priors.from_urdf` has made, extended by effects or fitted.
    source : str or path-like
        The file that it was made of; it is not changed.
    path : str or path-like
        Where to write.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    ModelError
        If the model says what a URDF cannot say, all of which is listed; nothing is written then.

    Examples
    --------
    >>> import tempfile
    >>> from sklearn_pgnn import effects, priors
    >>> text = '''<robot name="crank"><link name="base"/><link name="arm"><inertial>
    ...   <origin xyz="0.2 0 0"/><mass value="3"/>
    ...   <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
    ...   <joint name="hub" type="continuous"><parent link="base"/><child link="arm"/>
    ...   <axis xyz="0 1 0"/></joint></robot>'''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "crank.urdf").write_text(text)
    ...     crank = priors.from_urdf(f"{folder}/crank.urdf")
    ...     found = crank + effects.CoulombFriction("hub", level=0.5)
    ...     written = to_urdf(found, f"{folder}/crank.urdf", f"{folder}/found.urdf").read_text()
    >>> written[written.index("<dynamics") :].split(">")[0]
    '<dynamics friction="0.5" /'
    """
    return _write(_Urdf(model, os.fspath(source)), Path(path))


def to_mjcf(model: PhysicsModel, source: FilePath, path: FilePath) -> Path:
    r"""Write what a model says of a robot's joints into a copy of its MJCF file.

    Joints get ``damping`` (with the polynomial of newer versions of MuJoCo for drag), their
    ``frictionloss``, ``armature``, ``stiffness`` and ``springref``; actuators ``ctrlrange``,
    ``gear`` and ``delay``. Units are those of the file: angles in degrees, where it does not say
    radians, all else in SI units.

    Parameters
    ----------
    model : PhysicsModel
        A model that `sklearn_pgnn.priors.from_mjcf` has made, extended by effects or fitted.
    source : str or path-like
        The file that it was made of; it is not changed.
    path : str or path-like
        Where to write; in the folder of the source, if that names meshes or other files.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    ModelError
        If the model says what an MJCF file cannot say, all of which is listed; nothing is written
        then.

    Examples
    --------
    >>> import tempfile
    >>> from sklearn_pgnn import effects, priors
    >>> text = '''<mujoco><worldbody><body><joint name="hub" axis="0 1 0"/>
    ...   <geom type="capsule" size="0.02" fromto="0 0 0 0.4 0 0"/></body></worldbody></mujoco>'''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "crank.xml").write_text(text)
    ...     crank = priors.from_mjcf(f"{folder}/crank.xml")
    ...     found = crank + effects.CoulombFriction("hub", level=0.5)
    ...     written = to_mjcf(found, f"{folder}/crank.xml", f"{folder}/found.xml").read_text()
    >>> written[written.index("<joint") :].split(">")[0]
    '<joint name="hub" axis="0 1 0" frictionloss="0.5" /'
    """
    return _write(_Mjcf(model, os.fspath(source)), Path(path))


def _write(copy: "_Copy", path: Path) -> Path:
    unsaid = list(copy.fill())
    if unsaid:
        raise ModelError(
            f"{path.name}: {copy.article} {copy.kind} file cannot say {'; nor '.join(unsaid)}. "
            f"Remedy: write the model without that, and what it says by hand."
        )
    text = ElementTree.tostring(copy.root, encoding="unicode")
    write_whole(path, f'<?xml version="1.0"?>\n{text}\n')
    return path


class _Copy:
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
        yield from self.drive()

    def _beside(self) -> Iterator[str]:
        """Yield what a model says of other things than joints and drives."""
        model, shown = self.model, {symbol(name) for name in self.model.states}
        own = {str(s) for joint in self.joints for s in (joint.q, joint.w)}
        others = [name for name in model.states if name not in own]
        faults = {name: each for name, each in model.outputs.items() if each not in shown}
        yield from (f"what its state {name} does" for name in others)
        yield from (f"what a sensor does, {name} = {to_text(e)}" for name, e in faults.items())
        payload = model.parameters.get("payload")
        if payload is not None and payload.value:
            yield f"a payload of {payload.value:.6g} kg without its shape"

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

    def drive(self) -> Iterator[str]:
        """Write what drives the joints; yield what cannot be said."""
        raise NotImplementedError

    def changed(self, effort: JointEffort, word: str) -> bool:
        """Return whether a number is another one than in the file."""
        return _differs(effort.resists[word], effort.joint.resists[word])


class _Urdf(_Copy):
    kind = "URDF"

    def __init__(self, model: PhysicsModel, source: str):
        super().__init__(model, source, read_urdf(source), parsed(source, "robot", "a URDF"))

    def places(self, tag):
        return self.root.iter(tag)

    def resist(self, node, effort):
        says = {"damping": "damping", "friction": "friction"}
        for word, attribute in says.items():
            if self.changed(effort, word):
                _child(node, "dynamics").set(attribute, _number(effort.resists[word]))
        for word in effort.resists:
            if word not in says and effort.resists[word]:
                yield f"{word.replace('_', ' ')} at joint {effort.joint.name}"

    def drive(self):
        yield from (f"a delay of {name}" for name in self.model.delays)
        for place, effort in enumerate(self.efforts):
            bare, ends = _unclipped(effort.drive, effort.joint.effort)
            if bare != effort.joint.effort or (ends and ends[0] != -ends[1]):
                yield _drive(effort)
            elif ends:
                node = self.node("joint", self.m.joint(place).name, effort.joint)
                limit = node.find("limit")
                if limit is None:
                    yield f"a limit of the torque at joint {effort.joint.name} without a <limit>"
                else:
                    limit.set("effort", _number(ends[1]))


class _Mjcf(_Copy):
    kind, article = "MJCF", "an"

    def __init__(self, model: PhysicsModel, source: str):
        super().__init__(model, source, read_mjcf(source), parsed(source, "mujoco", "an MJCF"))

    def places(self, tag):
        inside = "worldbody" if tag == "joint" else "actuator"
        for part in self.root.iter(inside):
            yield from part.iter("joint") if tag == "joint" else part

    def resist(self, node, effort):
        rows = {"damping": ("damping", "drag", "cubic_drag"), "frictionloss": ("friction",),
                "stiffness": ("stiffness", "quadratic_stiffness", "cubic_stiffness")}  # fmt: skip
        for attribute, words in rows.items():
            values = [effort.resists[word] for word in words]
            if any(values[1:]) and not hasattr(self.m, "dof_dampingpoly"):
                yield f"{words[1]} or {words[2]} at joint {effort.joint.name} (MuJoCo is too old)"
            elif any(self.changed(effort, word) for word in words):
                kept = values if any(values[1:]) else values[:1]
                node.set(attribute, " ".join(map(_number, kept)))
        if effort.resists["stiffness"] and _differs(effort.rest, effort.joint.rest):
            node.set("springref", _number(effort.rest * self._angle(effort.joint)))
        armature = self.model.parameters.get(str(effort.joint.symbol("armature")))
        if armature is not None and _differs(armature.value, effort.joint.armature):
            own = float(self.m.dof_armature[self.joints.index(effort.joint)])
            node.set("armature", _number(own + armature.value - effort.joint.armature))

    def _angle(self, joint: Joint) -> float:
        """Return how many units of the file a radian has."""
        said = [each.get("angle") for each in self.root.iter("compiler") if each.get("angle")]
        return 1.0 if joint.slides or said[-1:] == ["radian"] else 180.0 / math.pi

    def drive(self):
        own = {str(joint.effort) for joint in self.joints}
        if set(self.model.inputs) <= own:
            yield from self._torques()
        else:
            yield from self._controls()

    def _torques(self) -> Iterator[str]:
        for effort in self.efforts:
            if effort.drive != effort.joint.effort:
                yield f"{_drive(effort)}, which has no actuator"
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
            bare, ends = _unclipped(found, command)
            before, known = _unclipped(usual, command)
            if ends and ends != known:
                node = self._actuator(name)
                node.set("ctrlrange", " ".join(map(_number, ends)))
                node.set("ctrllimited", "true")
            found, usual = bare, before
        if _alike(found, usual):
            return
        ratio = sympy.simplify(found / usual) if usual else sympy.nan
        inputs = [name for name in self.model.inputs if usual.has(symbol(name))]
        if (
            len(inputs) != 1
            or not ratio.is_number
            or not ratio.is_finite
            or usual.free_symbols != {symbol(inputs[0])}
        ):
            yield _drive(effort)
            return
        node = self._actuator(inputs[0])
        place = self._numbers()[inputs[0]]
        node.set("gear", _number(float(ratio) * float(self.m.actuator_gear[place, 0])))

    def _delayed(self, name: str, delay: float) -> Iterator[str]:
        now = getattr(self.m, "actuator_delay", None)
        if now is None:
            yield f"a delay of {name} (MuJoCo is too old)"
        elif _differs(delay, float(now[self._numbers()[name]])):
            node = self._actuator(name)
            node.set("delay", _number(delay))
            node.set("nsample", str(math.ceil(delay / self.m.opt.timestep) + 2))

    def _numbers(self) -> dict[str, int]:
        return {name_of(self.m, "actuator", i): i for i in range(self.m.nu)}

    def _actuator(self, name: str) -> ElementTree.Element:
        return self.node("actuator", self.m.actuator(self._numbers()[name]).name, name)


def _drive(effort: JointEffort) -> str:
    return f"the drive {to_text(effort.drive)} at joint {effort.joint.name}"


def _child(node: ElementTree.Element, tag: str) -> ElementTree.Element:
    """Return an element's child, a new one where it has none."""
    found = node.find(tag)
    return ElementTree.SubElement(node, tag) if found is None else found


def _number(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def _differs(value: float, known: float) -> bool:
    return not math.isclose(value, known, rel_tol=SAME, abs_tol=SAME**2)


def _alike(one: sympy.Expr, other: sympy.Expr) -> bool:
    """Return whether two expressions are the same but for rounding."""
    left = sympy.expand(one - other)
    terms = sympy.Add.make_args(left)
    return all(abs(float(term.as_coeff_Mul()[0])) <= SAME for term in terms)


def _unclipped(
    expression: sympy.Expr, command: sympy.Symbol
) -> tuple[sympy.Expr, tuple[float, float] | None]:
    """Return an expression with a command instead of the command between two ends, and the ends."""
    for outer in expression.atoms(sympy.Min, sympy.Max):
        ends = {kind: _end(outer, kind, command) for kind in (sympy.Min, sympy.Max)}
        if None not in ends.values():
            low, high = ends[sympy.Max], ends[sympy.Min]
            return expression.xreplace({outer: command}), (low, high)  # type: ignore[return-value]
    return expression, None


def _end(outer: sympy.Expr, kind: type, command: sympy.Symbol) -> float | None:
    """Return the number beside the command in a minimum of a maximum, or the other way round."""
    level, found = outer, None
    while isinstance(level, sympy.Min | sympy.Max) and len(level.args) == 2:
        numbers = [arg for arg in level.args if arg.is_number]
        others = [arg for arg in level.args if not arg.is_number]
        if len(numbers) != 1:
            return None
        found, level = float(numbers[0]) if isinstance(level, kind) else found, others[0]
    return found if level == command else None
