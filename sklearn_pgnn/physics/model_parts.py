"""The parts of a model as they are given: read, and refused where they are not valid."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import fields
from numbers import Integral
from typing import Any

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import (
    parse_expression,
    same_name,
    standard_form,
    to_text,
)
from sklearn_pgnn.physics.parameter import Parameter, check_name

ENERGY_PARTS = ("stored", "supplied", "dissipated")
#: parts of a model that map names to expressions, or to rows of them
EXPRESSIONS = ("equations", "outputs", "inertia", "forces", "capacity", "flows", "energy")
#: inputs between samples: held, or linearly interpolated
HOLDS = ("zoh", "foh")
#: schemes of a step: Runge and Kutta's, and one for stiff models
SCHEMES = ("rk4", "rosenbrock")
#: longest text that is no equation [characters]
MAX_TEXT = 1000
#: most integration steps in a sample interval, and most derivatives of the states
MAX_SUBSTEPS, MAX_DERIVATIVES = 10_000, 50_000


def as_expression(
    item: Any,
    names: tuple[str, ...],
    where: tuple[str, ...],
    let: Mapping[str, sympy.Expr] | None = None,
) -> sympy.Expr:
    """Return an equation as an expression of known names, and of those that stand for one."""
    try:
        if isinstance(item, sympy.Expr):
            return standard_form(item, names, ".".join(where))
        found = parse_expression(item, names, ".".join(where), let=let or {})
        is_written_out = let and any(name in str(item) for name in let)
        return standard_form(found, names, ".".join(where)) if is_written_out else found
    except ModelError as error:
        raise ModelError(str(error), where) from None


def as_expressions(
    part: str,
    items: Mapping[str, Any],
    names: tuple[str, ...],
    let: Mapping[str, sympy.Expr] | None,
) -> dict[str, Any]:
    """Return a part as expressions of known names; a list of them is a row of a matrix."""

    def entry(item: Any, where: tuple[str, ...]) -> sympy.Basic:
        if part in ("inertia", "capacity") and isinstance(item, list | tuple | sympy.Tuple):
            return sympy.Tuple(*(as_expression(each, names, where, let) for each in item))
        return as_expression(item, names, where, let)

    return {key: entry(item, (part, key)) for key, item in dict(items).items()}


def entries_changed(change: Callable[[sympy.Expr], sympy.Expr], items: Mapping) -> dict[str, Any]:
    """Return expressions, and those in rows, each of them changed."""
    return {
        key: sympy.Tuple(*map(change, item)) if isinstance(item, sympy.Tuple) else change(item)
        for key, item in items.items()
    }


def texts(items: Mapping[str, sympy.Basic]) -> dict[str, Any]:
    """Return expressions as text, rows of a matrix as lists."""
    return {
        key: [to_text(each) for each in item] if isinstance(item, sympy.Tuple) else to_text(item)
        for key, item in items.items()
    }


def as_mapping(part: str, items: Any) -> dict:
    """Return a part of a model as a mapping of names to values."""
    if not isinstance(items, Mapping):
        raise ModelError(f"{part}: expected names and values, got {items!r}.", (part,))
    return dict(items)


def as_units(part: str, items: Any) -> dict[str, str]:
    """Return units by name, empty where there is no unit."""
    return {
        name: as_text(str(unit or ""), (part, name))
        for name, unit in as_mapping(part, items).items()
    }


def is_text(text: str) -> bool:
    """Return whether a text can be written: half of a character cannot."""
    return not any("\ud800" <= sign <= "\udfff" for sign in text)


def as_text(text: str, where: tuple[str, ...]) -> str:
    """Return a text that can be written."""
    if not is_text(text):
        raise ModelError(f"{'.'.join(where)}: expected text, got the half of a character.", where)
    if len(text) > MAX_TEXT:
        raise ModelError(
            f"{'.'.join(where)}: expected at most {MAX_TEXT} characters, got {len(text)}.", where
        )
    return text


def as_state(name: str, value: Any) -> float:
    """Return the initial value of a state."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ModelError(
            f"initial_state.{name}: expected a finite number, got {value!r}.",
            ("initial_state", name),
        )
    return number


def as_simulation(settings: Mapping) -> dict:
    """Return the simulation settings, with a plain integer as `substeps`."""
    found, substeps = dict(settings), settings.get("substeps", 1)
    for name, known in (("hold", HOLDS), ("method", SCHEMES)):
        if found.get(name, known[0]) not in known:
            raise ModelError(
                f"simulation.{name}: expected one of {', '.join(known)}, got {found[name]!r}.",
                ("simulation", name),
            )
    whole = isinstance(substeps, Integral) and not isinstance(substeps, bool)
    if not whole or not 1 <= substeps <= MAX_SUBSTEPS:
        raise ModelError(
            f"simulation.substeps: expected an integer >= 1 and <= {MAX_SUBSTEPS}, got "
            f"{substeps!r}.",
            ("simulation", "substeps"),
        )
    return found | ({"substeps": int(substeps)} if "substeps" in found else {})


def as_parameter(name: str, value: Any) -> Parameter:
    """Return a parameter that is given as a `Parameter`, a mapping or a number."""
    if isinstance(value, Parameter):
        if value.name != name:
            raise ModelError(f"parameter {value.name!r} is listed under another name, {name!r}.")
        return value
    if isinstance(value, Mapping):
        known = {f.name for f in fields(Parameter)} - {"name"}
        unknown = sorted(set(value) - known)
        if unknown or "value" not in value:
            raise ModelError(
                f"parameter {name!r}: expected 'value' and optionally {sorted(known - {'value'})}, "
                f"got {sorted(value)}.",
                ("parameters", name),
            )
        return Parameter(name, **value)
    return Parameter(name, value)


