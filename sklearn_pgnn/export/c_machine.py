"""A model as one C99 file."""

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.export.assignments import (
    Assignments,
    outputs_of,
    rates_by_signs_of,
    rates_of,
)
from sklearn_pgnn.export.c_expression import CPrinter, c_name, c_names
from sklearn_pgnn.export.sample_steps import explicit_substeps, late_inputs
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.complementarity import MAX_PIVOTS, SWEEPS
from sklearn_pgnn.simulation.complementarity import ROUNDING as ROUNDED
from sklearn_pgnn.simulation.model_function import METHODS
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.stepping import AT_REST, MAX_EVENTS
from sklearn_pgnn.trajectories.clock import check_sample_interval

PRECISIONS = {"double": "double", "single": "float"}
KEPT = ("constants", "struct")
#: shares that are rounding, of a difference and of a pivot
ROUNDING = {"double": (AT_REST, ROUNDED), "single": (1e-6, 1e-5)}


class Machine:
    """A model with its export options, and the variables of the template.

    The interval is in seconds; `parameters` are written into the equations as ``"constants"``, or
    kept in a ``"struct"``; `name` is the prefix of all names. By `hold`, the inputs are held
    (``"zoh"``) or linearly interpolated between samples (``"foh"``).
    """

    def __init__(self, model, interval, precision, parameters, name, method, substeps, hold):
        self.model, self.interval = model, float(interval)
        self.precision, self.by_struct = precision, parameters == "struct"
        self.prefix, self.method, self.substeps, self.hold = f"{name}_", method, substeps, hold
        self.printer = CPrinter(precision == "single", self.prefix)
        self.dry = dry_friction(model).rows
        sides = map(_side, range(len(self.dry)))
        self.names = c_names((*model.states, *model.inputs, *model.parameters, *sides))

    def content(self, *, with_rates: bool = True) -> dict[str, Any]:
        """Return the template's variables."""
        model, number = self.model, self.printer.number
        rates, outputs = rates_of(model) if with_rates else None, outputs_of(model)
        uses_time = any(code.uses_time for code in (rates, outputs) if code is not None)
        nodes, weights = METHODS[self.method]
        return {
            "n": self.prefix,
            "real": PRECISIONS[self.precision],
            "title": comment(model.name),
            "about": self.about(),
            "interval": repr(self.interval),
            "nx": len(model.states),
            "nu": len(model.inputs),
            "ny": len(model.outputs),
            "places": self._places(),
            "states": [{"start": self._start(state)} for state in model.states],
            "follows": any(name in model.inputs for name in model.settled.values()),
            "keeps_side": bool(self.dry),
            **self._friction(rates, outputs),
            "delays": self._delays(),
            "by_struct": self.by_struct,
            "parameters": self._parameters(),
            "take_p": f"const {self.prefix}parameters *p, " if self.by_struct else "",
            "pass_p": f", const {self.prefix}parameters *p" if self.by_struct else "",
            "give_p": "p, " if self.by_struct else "",
            "rates": None if rates is None else self.written(rates),
            "outputs": self.written(outputs),
            "terms": None,
            "hidden": 0,
            "features": 0,
            "given_u": self._given_u,
            "nodes": [number(node) for node in nodes],
            "weights": [number(weight) for weight in weights],
            "step": number(self.interval / self.substeps),
            "substeps": self.substeps,
            "foh": self.hold == "foh" and bool(model.inputs),
            "max_events": MAX_EVENTS,
            "uses_time": uses_time,
            "time": self.time() if uses_time else "0",
            "helpers": self.printer,
        }

    def _friction(self, rates, outputs) -> dict[str, Any]:
        """Return what the template needs for dry friction."""
        number = self.printer.number
        shares = dict(zip(("at_rest", "rounding"), ROUNDING[self.precision], strict=True))
        alone = [[m for m, c in enumerate(row) if c] for row in self.dry]
        parts = [*zip(self.dry, alone, strict=True)]
        by_sides = rates_by_signs_of(self.model) if rates and self.dry else None
        return {
            "nd": len(self.dry),
            "flows": [[number(c) for c in row] for row in self.dry],
            "own": [states[0] if len(states) == 1 else -1 for states in alone],
            "by_sides": None if by_sides is None else self.written(by_sides),
            "moving": [[f"{number(row[m])}*x[{m}]" for m in states] for row, states in parts],
            "shows_side": rates is not None and "s" in outputs.arrays,
            "moves_side": rates is None and "s" in outputs.arrays,
            "max_pivots": MAX_PIVOTS,
            "sweeps": SWEEPS,
            **{name: number(share) for name, share in shares.items()},
        }

    def _given_u(self, name: str = "u") -> str:
        """Return the argument that holds the inputs, if there are any."""
        count = len(self.model.inputs)
        return f", const {PRECISIONS[self.precision]} {name}[{count}]" if count else ""

    def about(self) -> list[str]:
        """Return the lines that describe the machine."""
        model = self.model
        told = {"states": model.states, "inputs": model.inputs, "outputs": model.outputs}
        lines = [
            f"{what:8} {', '.join(_with_unit(model, name) for name in names)}"
            for what, names in told.items()
            if names
        ]
        return [*lines, "", *comment(model.to_text(), lines=True)]

    def written(self, code: Assignments, further: Mapping[str, float] | None = None) -> dict:
        """Return the body of a straight-line function."""
        real = PRECISIONS[self.precision]
        names, declared = {}, []
        for local, (array, place) in code.places.items():
            names[local], value = self._argument(array, place, further or {})
            declared.append(f"const {real} {names[local]} = {value};")
        for name, expression in code.shared.items():
            declared.append(f"const {real} {name} = {self.printer.write(expression, names)};")
        results = [self.printer.write(result, names) for result in code.results]
        used = {"t": code.uses_time, "x": "x" in code.arrays}
        used |= {"u": "u" in code.arrays} if self.model.inputs else {}
        used |= {"side": "s" in code.arrays} if self.dry else {}
        used |= {"p": any("p->" in line for line in declared)} if self.by_struct else {}
        unused = [name for name, is_used in used.items() if not is_used]
        return {"declared": declared, "results": results, "unused": unused}

    def _argument(self, array: str, place: int, further: Mapping[str, float]) -> tuple[str, str]:
        """Return the name of an argument, and its value."""
        model = self.model
        if array == "s":
            return self.names[_side(place)], f"side[{place}]"
        if array in "xu":
            name = self.names[list(model.states if array == "x" else model.inputs)[place]]
            return name, f"{array}[{place}]"
        values = {name: parameter.value for name, parameter in model.parameters.items()}
        name, value = list({**values, **further}.items())[place]
        if name in further or not self._is_adjustable(name):
            return self.names.get(name, c_name(name)), self.printer.number(value)
        return self.names[name], f"p->{self.names[name]}"

    def _is_adjustable(self, name: str) -> bool:
        """Return whether a parameter is part of the struct; a delay is built in."""
        return self.by_struct and name not in self.model.delays.values()

    def _parameters(self) -> list[dict]:
        values = self.model.parameters.items()
        return [
            {
                "name": self.names[name],
                "value": self.printer.number(parameter.value),
                "comment": f" /* {comment(parameter.unit)} */" if parameter.unit else "",
            }
            for name, parameter in values
            if self._is_adjustable(name)
        ]

    def _places(self) -> list[dict]:
        """Return the names of the elements of x, u and y."""
        model = self.model
        rooms = {"x": model.states, "u": model.inputs, "y": model.outputs}
        return [
            {
                "name": f"{self.prefix}{room}_{written}",
                "place": place,
                "comment": f" /* {comment(model.unit(name))} */" if model.unit(name) else "",
            }
            for room, names in rooms.items()
            for place, (name, written) in enumerate(c_names(names, ()).items())
        ]

    def _start(self, state: str) -> str:
        followed = self.model.settled.get(state)
        if followed in self.model.inputs:
            return f"u[{list(self.model.inputs).index(followed)}]"
        return self.printer.number(self.model.initial_state[followed or state])

    def time(self) -> str:
        """Return the time of the current sample."""
        real = PRECISIONS[self.precision]
        return f"({real})machine->sample*{self.printer.number(self.interval)}"

    def _delays(self) -> list[dict]:
        """Return how every delayed input is formed from its past samples."""
        return [
            {
                "name": self.names[late.name],
                "place": late.place,
                "length": late.samples + 1,
                "recent": self.printer.number(1.0 - late.share),
                "before": self.printer.number(late.share),
            }
            for late in late_inputs(self.model, self.interval)
        ]


