"""Wiring: what is connected, signed, or scaled otherwise than the model says.

These effects have no parameter: a sign, an exchange or the factor between two units is right or
wrong. They are no part of the catalogue: where the records show one, it is tried before physics.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import ClassVar

import sympy

from sklearn_pgnn.physics.effect import Effect, Scales
from sklearn_pgnn.physics.effects.inputs import substitute
from sklearn_pgnn.physics.expansion import expanded
from sklearn_pgnn.physics.expressions import TIME, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import Port, with_coefficients
from sklearn_pgnn.physics.repeated_rates import with_output, with_rates

#: powers of two and ten that counters, converters and prefixes put between two numbers
POWERS = (*(2.0**n for n in range(8, 17)), 100.0, 1e3, 1e6)
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
    "deg/s": {math.pi / 180: "rad/s", 1 / 6: "rpm"},
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

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Return the effect itself: there is nothing to fit."""
        return (cls(target),)

    def lines(self, model: PhysicsModel) -> str:
        """Return what to write into the model file."""
        changed = self.apply(model)
        for part in ("outputs", "equations"):
            now, before = getattr(changed, part), getattr(model, part)
            said = [f'{key}: "{to_text(e)}"' for key, e in now.items() if e != before[key]]
            if said:
                return f"{part}: {{{', '.join(said)}}}"
        return ""


@dataclass(frozen=True)
class ReversedInput(Wiring):
    r"""An input that acts with the other sign, :math:`-u`.

    Parameters
    ----------
    target : str
        The input.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> print((lag + ReversedInput("u")).to_text())
    y' = (-u - y)/T
    """

    id = "reversed_input"
    phrase = "reversed polarity of {target}"
    summary = "The command acts in the other direction than the model says."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the inputs."""
        return tuple(model.inputs)

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Replace the input by its negative."""
        return substitute(model, symbol(self.target), -symbol(self.target))


@dataclass(frozen=True)
class ReversedOutput(Wiring):
    r"""A sensor that reads the other sign, :math:`-y`.

    Parameters
    ----------
    target : str
        The output.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> (lag + ReversedOutput("y")).outputs["y"]
    -y
    """

    id = "reversed_output"
    phrase = "reversed polarity of {target}"
    summary = "The sensor counts in the other direction than the model says."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the outputs."""
        return tuple(model.outputs)

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Replace the output by its negative."""
        return with_output(model, self.target, lambda shown: -shown)


@dataclass(frozen=True)
class ReversedTerm(Wiring):
    r"""A term of an equation that has the other sign.

    Parameters
    ----------
    target : str
        The term and its equation, as ``"k*x/m in v"``.

    Examples
    --------
    >>> rates = {"x": "v", "v": "(k*x - v)/m"}
    >>> spring = PhysicsModel({"x": "m", "v": "m/s"}, rates, {"k": 9.0, "m": 1.0})
    >>> ReversedTerm.targets(spring)
    ('-v/m in v', 'k*x/m in v')
    >>> print((spring + ReversedTerm("k*x/m in v")).to_text())
    x' = v
    v' = -k*x/m - v/m
    """

    id = "reversed_term"
    phrase = "reversed sign of {target}'"
    summary = "A term of the equations has the other sign than the records show."
    check = "Work out the sign of the term by hand, or hold everything else still and look at it."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the terms of the rates that are sums."""
        return tuple(name for rate in model.equations for name in _terms(model, rate))

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Turn the term's sign."""
        rate = self.target.rsplit(_IN, 1)[1]
        turned = expanded(model.equations[rate]) - 2 * _terms(model, rate)[self.target]
        return with_rates(model, {rate: turned})


def _terms(model: PhysicsModel, rate: str) -> dict[str, sympy.Expr]:
    """Return the terms of a rate that is a sum, by their target."""
    terms = sympy.Add.make_args(expanded(model.equations[rate]))
    if not 1 < len(terms) <= MOST:
        return {}
    ordered = sorted(terms, key=sympy.default_sort_key)
    return {f"{to_text(term)}{_IN}{rate}": term for term in ordered}