def as_parameters(parameters: Any) -> dict[str, Parameter]:
    """Return parameters by name."""
    if isinstance(parameters, Mapping):
        found = {name: as_parameter(name, value) for name, value in parameters.items()}
    else:
        parameters = tuple(parameters)
        strange = [p for p in parameters if not isinstance(p, Parameter)]
        if strange:
            raise ModelError(f"parameters: expected Parameter objects, got {strange[0]!r}.")
        found = {parameter.name: parameter for parameter in parameters}
        if len(found) < len(parameters):
            raise ModelError("expected every parameter once, got the same name twice.")
    return found


def parameter_dict(parameter: Parameter) -> dict:
    """Return a parameter as a dict, without the fields at their defaults."""
    default = Parameter(parameter.name, parameter.value)
    written: dict[str, Any] = {"value": parameter.value}
    for key in ("unit", "bounds", "fixed", "spread"):
        if getattr(parameter, key) != getattr(default, key):
            value = getattr(parameter, key)
            written[key] = list(value) if key == "bounds" else value
    return written


# -- what is refused -------------------------------------------------------------------------------


def check_names(states: Iterable[str], inputs: Iterable[str], parameters: Iterable[str]) -> None:
    """Raise `ModelError` unless every name is valid and used once."""
    seen: dict[str, str] = {}
    for what, names in (("state", states), ("input", inputs), ("parameter", parameters)):
        for name in names:
            check_name(name, what)
            taken = seen.get(same_name(name))
            if taken:
                raise ModelError(
                    f"{what} {name!r}: the name is taken by {taken}.", (f"{what}s", name)
                )
            seen[same_name(name)] = f"{'an' if what == 'input' else 'a'} {what}"


def check_size(states: Collection[str], parameters: Collection[str]) -> None:
    """Raise `ModelError` unless the derivatives of the states fit into memory."""
    count = len(states) * (len(states) + len(parameters))
    if count > MAX_DERIVATIVES:
        raise ModelError(
            f"expected at most {MAX_DERIVATIVES} derivatives of states by states and parameters, "
            f"got {count} ({len(states)} states, {len(parameters)} parameters). Remedy: write "
            f"constants as numbers, or describe the machine with fewer states.",
            ("states",),
        )


def check_inertia(read: Mapping[str, Mapping[str, sympy.Basic]]) -> None:
    """Raise `ModelError` where an inertia or a capacity is zero, or a state has both."""
    for part in ("inertia", "capacity"):
        for state, expression in read[part].items():
            if getattr(expression, "is_zero", False):
                what = "a force" if part == "inertia" else "a flow"
                raise ModelError(
                    f"{part}.{state}: expected what {what} is divided by, got zero.", (part, state)
                )
    both = [state for state in read["inertia"] if state in read["capacity"]]
    if both:
        raise ModelError(
            f"capacity.{both[0]}: the state has an inertia already. Remedy: leave one of them out.",
            ("capacity", both[0]),
        )


def check_settled(
    settled: Mapping[str, str] | None, states: Iterable[str], inputs: Iterable[str]
) -> None:
    """Raise `ModelError` unless `settled` maps states to inputs, or to states that follow none."""
    check_keys("settled", settled, states)
    allowed = {*inputs, *states} - {*(settled or {})}
    for state, followed in dict(settled or {}).items():
        if followed not in allowed:
            raise ModelError(
                f"settled: {state!r} expects an input, or a state that is not settled itself, got "
                f"{followed!r}.",
                ("settled", state),
            )


def check_columns(
    columns: Mapping[str, str] | None,
    states: Iterable[str],
    inputs: Iterable[str],
    outputs: Iterable[str],
) -> None:
    """Raise `ModelError` unless columns have names, none of them that of another quantity."""
    own = ("t", "trajectory", *inputs, *states)
    check_keys("columns", columns, dict.fromkeys((*own, *outputs)))
    for name, column in dict(columns or {}).items():
        if not isinstance(column, str) or not as_text(column, ("columns", name)):
            raise ModelError(
                f"columns.{name}: expected a column's name, got {column!r}.", ("columns", name)
            )
        if name in own and column in own and column != name:
            raise ModelError(
                f"columns.{name}: the column {column!r} has the name of another quantity; "
                "rename one of them.",
                ("columns", name),
            )


def check_keys(part: str, items: Any, known: Iterable[str], complete: bool = False) -> None:
    """Raise `ModelError` unless a part has known names only, and all if it must be complete."""
    items = items or {}
    known = list(known)
    as_mapping(part, items)
    unknown = [key for key in items if key not in known]
    missing = [key for key in known if key not in items] if complete else []
    if unknown:
        expected = ", ".join(known) or "none"
        raise ModelError(
            f"{part}: unknown name {unknown[0]!r}; expected one of {expected}.",
            (part, unknown[0]),
        )
    if missing:
        raise ModelError(f"{part}: the equation of state {missing[0]!r} is missing.", (part,))


def check_delays(delays: Mapping[str, str] | None, parameters: Collection[str]) -> None:
    """Raise `ModelError` unless every delay is a parameter."""
    for delayed, delay in dict(delays or {}).items():
        if delay not in parameters:
            raise ModelError(
                f"delays: {delayed!r} expects a parameter, got {delay!r}.", ("delays", delayed)
            )
