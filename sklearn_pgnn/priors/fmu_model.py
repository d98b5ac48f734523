"""A functional mock-up unit for model exchange as a model, using FMPy."""

import math
import os
import re
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.called_function import LARGEST, POINTS, SMALLEST, calling
from sklearn_pgnn.priors.fmu_instance import UnitFunction

#: numeric types of a unit's variables
REAL = ("Real", "Float64")


def from_fmu(
    path: FilePath,
    parameters: Sequence[str] | Mapping[str, Mapping] | None = None,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    names: Mapping[str, str] | None = None,
    **more: Any,
) -> PhysicsModel:
    r"""Return a model whose rates and outputs a functional mock-up unit (FMU) computes.

    .. math:: \dot x = f(t, x, u, p), \qquad y = g(t, x, u, p)

    The unit must be one for model exchange by FMI 2 or 3, with a binary for this machine. Its
    equations stay hidden: the model calls it like a Python function that cannot be traced, see
    `from_function`. Effects act on its rates, inputs and outputs; a diagnosis takes it as a prior.

    A unit may have conditions (event indicators): they are evaluated anew at every point, so that a
    stop or a saturation inside the unit is stepped over where the simulation meets it. A unit that
    resets its states at an event, has clocks or discrete states, or has memory, is not a function
    of its current state and is refused.

    Parameters
    ----------
    path : str or path-like
        The unit's file. The model stores its content, not its path.
    parameters : sequence of str or mapping of str to dict, optional
        The unit's names of the real parameters that become parameters of the model, with further
        fields of `Parameter` besides value, unit and bounds, which the unit gives; by default the
        tunable ones. All others keep the unit's start values.
    inputs : sequence of str, optional
        The unit's names of the inputs that are given in records; by default all. Others are held
        at the unit's start values.
    outputs : sequence of str, optional
        The unit's names of the measured quantities, any of its real variables; by default its real
        outputs.
    names : mapping of str to str, optional
        The model's name of a variable of the unit; by default the unit's name with underscores
        for all characters but letters and digits.
    **more
        Further parameters of `PhysicsModel`: ``inertia``, ``simulation``, ``columns`` and so on.

    Returns
    -------
    PhysicsModel
        The model. Its initial state is that of the unit.

    Raises
    ------
    ModelError
        If the file is not a unit for model exchange, has no binary for this machine, lacks a named
        variable, or is not a function of its state.

    Examples
    --------
    >>> import tempfile
    >>> from sklearn_pgnn.export import to_fmu
    >>> from sklearn_pgnn.systems import cart_on_spring
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = to_fmu(cart_on_spring(), f"{folder}/cart.fmu", interval=0.01)
    ...     cart = from_fmu(path, names={"state.x": "x", "state.v": "v"})
    >>> print(cart.to_text())
    x' = v
    v' = cart_on_a_spring[v](x, v, force; m, k, d)
    """
    with needed_by("from_fmu"):
        import fmpy
    path = os.fspath(path)
    described = _Described(_description(fmpy, path), path, names or {})
    part_of = {
        "inputs": described.choose("inputs", inputs, lambda v: v.causality == "input"),
        "parameters": described.choose(
            "parameters",
            parameters,
            lambda v: v.causality == "parameter" and v.variability == "tunable" and _is_number(v),
        ),
        "outputs": described.choose(
            "outputs", outputs, lambda v: v.causality == "output" and _is_number(v)
        ),
    }
    archive = Path(path).read_bytes()
    function = UnitFunction(archive, *(tuple(v.name for v in part) for part in part_of.values()))
    try:
        unit = function.unit
    except Exception as error:
        raise ModelError(f"{path}: expected an FMU that starts, got: {error}") from error
    named = PhysicsModel(
        described.units(described.states()),
        dict.fromkeys(described.units(described.states()), 0),
        described.parameters(part_of["parameters"], parameters),
        described.units(part_of["inputs"]),
    )
    seen = list(described.units(part_of["outputs"]))
    results = [*named.states, *(f"output {name}" for name in seen)]
    called = calling(function, path, named, results, _points(unit, named), _name(described))
    if unit.jumps:
        raise ModelError(f"{path}: the FMU resets its states at events. {_NO_MEMORY}")
    found = called.equations
    return PhysicsModel(
        named.states,
        {state: found[state] for state in named.states},
        named.parameters,
        named.inputs,
        {name: found[f"output {name}"] for name in seen},
        **{
            "name": described.description.modelName,
            "initial_state": dict(zip(named.states, unit.start_states, strict=True)),
            **more,
        },
    )


_NO_MEMORY = (
    "A model's rates may depend only on time, states, inputs and parameters. Remedy: export the "
    "part of the machine between such events as an FMU of its own, and model the events as effects."
)


def _description(fmpy, path: str):
    """Return the description of a unit for model exchange that runs here."""
    try:
        found = fmpy.read_model_description(path)
    except FileNotFoundError:
        raise
    except Exception as error:
        said = " ".join(str(error).split())
        raise ModelError(
            f"{path}: expected a functional mock-up unit (FMU), got: {said}"
        ) from error
    if not str(found.fmiVersion).startswith(("2.", "3.")):
        raise ModelError(f"{path}: expected an FMU of FMI 2 or 3, got FMI {found.fmiVersion}.")
    if found.modelExchange is None:
        raise ModelError(
            f"{path}: expected an FMU for model exchange, got one for co-simulation only, which "
            f"steps by itself and does not give its rates. Remedy: export the model for model "
            f"exchange, which most tools offer besides co-simulation."
        )
    if not found.derivatives:
        raise ModelError(f"{path}: expected an FMU with continuous states, got one without.")
    _require_continuous(path)
    _require_binary(fmpy, found, path)
    return found