@dataclass(frozen=True)
class ExchangedInputs(Wiring):
    r"""Two inputs of one unit whose columns are exchanged.

    Parameters
    ----------
    target : str
        The two, as ``"left and right"``.

    Examples
    --------
    >>> pair = PhysicsModel({"y": "m"}, {"y": "2*a - b - y"}, inputs={"a": "V", "b": "V"})
    >>> print((pair + ExchangedInputs("a and b")).to_text())
    y' = -a + 2*b - y
    """

    id = "exchanged_inputs"
    phrase = "exchange of inputs {target}"
    lacking = "has an"
    summary = "The columns, or the cables, of two inputs are exchanged."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the pairs of inputs of one unit."""
        return tuple(_pairs(model, model.inputs))

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Exchange the inputs wherever the model uses them."""
        one, other = map(symbol, self.target.split(_AND))
        return _substitute_both(model, {one: other, other: one})


@dataclass(frozen=True)
class ExchangedOutputs(Wiring):
    r"""Two outputs of one unit whose columns are exchanged.

    Parameters
    ----------
    target : str
        The two, as ``"left and right"``.

    Examples
    --------
    >>> pair = PhysicsModel({"a": "m", "b": "m"}, {"a": "-a", "b": "a - b"})
    >>> dict((pair + ExchangedOutputs("a and b")).outputs)
    {'a': b, 'b': a}
    """

    id = "exchanged_outputs"
    phrase = "exchange of outputs {target}"
    lacking = "has an"
    summary = "The columns, or the cables, of two sensors are exchanged."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the pairs of outputs of one unit."""
        return tuple(_pairs(model, model.outputs))

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Exchange what the two show."""
        one, other = self.target.split(_AND)
        shown, names = model.outputs, {one: other, other: one}
        ports = {
            name: replace(port, outputs={names.get(n, n): c for n, c in port.outputs.items()})
            for name, port in model.kept_ports.items()
        }
        return {"outputs": {**shown, one: shown[other], other: shown[one]}, "ports": ports}


def _pairs(model: PhysicsModel, names) -> Iterator[str]:
    """Yield the pairs of channels of one unit."""
    for one, other in combinations(list(names)[:MOST], 2):
        if model.unit(one) == model.unit(other):
            yield f"{one}{_AND}{other}"


def _substitute_both(model: PhysicsModel, exchanged: Mapping) -> dict:
    """Return the changes by a simultaneous substitution in every expression of a model."""
    changes = model.changed(lambda expression: expression.xreplace(exchanged))
    names = {str(a): str(b) for a, b in exchanged.items()}
    changes["delays"] = {names.get(u, u): delay for u, delay in model.delays.items()}
    changes["settled"] = {state: names.get(u, u) for state, u in model.settled.items()}
    return changes


