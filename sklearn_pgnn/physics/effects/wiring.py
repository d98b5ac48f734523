"""Wiring: what is connected, signed, or scaled otherwise than the model says.

These effects have no parameter: a sign, an exchange or the factor between two units is right or
wrong. They are no part of the catalogue: where the records show one, it is tried before physics.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import ClassVar

import sympy

from sklearn_pgnn.physics.effect import Effect, Symbols
from sklearn_pgnn.physics.expressions import TIME, expanded, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port, with_coefficients
from sklearn_pgnn.physics.repeated_rates import with_rates
from sklearn_pgnn.physics.shown_states import shown_by

#: powers of two and ten that counters, converters and prefixes put between two numbers
POWERS = (*(2.0**n for n in range(8, 17)), 100.0, 1e3, 1e6)
#: counts a turn of encoders: powers of two, and tens of four edges a line
COUNTS = (*(2**n for n in range(8, 17)), 500, 1000, 2000, 2500, 4000, 5000, 10_000)
#: factors between units that a model uses and others, by the model's unit
UNITS: dict[str, dict[float, str]] = {
    "m": {100.0: "cm", 1e3: "mm", 1e6: "um", 1e-3: "km"},
    "mm": {1e-3: "m", 0.1: "cm", 1e3: "um"},
    "cm": {0.01: "m", 10.0: "mm"},
    "m/s": {3.6: "km/h", 100.0: "cm/s", 1e3: "mm/s"},
    "mm/s": {1e-3: "m/s"},
    "km/h": {1 / 3.6: "m/s"},
    "rad": {180 / math.pi: "deg", 0.5 / math.pi: "rev", 1e3: "mrad"},
    "deg": {math.pi / 180: "rad", 1 / 360: "rev"},
    "rad/s": {180 / math.pi: "deg/s", 30 / math.pi: "rpm", 0.5 / math.pi: "rev/s", 1e3: "mrad/s"},
    "deg/s": {math.pi / 180: "rad/s", 1 / 6: "rpm", 1 / 360: "rev/s"},
    "rpm": {math.pi / 30: "rad/s", 6.0: "deg/s", 1 / 60: "rev/s"},
    "rev/s": {2 * math.pi: "rad/s", 60.0: "rpm", 360.0: "deg/s"},
    "m^3/s": {1e3: "l/s", 6e4: "l/min", 3600.0: "m^3/h"},
    "bar": {1e5: "Pa", 100.0: "kPa", 0.1: "MPa", 1e3: "mbar"},
    "Pa": {1e-5: "bar", 1e-3: "kPa", 1e-6: "MPa"},
    "": {100.0: "%"},
    "1": {100.0: "%"},
    "%": {0.01: "1"},
    "J": {1 / 3600: "Wh", 1e-3: "kJ", 1 / 3.6e6: "kWh"},
}
#: units of time that a file may hold, in seconds
CLOCKS = {"us": 1e-6, "ms": 1e-3, "min": 60.0, "h": 3600.0, "d": 86400.0}
#: most terms of one sum that are turned, and most channels of one unit that are exchanged
MOST = 12
_ON, _IN, _AND = " on ", " in ", " and "


@dataclass(frozen=True)
class Wiring(Effect):
    """A sign, an exchange of channels, or the factor between two units: nothing is fitted."""

    phrase = "{target}"
    lacking = "has a"
    check: ClassVar[str] = "Look at the wiring and the channel list; move one thing at a time."

    def seen_at(self, model: PhysicsModel) -> tuple[str, ...]:
        """Return the outputs that the model cannot follow without it, where that is known."""
        return ()

    def lines(self, model: PhysicsModel) -> str:
        """Return what to write into the model file."""
        changed, said = self.apply(model), dict[str, list[str]]()
        for output, new in changed.outputs.items():
            if new != model.outputs[output]:
                said.setdefault("outputs", []).append(f'{output}: "{to_text(new)}"')
        for state, new in changed.equations.items():
            if new != model.equations[state] and "outputs" not in said:
                part = "flows" if state in model.flows else "equations"
                written = to_text(new * model.capacity[state] if part == "flows" else new)
                said.setdefault(part, []).append(f'{state}: "{written}"')
        return " and ".join(f"{part}: {{{', '.join(lines)}}}" for part, lines in said.items())


#: by channel, the channel that takes its place and the factor
_Taken = Mapping[str, tuple[str, sympy.Expr]]


class _Inputs:
    """The channels that are inputs."""

    @staticmethod
    def channels(model: PhysicsModel) -> tuple[str, ...]:
        """Return their names."""
        return tuple(model.inputs)

    @staticmethod
    def rewired(model: PhysicsModel, taken: _Taken) -> dict:
        """Return the changes where other inputs, by a factor, act in the places of some."""
        new = {symbol(name): factor * symbol(of) for name, (of, factor) in taken.items()}
        changes = model.changed(lambda expression: expression.xreplace(new))
        names = {name: of for name, (of, _) in taken.items()}
        changes["delays"] = {names.get(u, u): delay for u, delay in model.delays.items()}
        changes["settled"] = {state: names.get(u, u) for state, u in model.settled.items()}
        return changes


class _Outputs:
    """The channels that are outputs."""

    channels_of: tuple[str, ...]

    def seen_at(self, model: PhysicsModel) -> tuple[str, ...]:
        """Return the outputs themselves."""
        return self.channels_of

    @staticmethod
    def channels(model: PhysicsModel) -> tuple[str, ...]:
        """Return their names."""
        return tuple(model.outputs)

    @staticmethod
    def rewired(model: PhysicsModel, taken: _Taken) -> dict:
        """Return the changes where some outputs show what others do, by a factor."""

        def shown(items: Mapping[str, sympy.Expr]) -> dict[str, sympy.Expr]:
            new = {name: factor * items.get(of, 0) for name, (of, factor) in taken.items()}
            return {**items, **{name: each for name, each in new.items() if each != 0}}

        ports = {name: replace(p, outputs=shown(p.outputs)) for name, p in model.kept_ports.items()}
        return {"outputs": {**model.outputs, **shown(model.outputs)}, "ports": ports}


class _OfChannels(Wiring):
    """A wiring of inputs or outputs."""

    channels: ClassVar
    rewired: ClassVar


class _Reversed(_OfChannels):
    """A channel with the other sign."""

    phrase = "reversed polarity of {target}"

    @property
    def channels_of(self) -> tuple[str, ...]:
        """The channel."""
        return (self.target,)

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the channels."""
        return cls.channels(model)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Replace the channel by its negative."""
        return self.rewired(model, {self.target: (self.target, sympy.Integer(-1))})


@dataclass(frozen=True)
class ReversedInput(_Inputs, _Reversed):
    r"""An input that acts with the other sign, :math:`-u`."""

    id = "reversed_input"
    summary = "The command acts in the other direction than the model says."


@dataclass(frozen=True)
class ReversedOutput(_Outputs, _Reversed):
    r"""A sensor that reads the other sign, :math:`-y`."""

    id = "reversed_output"
    summary = "The sensor counts in the other direction than the model says."


@dataclass(frozen=True)
class ReversedTerm(Wiring):
    """A term of an equation, as ``"k*x/m in v"``, that has the other sign."""

    id = "reversed_term"
    phrase = "reversed sign of {target}'"
    summary = "A term of the equations has the other sign than the records show."
    check = "Work out the sign of the term by hand, or hold everything else still and look at it."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the terms of the rates that are sums."""
        return tuple(name for rate in model.equations for name in _terms(model, rate))

    def seen_at(self, model: PhysicsModel) -> tuple[str, ...]:
        """Return the outputs that show the state, or the position whose velocity it is.

        Where such an output is followed, all others see the right motion of the state.
        """
        rate = self.target.rsplit(_IN, 1)[1]
        return tuple(output for output in model.outputs if rate in shown_by(model, output))

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Turn the term's sign."""
        rate = self.target.rsplit(_IN, 1)[1]
        turned = expanded(model.equations[rate]) - 2 * _terms(model, rate)[self.target]
        return with_rates(model, {rate: turned})

    def is_sign_of(self, model: PhysicsModel, other: Effect) -> bool:
        """Return whether another effect frees a parameter whose other sign is the term's.

        >>> from sklearn_pgnn.effects import WrongParameter
        >>> rates = {"x": "v", "v": "(k*x - v)/m"}
        >>> spring = PhysicsModel({"x": "m", "v": "m/s"}, rates, {"k": 9.0, "m": 1.0})
        >>> [ReversedTerm("k*x/m in v").is_sign_of(spring, WrongParameter(name)) for name in "km"]
        [True, False]
        """
        if other.parameters(model) or other.target not in model.parameters:
            return False
        turned, p = self.apply(model), symbol(other.target)
        pairs = [(each, turned.equations[s]) for s, each in model.equations.items()]
        pairs += [(each, turned.outputs[name]) for name, each in model.outputs.items()]
        return all(expanded(each.subs(p, -p) - now) == 0 for each, now in pairs)


