"""Models as functional mock-up units for FMI 2 or 3, with their C source."""

import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from uuid import NAMESPACE_URL, uuid5
from xml.etree import ElementTree

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export.c_machine import Machine, comment, machine_of, render
from sklearn_pgnn.export.fmi_stubs import fmi_stubs
from sklearn_pgnn.physics.model import PhysicsModel

#: version of FMI: its name, and the folder of binaries on this kind of machine
VERSIONS = {2: ("2.0", "linux64"), 3: ("3.0", "x86_64-linux")}


@dataclass(frozen=True)
class Variable:
    """A variable as FMI defines it, its C name, the letter of its kind, and its index."""

    reference: int
    name: str
    causality: str
    variability: str
    where: str
    start: str | None = None
    unit: str = ""
    room: str = "p"
    place: int = 0

    @property
    def comment(self) -> str:
        """Its name, made safe for a C comment."""
        return comment(self.name)


def to_fmu(
    model: PhysicsModel,
    path: FilePath,
    interval: float,
    *,
    fmi: int = 2,
    name: str | None = None,
    method: str = "rk4",
    substeps: int | None = None,
    compiler: str | None = "gcc",
) -> Path:
    r"""Write a model as a functional mock-up unit (FMU) for co-simulation and model exchange.

    The unit contains the C source of `to_c` and advances by whole samples of `interval`, with its
    inputs held. Parameters can be changed between steps; initial states are the variables
    ``state.NAME``, to be set before the unit is initialised.

    For model exchange it computes the rates :math:`\dot x = f(t, x, u, p)` for the solver of the
    importing tool. A model with dry friction or delayed inputs is not defined by its rates alone:
    its unit is for co-simulation only.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    path : str or path-like
        The file, such as ``"robot.fmu"``.
    interval : float
        Sample interval [s]; a communication step is a multiple of it.
    fmi : {2, 3}, default=2
        Version of FMI.
    name : str, optional
        Name of the unit; by default that of the model.
    method : {"rk4", "euler"}, default="rk4"
        Runge-Kutta scheme.
    substeps : int, optional
        Integration steps per sample interval; by default as given by the model's `simulation`,
        else enough for explicit steps to be stable at its initial state.
    compiler : str or None, default="gcc"
        C compiler for the binary for Linux on x86-64; with None the unit contains the source only,
        which the importing tool compiles.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ModelError
        If inputs are interpolated linearly to their next sample, which a unit does not know.
    OptionError
        If an option has an invalid value, or the compiler is not found.

    Examples
    --------
    >>> from sklearn_pgnn.systems import two_tanks
    >>> to_fmu(two_tanks(), "tanks.fmu", interval=1.0, compiler=None).name
    'tanks.fmu'
    """
    _check(model, fmi, compiler)
    machine = machine_of(
        model, interval, precision="double", parameters="struct",
        name=name, method=method, substeps=substeps, hold="zoh",
    )  # fmt: skip
    identifier = machine.prefix[:-1]
    content = machine.content()
    variables = _variables(machine)
    sources = {f"{identifier}_machine.c": render("machine.c.j2", content)}
    token = f"{{{uuid5(NAMESPACE_URL, ''.join(sources.values()) + repr(variables))}}}"
    content |= {
        "machine_file": f"{identifier}_machine.c",
        "variables": variables,
        "first_state": next(v.reference for v in variables if v.room == "x"),
        "exchanges": exchanges(machine),
        "stubs": fmi_stubs(fmi, exchanges(machine)),
        "token": token,
        "version": VERSIONS[fmi][0],
        "interval": machine.printer.number(machine.interval),
    }
    sources["fmu.c"] = render(f"fmi{fmi}.c.j2", content)
    describe = {2: _description_2, 3: _description_3}[fmi]
    files = {"modelDescription.xml": _xml(describe(machine, variables, token))}
    files |= {f"sources/{file}": text.encode() for file, text in sources.items()}
    if fmi == 3:
        files["sources/buildDescription.xml"] = _xml(_build_description(identifier))
    if compiler is not None:
        library = f"binaries/{VERSIONS[fmi][1]}/{identifier}.so"
        files[library] = _compile(compiler, sources)
    return _write(Path(path), files)


