"""A copy of a robot's file, into which it is written what a model says of the joints."""

import math
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.export.joint_efforts import JointEffort, joint_efforts
from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.base_parameters import SMALL, inertias_of
from sklearn_pgnn.priors.robot_file import tree_of
from sklearn_pgnn.priors.robot_joint import Joint, joints_of

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