def _terms(model: PhysicsModel, rate: str) -> dict[str, sympy.Expr]:
    """Return the terms of a rate that is a sum, by their target."""
    terms = sympy.Add.make_args(expanded(model.equations[rate]))
    if not 1 < len(terms) <= MOST:
        return {}
    ordered = sorted(terms, key=sympy.default_sort_key)
    return {f"{to_text(term)}{_IN}{rate}": term for term in ordered}


class _Exchanged(_OfChannels):
    """Two channels of one unit, as ``"left and right"``, whose columns are exchanged."""

    lacking = "has an"

    @property
    def channels_of(self) -> tuple[str, ...]:
        """The two channels."""
        return tuple(self.target.split(_AND))

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the pairs of channels of one unit."""
        pairs = combinations(cls.channels(model)[:MOST], 2)
        alike = (pair for pair in pairs if model.unit(pair[0]) == model.unit(pair[1]))
        return tuple(_AND.join(pair) for pair in alike)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Exchange the channels."""
        (one, other), same = self.target.split(_AND), sympy.Integer(1)
        return self.rewired(model, {one: (other, same), other: (one, same)})


@dataclass(frozen=True)
class ExchangedInputs(_Inputs, _Exchanged):
    r"""Two inputs of one unit whose columns are exchanged."""

    id = "exchanged_inputs"
    phrase = "exchange of inputs {target}"
    summary = "The columns, or the cables, of two inputs are exchanged."


