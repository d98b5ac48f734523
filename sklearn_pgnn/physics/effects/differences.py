"""What differs between records: a parameter, a sensor or an input that is another in some."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import sympy

from sklearn_pgnn.physics.effect import Effect, quantity
from sklearn_pgnn.physics.effects.inputs import substitute
from sklearn_pgnn.physics.effects.targets import parts
from sklearn_pgnn.physics.expressions import symbol

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel
    from sklearn_pgnn.physics.scales import Scales

#: what the column of a group of records begins with, before their names
IN = "in_"
#: what stands between them
AND = "__"
#: and before the time from which on they differ
SINCE = "__since_"
#: the time from which on what changes evenly changes no more
TO = "__to_"
#: the column that rises in equal steps from zero in the first record to one in the last
TREND = f"{IN}sequence"
#: stands for all records, and a column whose records are too many to name
ALL = "all"
_NUMBERED = re.compile(r"group_\d+")
_COLUMN = re.compile(rf"{IN}(.*?)(?:{SINCE}([\dp]+)(?:{TO}([\dp]+))?)?")
#: share of its value that a parameter at least keeps where its bounds set no limit
LEFT = 0.001


def where_of(column: str) -> str:
    """Return the records of a group's column, and since when, as in a sentence."""
    if column == TREND:
        return "from record to record"
    records, since, until = parsed(column)
    *first, last = records.split(AND)
    where = f"in {', '.join(first)} and {last}" if first else f"in {last}"
    if since is None:
        return where
    when = f"since {since:g} s" if until is None else f"between {since:g} and {until:g} s"
    return when if records == ALL else f"{where} {when}"


def changes_evenly(column: str) -> bool:
    """Return whether a column goes from zero to one in many steps."""
    return column == TREND or parsed(column)[2] is not None


def parsed(column: str) -> tuple[str, float | None, float | None]:
    """Return the records of a group's column, since when they differ, and until when it grows.

    >>> parsed("in_run_2__since_1p5__to_60")
    ('run_2', 1.5, 60.0)
    """
    if (found := _COLUMN.fullmatch(column)) is None:
        return column, None, None
    since, until = (float(time.replace("p", ".")) if time else None for time in found.groups()[1:])
    return found[1], since, until


def mark_at(t: np.ndarray, since: float | None, until: float | None) -> np.ndarray:
    """Return one, from an onset on if there is one, or evenly from zero there to one at an end.

    >>> mark_at(np.arange(5.0), 1.0, None), mark_at(np.arange(5.0), 1.0, 3.0)
    (array([0., 1., 1., 1., 1.]), array([0. , 0. , 0.5, 1. , 1. ]))
    """
    if until is not None and since is not None:
        return np.clip((t - since) / (until - since), 0.0, 1.0)
    return (t >= (-np.inf if since is None else since)).astype(float)


def values_of(column: str) -> str:
    """Return what a group's column holds.

    >>> values_of("in_run_2"), values_of("in_sequence")
    ('1 in run_2 and 0 elsewhere', '0 in the first record to 1 in the last')
    """
    if column == TREND:
        return "0 in the first record to 1 in the last"
    return f"{'0 to 1' if changes_evenly(column) else '1'} {where_of(column)} and 0 elsewhere"


def mark_of(column: str, records: tuple[str, ...]) -> tuple[float, str]:
    """Return the value of a group's column where it is not given, and what is said of it.

    Examples
    --------
    >>> mark_of("in_sequence", ("run_1", "run_3"))
    (1.0, 'from 0 in run_1 to 1 in run_3, got none: all are taken to be like the last')
    """
    if column == TREND:
        return 1.0, (
            f"from 0 in {records[0]} to 1 in {records[-1]}, got none: all are taken to be like the "
            f"last"
        )
    of = ", ".join(records)
    return 0.0, (
        f"1 in trajectories like {of} and 0 in others, got none: all are taken to be like the "
        f"others"
    )


def mark_by_name(column: str, names: Iterable[str], t: np.ndarray) -> np.ndarray | None:
    """Return the column of a group in a record that may have any of some names.

    The time [s] counts from the record's first sample. None where the column names no records.

    >>> mark_by_name("in_run_2__run_4__since_1p5", ["run-4"], np.arange(3.0))
    array([0., 0., 1.])
    >>> mark_by_name("in_group_3", ["run-4"], np.arange(3.0))
    """
    records, since, until = parsed(column)
    if column == TREND or _NUMBERED.fullmatch(records):
        return None
    members = f"{AND}{records}{AND}"
    is_in = records == ALL or any(f"{AND}{cleaned(name)}{AND}" in members for name in names)
    return is_in * mark_at(t, since, until)


def cleaned(name: str) -> str:
    """Return the name of a record as it stands in a column.

    >>> cleaned("day 2/run-1")
    'day_2_run_1'
    """
    return re.sub(r"\W+", "_", name)


def is_mark(model: PhysicsModel, name: str) -> bool:
    """Return whether an input says in which records, or since when, something differs."""
    return name.startswith(IN) and model.inputs.get(name, "s") in ("", "1")