def machine_of(model, interval, *, precision, parameters, name, method, substeps, hold) -> Machine:
    """Return a model with its options, those of `to_c`, checked."""
    check_sample_interval(
        interval,
        remedy="Remedy: to_c(model, 0.01) for a loop that runs a hundred times a second.",
    )
    for option, value, known in (
        ("precision", precision, PRECISIONS),
        ("parameters", parameters, KEPT),
        ("method", method, METHODS),
    ):
        if value not in known:
            raise OptionError(f"{option}: expected one of {', '.join(known)}, got {value!r}.")
    substeps = explicit_substeps(model, substeps, interval)
    name = c_name(model.name if name is None else name)
    return Machine(
        model, interval, precision, parameters, name, method, substeps, hold_of(model, hold)
    )


def render(template: str, content: Mapping[str, Any]) -> str:
    """Return a template of this package with its variables filled in."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    place = files("sklearn_pgnn.export")
    loader = FunctionLoader(lambda name: place.joinpath(name).read_text(encoding="utf-8"))
    room = Environment(
        loader=loader,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    return room.get_template(template).render(**content)


def comment(text: str, *, lines: bool = False):
    """Return a text that is safe in a C comment, on one line or with its `lines` as a list.

    >>> comment("m*/s" + chr(10) + "x")
    'm* /s x'
    """
    kept = text.splitlines() if lines else [" ".join(text.split())]
    safe = [line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?") for line in kept]
    safe = ["".join(c if c.isprintable() else "?" for c in line) for line in safe]
    return safe if lines else safe[0]


def _side(i: int) -> str:
    """Return the name of the sign in a dry friction."""
    return f"side {i}"


def _with_unit(model: PhysicsModel, name: str) -> str:
    unit = model.unit(name)
    return comment(f"{name} [{unit}]" if unit else name)