@dataclass(frozen=True)
class ExchangedOutputs(_Outputs, _Exchanged):
    r"""Two outputs of one unit whose columns are exchanged."""

    id = "exchanged_outputs"
    phrase = "exchange of outputs {target}"
    summary = "The columns, or the cables, of two sensors are exchanged."


class Factor(_OfChannels):
    """A channel that the file holds in another unit, or in counts, as ``"1024 on speed"``.

    >>> shaft = PhysicsModel({"w": "rad/s"}, {"w": "-w"})
    >>> OutputFactor.targets(shaft)[1], OutputFactor.title("162.974661726 on w")
    ('9.54929658551 on w', 'factor 163 (1024 counts a turn) on w')
    """

    phrase = "factor {target}"
    check = "Compare one reading with an instrument, and look up the unit of the column."
    #: power of the factor in what acts or is shown
    power: ClassVar[int]

    @property
    def factor(self) -> float:
        """What the file holds, over what the model means."""
        return float(self.target.split(_ON, 1)[0])

    @property
    def quantity(self) -> str:
        """The input or output."""
        return self.target.split(_ON, 1)[1]

    @property
    def channels_of(self) -> tuple[str, ...]:
        """The channel."""
        return (self.quantity,)

    @property
    def of_output(self) -> float:
        """How many times larger the outputs then are, if all depends on the channel."""
        return self.factor**self.power

    @classmethod
    def title(cls, target: str) -> str:
        """Return the name, the factor in few digits, with the counts that it may stand for."""
        factor, name = target.split(_ON, 1)
        turn = 2 * math.pi * float(factor)
        counts = f" ({turn:.0f} counts a turn)" if _is_one_of(turn, COUNTS) else ""
        return f"factor {float(factor):.4g}{counts} on {name}"

    @classmethod
    def can_act(cls, target: str, model: PhysicsModel) -> bool:
        """Return whether the model has the channel."""
        return target.split(_ON, 1)[-1] in cls.channels(model)

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return every factor of every channel."""
        pairs = ((f, name) for name in cls.channels(model) for f in _factors(model.unit(name)))
        return tuple(dict.fromkeys(f"{factor:.12g}{_ON}{name}" for factor, name in pairs))

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Multiply what the output shows by the factor, or divide the input by it."""
        factor = _number(self.of_output)
        return self.rewired(model, {self.quantity: (self.quantity, factor)})

    def unit(self, model: PhysicsModel) -> str:
        """Return the unit that the factor makes of the model's; empty where none is known."""
        known = UNITS.get(model.unit(self.quantity).strip(), {})
        return next((unit for f, unit in known.items() if _is_one_of(f, [self.factor])), "")

    def lines(self, model: PhysicsModel) -> str:
        """Return the column with its unit where there is one, else the factor in the equations."""
        unit = self.unit(model)
        if not unit:
            return super().lines(model)
        title = model.columns.get(self.quantity, self.quantity).split(" [")[0]
        return f'columns: {{{self.quantity}: "{title} [{unit}]"}}'


