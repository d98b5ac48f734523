"""The job of ``sklearn-pgnn init``: a commented model file to start from, also of a robot."""

from collections.abc import Mapping, Sequence

import click

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.cli.inputs import read_model
from sklearn_pgnn.cli.options import MODEL_FILE, make_system
from sklearn_pgnn.cli.output import refuse_existing, write_file
from sklearn_pgnn.physics.channel_kinds import COMMANDED, usual_kind
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.found_ports import column
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_file import write_model
from sklearn_pgnn.priors.robot_section import is_robot, options_of, robot_text
from sklearn_pgnn.trajectories.files import open_file

HEAD = """\
# A model file of sklearn-pgnn: the machine as you model it. It begins as a ready system;
# put your own names, units, values and equations in its place. Then see whether it fits the files:
#   sklearn-pgnn check --model {path} record.csv
"""
ROBOT_HEAD = """\
# A model file of sklearn-pgnn: a robot, whose equations of motion follow from its description.
# Then see whether it fits the files:
#   sklearn-pgnn check --model {path} record.csv
"""
#: comment above each part
COMMENTS = {
    "name": "Name of the machine in reports.",
    "states": "The state variables, with units: positions, speeds, levels, temperatures.",
    "inputs": "The inputs, with units. Every file of records has a column for each.",
    "outputs": "The measured outputs: the column of the file, and the state or an expression.",
    "parameters": "Constants. bounds: physically possible values. spread: relative deviation up\n"
    "to which the value counts as calibrated (0.1 by default). fixed: true for a known value,\n"
    "which is never re-tuned.",
    "equations": "The rate of every state. Names from above, numbers, t, pi, + - * / **, and abs,\n"
    "sign, min, max, sqrt, exp, log, sin, cos, tan, atan2, tanh and the like.",
    "inertia": "Optional: mass or inertia of a speed; effects on it are then forces or torques.",
    "energy": "Optional: stored [J], supplied and dissipated [W]; networks and losses use it.",
    "initial_state": "Optional: where a record without initial states starts; zero by default.",
}
#: optional parts of a model, to be uncommented
OPTIONAL = {
    "initial_state": "where a record without initial states starts; zero by default",
    "columns": "column name of a quantity in the files, where it differs from its name",
    "ports": "names for places: the effort that acts there, and its velocity, level or temperature",
    "channels": "commanded or measured, or the sensor: encoder, tachometer, thermocouple, ...; a "
    "diagnosis leaves out faults that it cannot have",
    "delays": "for an input that acts late, the parameter of its delay: uncomment that above, too",
    "simulation": "hold: zoh or foh (inputs held, or linearly interpolated); substeps; method",
}
#: comment above each part, where a robot's is another one
ROBOT_COMMENTS = {
    "robot": "The description, seen from the folder of this file. More can be said:\n{options}.",
    "states": "Of the description, as inputs and ports; what is listed here must agree with it.",
    "ports": "The joints, where effects act: friction, springs, end stops.",
    "parameters": "What the description says of joints, with values of your own, if you like.\n"
    "bounds: physically possible values. spread: relative deviation up to which the value\n"
    "counts as calibrated (0.1 by default). fixed: true for a known value.",
}


def write_template(path: str, like: str, records: str | None, *, force: bool, quiet: bool) -> None:
    """Write a commented model file: of a ready system, or of a robot that is named."""
    robot, path, records = _robot_among(path, records)
    if robot is None:
        model = make_system(like)
        text = commented(model, path, *columns_in(records, model))
    else:
        refuse_existing(path, force=force)
        model = read_model(robot)
        text = commented_robot(model, robot, path, *columns_in(records, model))
    write_file(path, text, force=force)
    if not quiet:
        then = f"sklearn-pgnn check --model {one_line(path)} {one_line(records or 'record.csv')}"
        click.echo(
            f"Wrote {one_line(path)}, a model of the {model.name}. Adapt it in an editor, "
            f"then:\n  {then}"
        )


def _robot_among(path: str, records: str | None) -> tuple[str | None, str, str | None]:
    """Return the robot's file, the model file to be written, and the file of records."""
    if is_robot(path):
        return path, MODEL_FILE, records
    if records is not None and is_robot(records):
        return records, path, None
    return None, path, records