def _check(model, fmi, compiler) -> None:
    if not isinstance(model, PhysicsModel):
        raise OptionError(f"to_fmu: expected a PhysicsModel, got {type(model).__name__}.")
    if fmi not in VERSIONS:
        raise OptionError(f"fmi: expected 2 or 3, got {fmi!r}.")
    if model.inputs and model.simulation.get("hold") == "foh":
        raise ModelError(
            "to_fmu: linearly interpolated inputs (hold 'foh') cannot be exported: the FMU does "
            "not know the next sample. Remedy: model.replace(simulation={'hold': 'zoh'})."
        )
    if compiler is not None and (shutil.which(compiler) is None or sys.platform != "linux"):
        raise OptionError(
            f"compiler: {compiler!r} cannot build a binary here. Remedy: compiler=None for an FMU "
            f"with source code only, which the importing tool compiles."
        )


def exchanges(machine: Machine) -> bool:
    """Return whether rates and outputs define the model, so that any solver can integrate it."""
    return not any(machine.dry) and not machine.model.delays


def _variables(machine: Machine) -> list[Variable]:
    """Return a unit's variables: outputs, states, inputs, parameters, time, rates."""
    model = machine.model
    found: list[Variable] = []
    taken = {*model.inputs, *model.parameters, "time"}

    def add(name, causality, variability, where, **further):
        found.append(Variable(len(found), name, causality, variability, where, **further))

    for i, name in enumerate(model.outputs):
        called = f"output.{name}" if name in taken else name
        add(called, "output", "continuous", f"y[{i}]", unit=model.unit(name), room="y", place=i)
    for i, (name, value) in enumerate(model.initial_state.items()):
        add(f"state.{name}", "local", "continuous", f"machine.x[{i}]",
            start=repr(value), unit=model.unit(name), room="x", place=i)  # fmt: skip
    for i, name in enumerate(model.inputs):
        add(name, "input", "continuous", f"u[{i}]",
            start="0.0", unit=model.unit(name), room="u", place=i)  # fmt: skip
    for name, parameter in model.parameters.items():
        if name not in model.delays.values():
            add(name, "parameter", "tunable", f"parameters.{machine.names[name]}",
                start=repr(parameter.value), unit=parameter.unit)  # fmt: skip
    add("time", "independent", "continuous", "time", unit="s", room="t")
    for i, name in enumerate(model.states if exchanges(machine) else ()):
        add(f"der(state.{name})", "local", "continuous", f"rate[{i}]", room="r", place=i)
    return found


def _description_2(machine: Machine, variables: list[Variable], token: str):
    root = _root(machine, "2.0", guid=token)
    kept = {"modelIdentifier": machine.prefix[:-1], "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true"}  # fmt: skip
    kinds = [_add(root, "ModelExchange", **kept)] if exchanges(machine) else []
    kinds += [_add(root, "CoSimulation", **kept, canHandleVariableCommunicationStepSize="true")]
    for kind in kinds:
        _add(_add(kind, "SourceFiles"), "File", name="fmu.c")
    _add_units(root, variables)
    _add(root, "DefaultExperiment", startTime="0.0", stepSize=repr(machine.interval))
    known = _add(root, "ModelVariables")
    for v in variables:
        scalar = _add(
            known, "ScalarVariable", name=v.name, valueReference=str(v.reference),
            causality=v.causality, variability=v.variability, **_initial(v),
        )  # fmt: skip
        whose = {"derivative": str(_state_of(v, variables) + 1)} if v.room == "r" else {}
        _add(scalar, "Real", **_start_and_unit(v), **whose)
    structure = _add(root, "ModelStructure")
    for part, rooms in (("Outputs", "y"), ("Derivatives", "r"), ("InitialUnknowns", "yr")):
        told = [v for v in variables if v.room in rooms]
        unknowns = _add(structure, part) if told else None
        for v in told:
            _add(unknowns, "Unknown", index=str(v.reference + 1))
    return root