def _factors(unit: str) -> Iterator[float]:
    """Yield what a file may hold over a quantity of a unit: other units, counts, powers."""
    known = UNITS.get(unit.strip(), {})
    turn = next((factor for factor, to in known.items() if to.startswith("rev")), 0.0)
    yield from known
    yield from (turn * counts for counts in COUNTS if turn)
    yield from POWERS
    yield from (1 / power for power in POWERS)


def _is_one_of(value: float, known: Iterable[float]) -> bool:
    return any(math.isclose(value, each, rel_tol=1e-9) for each in known)


def _number(value: float) -> sympy.Expr:
    """Return a number as a whole one, the part of a whole one, or that over a turn, if it is."""
    for unit in (sympy.Integer(1), 1 / (2 * sympy.pi)):
        for power in (1, -1):
            whole = (value / float(unit)) ** power
            if math.isclose(whole, round(whole), rel_tol=1e-11):
                return sympy.Integer(round(whole)) ** power * unit
    return sympy.Float(value)


@dataclass(frozen=True)
class InputFactor(_Inputs, Factor):
    r"""An input whose column holds :math:`c\,u`."""

    id = "input_factor"
    power = -1
    summary = "The column of the input holds another unit than the model's, or counts."


@dataclass(frozen=True)
class OutputFactor(_Outputs, Factor):
    r"""An output whose column holds :math:`c\,y`."""

    id = "output_factor"
    power = 1
    summary = "The column of the output holds another unit than the model's, or counts."


@dataclass(frozen=True)
class OtherClock(Wiring):
    r"""A time in another unit than seconds: :math:`dx/d\tau = c\,f(c\,\tau, x, u)`."""

    id = "other_clock"
    phrase = "time in {target}"
    summary = "The column of the time is in another unit than seconds."
    check = "Compare the length of a record with a watch."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the units of time; with delayed inputs none, since delays are parameters."""
        return () if model.delays else tuple(CLOCKS)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Let the model run at the pace of the file's time."""
        second = _number(CLOCKS[self.target])
        rates = {s: second * e.subs(TIME, second * TIME) for s, e in model.equations.items()}
        outputs = {s: e.subs(TIME, second * TIME) for s, e in model.outputs.items()}
        ports = {n: self._paced(port, second) for n, port in model.kept_ports.items()}
        return {"equations": rates, "outputs": outputs, "ports": ports}

    def _paced(self, port: Port, second: sympy.Expr) -> Port:
        """Return a port at the pace of the file's time."""
        later = with_coefficients(port, lambda each: each.subs(TIME, second * TIME))
        return replace(later, rates={s: second * b for s, b in later.rates.items()})

    def lines(self, model: PhysicsModel) -> str:
        """Return the column of the time with its unit."""
        title = model.columns.get("t", "t").split(" [")[0]
        return f'columns: {{t: "{title} [{self.target}]"}}'


#: every kind of wiring, in the order in which they are named where several explain records alike
WIRINGS: tuple[type[Wiring], ...] = (
    ReversedOutput,
    ReversedInput,
    ExchangedOutputs,
    ExchangedInputs,
    OutputFactor,
    InputFactor,
    OtherClock,
    ReversedTerm,
)
