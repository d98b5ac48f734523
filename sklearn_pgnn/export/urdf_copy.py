"""A copy of a URDF: what its words can say of joints."""

from sklearn_pgnn.export.robot_copy import (
    RobotCopy,
    child,
    drive_in_words,
    number_text,
    unclipped,
)
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.robot_file import parsed, read_urdf


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
