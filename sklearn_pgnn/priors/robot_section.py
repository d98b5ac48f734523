"""A model file's section ``robot``: the machine is that of a URDF or MJCF file, the rest is told.

States, inputs and ports are those of the robot; where the model file lists them they must be the
same. Its parameters may get other values, bounds and spreads, and there may be others.
"""

from collections.abc import Callable, Mapping
from os import PathLike, path
from pathlib import Path
from typing import Any

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_file import robot_in, written_parts
from sklearn_pgnn.physics.model_parts import parameter_dict
from sklearn_pgnn.priors.robot import from_mjcf, from_urdf

#: how a robot's file is read, by its ending, and what the section says besides
ROBOTS: dict[str, Callable[..., PhysicsModel]] = {
    ".urdf": from_urdf,
    ".xml": from_mjcf,
    ".mjcf": from_mjcf,
}
_BOTH = ("payload", "base_parameters", "armatures")
_OWN = {".urdf": "effort_limits", ".xml": "controls", ".mjcf": "controls"}
#: what the model file says of a robot in place of its file
TOLD = ("name", "outputs", "initial_state", "columns", "channels", "simulation")


def is_robot(file: str | PathLike) -> bool:
    """Return whether a file is a robot's description, by its ending."""
    return Path(file).suffix.lower() in ROBOTS


def options_of(file: str | PathLike) -> tuple[str, ...]:
    """Return what the section can say of a robot's file."""
    return (*_BOTH, _OWN[Path(file).suffix.lower()])


def described_in(file: str | PathLike) -> Path | None:
    """Return the robot's file that a model file names, or that it is itself; None for others."""
    if is_robot(file):
        return Path(file)
    section = None if Path(file).suffix.lower() == ".fmu" else robot_in(file)
    return None if section is None else Path(file).parent / section["file"]


def robot_model(data: Mapping[str, Any], folder: Path) -> PhysicsModel:
    """Return the model of a model file with a robot, whose file stands beside it."""
    given = dict(data["robot"])
    file = given.pop("file")
    robot = _read(folder / file, given)
    known = robot_parts(robot, file)
    for part in ("states", "inputs", "ports"):
        _require_same(part, data.get(part) or {}, known[part], file)
    told: dict[str, Any] = {part: data[part] for part in TOLD if data.get(part)}
    parameters = {**robot.parameters, **data.get("parameters", {})}
    delays = {**robot.delays, **(data.get("delays") or {})}
    return robot.replace(parameters=parameters, delays=delays, **told)


def _read(file: Path, options: Mapping[str, Any]) -> PhysicsModel:
    """Return the model of a robot's file."""
    if not is_robot(file):
        raise ModelError(
            f"robot.file: expected a file that ends in {', '.join(ROBOTS)}, got {file.name!r}.",
            ("robot", "file"),
        )
    read, known = ROBOTS[file.suffix.lower()], options_of(file)
    for name in options:
        if name not in known:
            raise ModelError(
                f"robot.{name}: expected one of {', '.join(known)} of {file.name}, got this.",
                ("robot", name),
            )
    try:
        return read(file, **options)
    except ModelError as error:
        raise ModelError(str(error), ("robot", "file")) from error


def _require_same(part: str, given: Mapping, known: Mapping, file: str) -> None:
    """Refuse what the model file says otherwise than the robot's."""
    for name, said in given.items():
        if said != known.get(name):
            is_known = f"{known[name]} there" if name in known else f"one of {', '.join(known)}"
            raise ModelError(
                f"{part}.{name}: expected what {file} has, {is_known}, got {said or name!r}. "
                f"Remedy: leave it out; columns names columns that differ from quantities.",
                (part, name),
            )


def robot_parts(robot: PhysicsModel, file: str) -> dict[str, Any]:
    """Return the parts of a model file with a robot."""
    return {
        "name": robot.name,
        "robot": {"file": file},
        "states": dict(robot.states),
        "inputs": dict(robot.inputs),
        "outputs": {name: to_text(e) for name, e in robot.outputs.items()},
        "ports": {name: _port(robot, name) for name in robot.declared_ports},
        "parameters": {name: parameter_dict(p) for name, p in robot.parameters.items()},
        "delays": dict(robot.delays),
        "initial_state": {name: at for name, at in robot.initial_state.items() if at},
        "columns": dict(robot.columns),
        "channels": dict(robot.channels),
        "simulation": dict(robot.simulation),
    }


def robot_text(robot: PhysicsModel, source: str | PathLike, target: str | PathLike) -> str:
    """Return a robot as the text of a model file, from the description or model file it is of."""
    description = described_in(source)
    if description is None:
        raise ModelError(f"{source}: expected a robot's description, or a model file of one.")
    parts = robot_parts(robot, relative_to(description, target))
    if not is_robot(source):
        parts["robot"] = {**(robot_in(source) or {}), **parts["robot"]}
    return written_parts({name: part for name, part in parts.items() if part})


def _port(robot: PhysicsModel, name: str) -> dict[str, str]:
    """Return a joint as a port, with its torque or force where that is an input."""
    port = robot.port(name)
    flow, position = str(port.flow), str(port.displacement)
    effort = f"{'tau' if flow.startswith('w') else 'F'}_{name}"
    driven = {"effort": effort} if effort in robot.inputs else {}
    return {**driven, "flow": flow, "displacement": position, "unit": port.unit}


def relative_to(file: str | PathLike, model_file: str | PathLike) -> str:
    """Return a robot's file as a model file names it: from its folder, with slashes."""
    return Path(path.relpath(file, Path(model_file).absolute().parent)).as_posix()
