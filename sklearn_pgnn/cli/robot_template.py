"""The job of ``sklearn-pgnn init`` for a robot: a model file that names its description."""

from collections.abc import Mapping, Sequence

from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.cli.inputs import read_model
from sklearn_pgnn.cli.output import refuse_existing, write_file
from sklearn_pgnn.cli.template import COMMENTS, columns_in, say_what_is_next
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.robot_section import is_robot, options_of, robot_text

HEAD = """\
# A model file of sklearn-pgnn: a robot, whose equations of motion follow from its description.
# Then see whether it fits the files:
#   sklearn-pgnn check --model {path} record.csv
"""
#: comment above each part, where a robot's is another one
OWN = {
    "robot": "The description, seen from the folder of this file. More can be said:\n{options}.",
    "states": "Of the description, as inputs and ports; what is listed here must agree with it.",
    "ports": "The joints, where effects act: friction, springs, end stops.",
    "parameters": "What the description says of joints, with values of your own, if you like.\n"
    "bounds: physically possible values. spread: relative deviation up to which the value\n"
    "counts as calibrated (0.1 by default). fixed: true for a known value.",
}


def robot_among(path: str, records: str | None, usual: str) -> tuple[str | None, str, str | None]:
    """Return the robot's file, the model file to be written, and the file of records."""
    if is_robot(path):
        return path, usual, records
    if records is not None and is_robot(records):
        return records, path, None
    return None, path, records


def write_robot_template(
    robot: str, path: str, records: str | None, *, force: bool, quiet: bool
) -> None:
    """Write the commented model file of a robot."""
    refuse_existing(path, force=force)
    model = read_model(robot)
    text = commented_robot(model, robot, path, *columns_in(records, model))
    write_file(path, text, force=force)
    if not quiet:
        say_what_is_next(path, model, records)


def commented_robot(
    model: PhysicsModel,
    robot: str,
    path: str,
    header: Sequence[str] = (),
    columns: Mapping[str, str] | None = None,
) -> str:
    """Return the model file of a robot, with a comment on every part."""
    lines = [HEAD.format(path=one_line(path)).rstrip()]
    if header:
        lines.append(f"# The columns of your file: {one_line(', '.join(header))}.")
    comments = {**COMMENTS, **OWN, "robot": OWN["robot"].format(options=_options(robot))}
    for line in robot_text(model, robot, path).splitlines():
        part = line.split(":")[0]
        if part in comments:
            lines += ["", *(f"# {text}" for text in comments[part].split("\n"))]
        lines.append(line)
    near = columns or {"t": "time", next(iter(model.inputs)): "torque_sensor"}
    shown = ", ".join(f"{name}: {column}" for name, column in near.items())
    lines += ["", "# Optional: columns in the files, where they differ from the names."]
    return "\n".join([*lines, f"# columns: {{{shown}}}"]) + "\n"


def _options(robot: str) -> str:
    """Return the options of the section ``robot`` for a file."""
    names = (name for name in options_of(robot) if name != "payload")
    return ", ".join(["payload: BODY", *(f"{name}: true" for name in names)])