@dataclass(frozen=True)
class Factor(Wiring):
    """A quantity that the file holds in another unit, or in counts."""

    phrase = "factor {target}"
    check = "Compare one reading with an instrument, and look up the unit of the column."

    @classmethod
    def of(cls, model: PhysicsModel, name: str) -> tuple[str, ...]:
        """Return the targets of one quantity: every factor of its unit, and powers of two and ten.

        Examples
        --------
        >>> shaft = PhysicsModel({"w": "rad/s"}, {"w": "-w"})
        >>> OutputFactor.of(shaft, "w")[1]
        '9.54929658551 on w'
        """
        known = UNITS.get(model.unit(name).strip(), {})
        factors = [*known, *POWERS, *(1 / power for power in POWERS)]
        return tuple(dict.fromkeys(f"{factor:.12g}{_ON}{name}" for factor in factors))

    @property
    def factor(self) -> float:
        """What the file holds, over what the model means."""
        return float(self.target.split(_ON, 1)[0])

    @property
    def quantity(self) -> str:
        """The input or output."""
        return self.target.split(_ON, 1)[1]

    @classmethod
    def title(cls, target: str) -> str:
        """Return the name, the factor in few digits."""
        factor, name = target.split(_ON, 1)
        return f"factor {float(factor):.4g} on {name}"

    @classmethod
    def can_act(cls, target: str, model: PhysicsModel) -> bool:
        """Return whether the model has the quantity."""
        return target.split(_ON, 1)[-1] in cls._names(model)

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return every factor of every quantity."""
        return tuple(target for name in cls._names(model) for target in cls.of(model, name))

    @classmethod
    def _names(cls, model: PhysicsModel) -> tuple[str, ...]:
        raise NotImplementedError

    def unit(self, model: PhysicsModel) -> str:
        """Return the unit that the factor makes of the model's; empty where none is known."""
        known = UNITS.get(model.unit(self.quantity).strip(), {})
        return next((u for f, u in known.items() if math.isclose(f, self.factor, rel_tol=1e-9)), "")

    def lines(self, model: PhysicsModel) -> str:
        """Return the column with its unit where there is one, else the factor in the equations."""
        unit = self.unit(model)
        if not unit:
            return super().lines(model)
        title = model.columns.get(self.quantity, self.quantity).split(" [")[0]
        return f'columns: {{{self.quantity}: "{title} [{unit}]"}}'


def _number(value: float) -> sympy.Number:
    """Return a number as a whole one, or the part of a whole one, where it is."""
    if math.isclose(value, round(value), rel_tol=1e-11):
        return sympy.Integer(round(value))
    whole = 1 / value
    if math.isclose(whole, round(whole), rel_tol=1e-11):
        return sympy.Rational(1, round(whole))
    return sympy.Float(value)


@dataclass(frozen=True)
class InputFactor(Factor):
    r"""An input whose column holds :math:`c\,u`.

    Parameters
    ----------
    target : str
        The factor and the input, as ``"1000 on force"``.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> print((lag + InputFactor("1000 on u")).to_text())
    y' = (u/1000 - y)/T
    """

    id = "input_factor"
    summary = "The column of the input holds another unit than the model's, or counts."

    @classmethod
    def _names(cls, model: PhysicsModel) -> tuple[str, ...]:
        return tuple(model.inputs)

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Divide the input by the factor."""
        u = symbol(self.quantity)
        return substitute(model, u, u * _number(1 / self.factor))


@dataclass(frozen=True)
class OutputFactor(Factor):
    r"""An output whose column holds :math:`c\,y`.

    Parameters
    ----------
    target : str
        The factor and the output, as ``"1024 on speed"``.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> (lag + OutputFactor("1024 on y")).outputs["y"]
    1024*y
    >>> OutputFactor("1000 on y").lines(lag)
    'outputs: {y: "1000*y"}'
    """

    id = "output_factor"
    summary = "The column of the output holds another unit than the model's, or counts."

    @classmethod
    def _names(cls, model: PhysicsModel) -> tuple[str, ...]:
        return tuple(model.outputs)

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Multiply the output by the factor."""
        return with_output(model, self.quantity, lambda shown: _number(self.factor) * shown)


@dataclass(frozen=True)
class OtherClock(Wiring):
    r"""A time in another unit than seconds: :math:`dx/d\tau = c\,f(c\,\tau, x, u)`.

    Parameters
    ----------
    target : str
        The unit of the file's time.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> print((lag + OtherClock("ms")).to_text())
    y' = (u - y)/(1000*T)
    >>> OtherClock("ms").lines(lag)
    'columns: {t: "t [ms]"}'
    """

    id = "other_clock"
    phrase = "time in {target}"
    summary = "The column of the time is in another unit than seconds."
    check = "Compare the length of a record with a watch."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the units of time; with delayed inputs none, since delays are parameters."""
        return () if model.delays else tuple(CLOCKS)

    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
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


#: every kind of wiring
WIRINGS: tuple[type[Wiring], ...] = (
    ReversedInput,
    ReversedOutput,
    ReversedTerm,
    ExchangedInputs,
    ExchangedOutputs,
    InputFactor,
    OutputFactor,
    OtherClock,
)