def _require_continuous(path: str) -> None:
    """Refuse units that declare more than rates; FMPy omits these declarations."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    for v in root.iterfind("ModelVariables/*"):
        marks = {key: value for part in (v, *v) for key, value in part.items()}
        discrete = v.tag == "Clock" or {"clocks", "previous"} & set(marks)
        if discrete or marks.get("reinit") in ("true", "1"):
            name = v.get("name")
            raise ModelError(f"{path}: {name!r} is a clock or changes at events. {_NO_MEMORY}")


def _require_binary(fmpy, found, path: str) -> None:
    kind = found.modelExchange.modelIdentifier
    wanted = fmpy.platform if found.fmiVersion[0] == "2" else fmpy.platform_tuple
    with zipfile.ZipFile(path) as archive:
        held = [name.split("/") for name in archive.namelist() if name.startswith("binaries/")]
    places = sorted({parts[1] for parts in held if len(parts) > 2 and parts[2].startswith(kind)})
    if wanted not in places:
        raise ModelError(
            f"{path}: expected a binary for {wanted}, got {', '.join(places) or 'none'}. Remedy: "
            f"export the FMU for this platform, or build it from its source, by "
            f"fmpy.util.compile_platform_binary({path!r})."
        )


def _is_number(v) -> bool:
    return v.type in REAL and not v.dimensions


class _Described:
    """The unit's description of its variables, and their names in the model."""

    def __init__(self, description, path: str, names: Mapping[str, str]):
        self.description, self.path, self.names = description, path, names
        self.known = {v.name: v for v in description.modelVariables}
        unknown = [name for name in names if name not in self.known]
        if unknown:
            raise ModelError(f"{path}: names: the FMU has no variable {unknown[0]!r}.")

    def states(self) -> list:
        """Return the states, in the unit's order."""
        return [rate.variable.derivative for rate in self.description.derivatives]

    def choose(self, part: str, wanted, default) -> list:
        """Return the variables of a part of the model: the named ones, or the default ones."""
        if wanted is None:
            found = [v for v in self.description.modelVariables if default(v)]
        else:
            found = [self._named(part, name) for name in wanted]
        for v in found:
            if not _is_number(v):
                raise ModelError(
                    f"{self.path}: {part}: expected single real numbers, got {v.name!r}, which is "
                    f"{v.type}. Remedy: {part}=[...] with the names of others; variables that are "
                    f"not named keep their start values."
                )
        return found

    def _named(self, part: str, name: str):
        v = self.known.get(name)
        causality = {"inputs": "input", "parameters": "parameter"}.get(part)
        if v is None or causality not in (None, v.causality):
            fit = [n for n, one in self.known.items() if causality in (None, one.causality)]
            raise ModelError(
                f"{self.path}: {part}: expected names among {', '.join(fit[:30])}, got {name!r}."
            )
        return v

    def name(self, v) -> str:
        """Return the model's name of a variable."""
        return self.names.get(v.name) or re.sub(r"\W+", "_", v.name).strip("_")

    def units(self, variables) -> dict[str, str]:
        """Return names and units; Modelica's ``N.m`` is written ``N m``."""
        return {self.name(v): _unit(v) for v in variables}

    def parameters(self, variables, given) -> dict[str, Any]:
        """Return the unit's data on its parameters, completed by those of the caller."""
        given = given if isinstance(given, Mapping) else {}
        return {
            self.name(v): {
                "value": float(v.start),
                "unit": _unit(v),
                "bounds": (_number(v.min, -math.inf), _number(v.max, math.inf)),
                **given.get(v.name, {}),
            }
            for v in variables
        }


def _unit(v) -> str:
    unit = v.unit or (v.declaredType.unit if v.declaredType is not None else None) or ""
    return "" if unit == "1" else re.sub(r"(?<=[\w)])\.(?=[A-Za-z(])", " ", unit)


def _number(text, otherwise: float) -> float:
    return otherwise if text is None else float(text)


def _name(described: _Described) -> str:
    """Return the name of the unit in an equation."""
    return re.sub(r"\W+", "_", described.description.modelName).strip("_") or "unit"


def _points(unit, named: PhysicsModel) -> list[tuple[float, ...]]:
    """Return random points around the unit's start values, scaled by its nominal values."""
    rng = np.random.default_rng(0)
    n_x, n_u = len(named.states), len(named.inputs)
    scales = np.array([*unit.nominal_states, *[1.0] * n_u])
    start = np.array(unit.start[1 : 1 + n_x + n_u])
    values = np.array([parameter.value for parameter in named.parameters.values()])
    points = []
    for k in range(POINTS):
        sizes = scales * np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST), n_x + n_u))
        near = values * np.exp(0.3 * rng.normal(size=values.size)) if k % 4 >= 2 else values
        moved = start + sizes * rng.normal(size=n_x + n_u)
        points.append((float(rng.uniform(0.0, 10.0)), *moved.tolist(), *near.tolist()))
    return points