def _description_3(machine: Machine, variables: list[Variable], token: str):
    root = _root(machine, "3.0", instantiationToken=token)
    kept = {"modelIdentifier": machine.prefix[:-1], "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true"}  # fmt: skip
    if exchanges(machine):
        _add(root, "ModelExchange", **kept)
    _add(root, "CoSimulation", **kept, canHandleVariableCommunicationStepSize="true")
    _add_units(root, variables)
    _add(root, "DefaultExperiment", startTime="0.0", stepSize=repr(machine.interval))
    known = _add(root, "ModelVariables")
    for v in variables:
        whose = {"derivative": str(_state_of(v, variables))} if v.room == "r" else {}
        _add(
            known, "Float64", name=v.name, valueReference=str(v.reference), causality=v.causality,
            variability=v.variability, **_initial(v), **_start_and_unit(v), **whose,
        )  # fmt: skip
    structure = _add(root, "ModelStructure")
    for part, rooms in (("Output", "y"), ("ContinuousStateDerivative", "r"),
                        ("InitialUnknown", "yr")):  # fmt: skip
        for v in variables:
            if v.room in rooms:
                _add(structure, part, valueReference=str(v.reference))
    return root


def _initial(v: Variable) -> dict[str, str]:
    """Return how a variable gets its initial value."""
    if v.room == "r":
        return {"initial": "calculated"}
    return {"initial": "exact"} if v.causality in ("local", "parameter") else {}


def _state_of(rate: Variable, variables: list[Variable]) -> int:
    """Return the number of the state that a rate is the derivative of."""
    return next(v.reference for v in variables if v.room == "x" and v.place == rate.place)


def _build_description(identifier: str):
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = _add(root, "BuildConfiguration", modelIdentifier=identifier)
    files = _add(build, "SourceFileSet", language="C99")
    _add(files, "SourceFile", name="fmu.c")
    return root


def _root(machine: Machine, version: str, **token):
    return ElementTree.Element(
        "fmiModelDescription", fmiVersion=version, modelName=machine.model.name, **token,
        generationTool="sklearn_pgnn", variableNamingConvention="structured",
    )  # fmt: skip


def _add_units(root, variables: list[Variable]) -> None:
    units = _add(root, "UnitDefinitions")
    for unit in dict.fromkeys(v.unit for v in variables if v.unit):
        _add(units, "Unit", name=unit)


def _start_and_unit(v: Variable) -> dict[str, str]:
    start = {"start": v.start} if v.start is not None else {}
    return start | ({"unit": v.unit} if v.unit else {})


def _add(parent, tag: str, **attributes: str):
    return ElementTree.SubElement(parent, tag, attributes)


def _xml(root) -> bytes:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _compile(compiler: str, sources: dict[str, str]) -> bytes:
    """Compile a unit and return its binary."""
    with TemporaryDirectory() as folder:
        for file, text in sources.items():
            Path(folder, file).write_text(text, encoding="utf-8")
        command = [compiler, "-O2", "-std=c99", "-shared", "-fPIC", "fmu.c", "-o", "fmu.so", "-lm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise OptionError(f"compiler: {compiler!r} failed: {done.stderr.strip()[:500]}")
        return Path(folder, "fmu.so").read_bytes()


def _write(path: Path, files: dict[str, bytes]) -> Path:
    """Write the unit; the same model gives the same bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, data in files.items():
            archive.writestr(zipfile.ZipInfo(file), data, zipfile.ZIP_DEFLATED)
    return path