def columns_in(records: str | None, model: PhysicsModel) -> tuple[Sequence[str], Mapping[str, str]]:
    """Return the columns of a file of records, and those that quantities may be."""
    if records is None:
        return [], {}
    file = open_file(records, model)
    near = {name: file.with_unit(name, near) for name, near in file.nearest().items()}
    return file.header, near


def commented(
    model: PhysicsModel,
    path: str = MODEL_FILE,
    header: Sequence[str] = (),
    columns: Mapping[str, str] | None = None,
) -> str:
    """Return a model as a model file with a comment on every part."""
    delay = "" if model.delays else f"  # {_delay(model)}: {{value: 0.01, unit: s}}  # see delays"
    lines = _with_comments(write_model(model), HEAD, path, header, COMMENTS, delay)
    lines += ["", "# Optional parts: uncomment those you need."]
    examples = _examples(model, columns)
    for part, what in OPTIONAL.items():
        if part not in model.to_dict() and examples[part]:
            lines += [f"# {part}: {examples[part]}  # {what}"]
    return "\n".join(lines) + "\n"


def commented_robot(
    model: PhysicsModel,
    robot: str,
    path: str,
    header: Sequence[str] = (),
    columns: Mapping[str, str] | None = None,
) -> str:
    """Return the model file of a robot, with a comment on every part."""
    names = (f"{name}: true" for name in options_of(robot) if name != "payload")
    options = ", ".join(["payload: BODY", *names])
    own = {part: text.replace("{options}", options) for part, text in ROBOT_COMMENTS.items()}
    text = robot_text(model, robot, path)
    lines = _with_comments(text, ROBOT_HEAD, path, header, {**COMMENTS, **own})
    near = columns or {"t": "time", next(iter(model.inputs)): "torque_sensor"}
    shown = ", ".join(f"{name}: {column}" for name, column in near.items())
    lines += ["", "# Optional: columns in the files, where they differ from the names."]
    return "\n".join([*lines, f"# columns: {{{shown}}}"]) + "\n"


def _with_comments(
    text: str, head: str, path: FilePath, header: Sequence[str], comments: Mapping, delay: str = ""
) -> list[str]:
    """Return the lines of a model file with a comment above every part."""
    lines, before = [head.format(path=one_line(path)).rstrip()], ""
    if header:
        lines.append(f"# The columns of your file: {one_line(', '.join(header))}.")
    for line in text.splitlines():
        part = line.split(":")[0]
        if part in comments:
            lines += [delay] if delay and before == "parameters" else []
            lines += ["", *(f"# {text}" for text in comments[part].split("\n"))]
            before = part
        lines.append(line)
    return lines


def _examples(model: PhysicsModel, columns: Mapping[str, str] | None) -> dict[str, str]:
    """Return an example of every optional part, with the model's own names."""
    (state, *_), (driven, *_), (output, *_) = model.states, model.inputs, model.outputs
    columns = columns or {"t": "time", driven: f"{driven}_command", output: f"{output}_sensor"}
    return {
        "initial_state": f"{{{state}: 0.5}}",
        "columns": f"{{{', '.join(f'{name}: {near}' for name, near in columns.items())}}}",
        "ports": _port(model),
        "channels": _channels(model),
        "delays": f"{{{driven}: {_delay(model)}}}",
        "simulation": "{hold: foh, substeps: 4}",
    }


def _port(model: PhysicsModel) -> str:
    """Return an example of a port: the first input that enters a rate linearly, and its state."""
    for name in model.inputs:
        for state, slope in column(model, name).items():
            if symbol(name) not in slope.free_symbols:
                return f"{{drive: {{effort: {name}, flow: {state}}}}}"
    return ""


def _channels(model: PhysicsModel) -> str:
    """Return what the channels usually are, as far as names and units tell; else an example."""
    told = {name: usual_kind(model, name) for name in (*model.inputs, *model.outputs)}
    said = [f"{name}: {kind}" for name, kind in told.items() if kind]
    return f"{{{', '.join(said) or f'{next(iter(told))}: {COMMANDED}'}}}"


def _delay(model: PhysicsModel) -> str:
    """Return a name for the delay of the first input that no quantity of the model has."""
    name = f"tau_{next(iter(model.inputs))}"
    taken = {*model.parameters, *model.states, *model.inputs, *model.outputs}
    return name if name not in taken else f"{name}_delay"