@dataclass(frozen=True)
class Difference(Effect):
    """A quantity that is another where a column, an input, is one: in some records, or later on.

    A diagnosis makes such a column where records differ; the model as given has none.
    """

    check = "Look for what was different there: load, temperature, tool, wear, supply, a leak."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return none: which records differ is found in these."""
        return ()

    @classmethod
    def quantities_of(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the quantities that may differ between records."""
        raise NotImplementedError

    @classmethod
    def can_act(cls, target: str, model: PhysicsModel) -> bool:
        """Return whether the model has the quantity and the column."""
        what, column = parts(target)
        return what in cls.quantities_of(model) and column in model.inputs

    @classmethod
    def title(cls, target: str) -> str:
        """Return what differs, and where."""
        what, column = parts(target)
        phrase = cls.phrase.format(target=what)
        if changes_evenly(column):
            return f"{phrase} that changes {where_of(column)}"
        return f"another {phrase} {where_of(column)}"

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return the unit of the quantity."""
        return {"target": model.unit(parts(self.target)[0])}

    @classmethod
    def typical(cls, target: str, model: PhysicsModel, scales: Scales) -> dict[str, float]:
        """Return the size of the quantity: of a parameter its value, 1 where it is 0."""
        what = parts(target)[0]
        known = model.parameters.get(what)
        return {"target": scales.typical[what] if known is None else abs(known.value) or 1.0}


@dataclass(frozen=True)
class ParameterDifference(Difference):
    r"""A parameter with another value in some records, :math:`p + \Delta\, g`.

    The column :math:`g` is one in these records and zero in all others.
    """

    difference: float = quantity("diff", "{target}")
    id = "parameter_difference"
    phrase = "{target}"
    summary = "This parameter has another value there."

    @classmethod
    def quantities_of(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the parameters that may be re-tuned."""
        return model.free_parameters

    def summarise(self, model: PhysicsModel) -> str:
        """Return both values.

        >>> from sklearn_pgnn.physics import PhysicsModel
        >>> box = PhysicsModel({"T": "K"}, {"T": "-U*T"}, {"U": 7.0}, {"in_run_2": ""})
        >>> other = ParameterDifference("U(in_run_2)", difference=6.0)
        >>> other.summarise(box + other)
        'U is 7, and 13 in run_2.'
        """
        parameter, column = parts(self.target)
        unit, values = model.unit(parameter), model.parameters
        usual = values[parameter].value
        there = usual + values[self.names()["difference"]].value
        said = [f"{value:.4g} {unit}".rstrip() for value in (usual, there)]
        if column == TREND:
            return f"{parameter} goes from {said[0]} in the first record to {said[1]} in the last."
        if changes_evenly(column):
            return f"{parameter} goes from {said[0]} to {said[1]} {where_of(column)}."
        return f"{parameter} is {said[0]}, and {said[1]} {where_of(column)}."

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Add the difference to the parameter."""
        parameter, column = map(symbol, parts(self.target))
        return substitute(model, parameter, parameter + p["difference"] * column)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the parameter within its bounds, and its sign where it has one."""
        known = model.parameters[parts(target)[0]]
        low, high = known.bounds
        if low == 0.0 and known.value > 0.0:
            low = LEFT * known.value
        return {"difference": (low - known.value, high - known.value)}


class SensorDifference(Difference):
    """A sensor that is another in some records."""

    @classmethod
    def quantities_of(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the outputs."""
        return tuple(model.outputs)


@dataclass(frozen=True)
class SensorBiasDifference(SensorDifference):
    r"""A sensor with an offset in some records, :math:`y + b\, g`."""

    bias: float = quantity("diffb", "{target}")
    id = "sensor_bias_difference"
    phrase = "zero of {target}"
    summary = "The sensor has another zero there."

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Add the offset to the output."""
        output, column = parts(self.target)
        shown = model.outputs[output] + p["bias"] * symbol(column)
        return {"outputs": {**model.outputs, output: shown}}


@dataclass(frozen=True)
class SensorGainDifference(SensorDifference):
    r"""A sensor with another gain in some records, :math:`y\,(1 + e\, g)`."""

    error: float = quantity("diffg", "", low=-1.0)
    id = "sensor_gain_difference"
    phrase = "gain of {target}"
    summary = "The sensor has another gain there."

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Multiply the output by its gain."""
        output, column = parts(self.target)
        shown = model.outputs[output] * (1 + p["error"] * symbol(column))
        return {"outputs": {**model.outputs, output: shown}}


@dataclass(frozen=True)
class InputGainDifference(Difference):
    r"""An input that acts with another gain in some records, :math:`u\,(1 + e\, g)`."""

    error: float = quantity("diffi", "", low=-1.0)
    id = "input_gain_difference"
    phrase = "gain of {target}"
    summary = "The input acts with another gain there."

    @classmethod
    def quantities_of(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the inputs."""
        return tuple(name for name in model.inputs if not is_mark(model, name))

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Multiply the input by its gain."""
        signal, column = map(symbol, parts(self.target))
        return substitute(model, signal, signal * (1 + p["error"] * column))


#: all of them, the frequent first
DIFFERENCES: tuple[type[Difference], ...] = (
    ParameterDifference,
    SensorBiasDifference,
    SensorGainDifference,
    InputGainDifference,
)
