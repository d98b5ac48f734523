r"""A model as straight-line source code: the right-hand side, the outputs and their derivatives.

For the states :math:`x`, inputs :math:`u` and parameters :math:`p` of a model two functions of
``(t, x, u, p, s, out)`` are written; they fill ``out`` with, one after the other,

- ``dynamics``: :math:`f, g`
- ``linearised``: :math:`f, g, \partial f/\partial x, \partial f/\partial p,
  \partial g/\partial x, \partial g/\partial p`

``s`` stands for the sign of every flow under dry friction (`sklearn_pgnn.physics.dry_friction`):
the time loop sets it and lets the flow stick, see `sklearn_pgnn.simulation.stepping`. Last stand
:math:`\partial g/\partial s` and :math:`\partial f/\partial s`, row by row.
"""

import json
from dataclasses import astuple, dataclass, replace
from functools import lru_cache

import numpy as np
import sympy
from sympy.printing.pycode import PythonCodePrinter

from sklearn_pgnn.physics.dry_friction import check_signs, dry_friction, with_signs
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.external import at_whole_points
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.disk_cache import keep, key_of, load

#: least argument of a root in a denominator: its slope at a bound is then 0, not 0/0
TINY = sympy.Float(1e-30)


@dataclass(frozen=True)
class Source:
    """Source code of a model's functions, and which flows are under dry friction.

    `shared` are assignments to names that several entries share, `entries` the expressions that
    fill ``out``, and `rows` the flows under dry friction, each as a row over the states. Without
    `n_parameters`, the number of those differentiated by, nothing is differentiated.
    """

    shared: tuple[str, ...]
    entries: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]
    n_states: int
    n_outputs: int
    n_parameters: int | None = None

    @classmethod
    def from_bytes(cls, kept: bytes) -> "Source":
        """Return the code again that `to_bytes` has written."""
        shared, entries, rows, *numbers = json.loads(kept)
        return cls(tuple(shared), tuple(entries), tuple(map(tuple, rows)), *numbers)

    def to_bytes(self) -> bytes:
        """Return the code as it is kept on disk."""
        return json.dumps(astuple(self)).encode()

    @property
    def text(self) -> str:
        """Its assignments, see `sklearn_pgnn.simulation.straight_line`."""
        filled = (f"out[{i}] = {entry}" for i, entry in enumerate(self.entries))
        return "\n".join((*self.shared, *filled)) + "\n"

    @property
    def dry(self) -> np.ndarray:
        """The flows under dry friction, shape (n_dry, n_states)."""
        return np.array(self.rows, dtype=float).reshape(len(self.rows), self.n_states)

    @property
    def n_sensitivities(self) -> int:
        """Number of parameters and initial states that a simulation differentiates by."""
        return 0 if self.n_parameters is None else self.n_parameters + self.n_states

    @property
    def size(self) -> int:
        """Length of ``out``."""
        n_columns = 1 + self.n_sensitivities + len(self.rows)
        return (self.n_states + self.n_outputs) * n_columns

    @property
    def rates(self) -> range:
        """Where the rates stand in ``out``."""
        return range(self.n_states)

    @property
    def outputs(self) -> range:
        """Where the outputs stand in ``out``."""
        return range(self.n_states, self.n_states + self.n_outputs)

    @property
    def rate_slopes(self) -> list[list[int]]:
        """Where each rate's derivatives by the states and by the parameters stand in ``out``."""
        return self._slopes(self.n_states, self.outputs.stop)

    @property
    def slopes_of_outputs(self) -> list[list[int]]:
        """Where each output's derivatives by the states and by the parameters stand in ``out``."""
        return self._slopes(self.n_outputs, self.output_slopes.start)

    def _slopes(self, n_rows: int, first: int) -> list[list[int]]:
        """Return where the derivatives of each of so many entries stand, from a place on."""
        if self.n_parameters is None:
            return []
        n, n_p = self.n_states, self.n_parameters
        by_states = [[first + i * n + j for j in range(n)] for i in range(n_rows)]
        first += n_rows * n
        by_parameters = [[first + i * n_p + j for j in range(n_p)] for i in range(n_rows)]
        return [[*x, *p] for x, p in zip(by_states, by_parameters, strict=True)]

    @property
    def output_slopes(self) -> range:
        """Where the outputs' derivatives stand in ``out``."""
        first = self.outputs.stop + self.n_states * self.n_sensitivities
        return range(first, first + self.n_outputs * self.n_sensitivities)

    @property
    def outputs_by_signs(self) -> range:
        """Where the outputs' derivatives by the signs stand, row by row."""
        first = self.output_slopes.stop
        return range(first, first + self.n_outputs * len(self.rows))

    @property
    def rates_by_signs(self) -> range:
        """Where the rates' derivatives by the signs stand, row by row: at the end."""
        return range(self.outputs_by_signs.stop, self.size)

    def keep(self, parameters: list[int]) -> "Source":
        """Return the code that is differentiated by some of the parameters only."""
        n_p = self.n_parameters or 0
        if parameters == list(range(n_p)):
            return self
        kept = [*self.rates, *self.outputs]
        for n_rows, first in (
            (self.n_states, self.outputs.stop),
            (self.n_outputs, self.output_slopes.start),
        ):
            by_parameters = first + n_rows * self.n_states
            kept += range(first, by_parameters)
            kept += [by_parameters + i * n_p + j for i in range(n_rows) for j in parameters]
        kept += [*self.outputs_by_signs, *self.rates_by_signs]
        entries = tuple(self.entries[place] for place in kept)
        return replace(self, entries=entries, n_parameters=len(parameters))


class _Printer(PythonCodePrinter):
    """Python code of nothing but numbers."""

    def _print_Float(self, expr):
        return repr(float(expr))

    def _print_sign(self, expr):
        z = self._print(expr.args[0])
        return f"(1.0 if {z} > 0.0 else (-1.0 if {z} < 0.0 else 0.0))"

    def _print_Heaviside(self, expr):
        z = self._print(expr.args[0])
        return f"(1.0 if {z} > 0.0 else 0.0)"

    def _print_Pow(self, expr, **options):
        if expr.exp.is_number and expr.exp.is_negative and expr.exp != -1:
            return f"(1.0/{self.parenthesize(expr.base**-expr.exp, 100)})"
        return super()._print_Pow(expr, **options)

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Half(self, expr):
        return "0.5"


def slope_name(name: str) -> str:
    """Return the name of the extra input that carries a late input's derivative by its delay."""
    return f"_slope_{name}"


@lru_cache(maxsize=4096)
def differentiate(expression, variable):
    """Differentiate almost everywhere: jumps contribute nothing."""
    derivative = sympy.diff(expression, variable)
    return derivative.replace(
        lambda e: isinstance(e, sympy.DiracDelta | sympy.Derivative | sympy.Subs),
        lambda e: sympy.Integer(0),
    ).replace(_is_root_of_a_bound, lambda e: sympy.Max(e.base, TINY) ** e.exp)


def _is_root_of_a_bound(e) -> bool:
    """Return whether an expression is one over a root whose argument is bounded below by zero."""
    root = isinstance(e, sympy.Pow) and e.exp.is_number and not e.exp.is_integer
    return bool(root and e.exp < 0 and e.base.has(sympy.Max, sympy.Min))


def _real(expression):
    """Write magnitudes whose derivative SymPy cannot take over the reals as maxima."""
    return expression.replace(
        lambda e: isinstance(e, sympy.Abs) and not e.args[0].is_extended_real,
        lambda e: sympy.Max(e.args[0], -e.args[0]),
    )


def write_source(model: PhysicsModel, wrt: tuple[str, ...] | None = None) -> Source:
    """Write a model's function."""
    frozen = _Frozen(model)
    return _write(frozen) if wrt is None else _select(frozen, wrt)


class _Frozen:
    """A model as a cache key that does not depend on parameter values."""

    def __init__(self, model):
        self.model = model
        self.key = (
            tuple(model.states),
            tuple(model.inputs),
            tuple(model.parameters),
            tuple(model.equations.values()),
            tuple(model.outputs.values()),
            tuple(model.delays.items()),
        )

    @property
    def said(self) -> str:
        """What tells models apart in every process."""
        states, inputs, parameters, equations, outputs, delays = self.key
        made_of = [*map(_structure, equations)], [*map(_structure, outputs)]
        return repr((states, inputs, parameters, made_of, delays))

    def __hash__(self):
        return hash(self.key)

    def __eq__(self, other):
        return self.key == other.key


@lru_cache(maxsize=4096)
def _structure(expression) -> str:
    """Return what an expression is made of; its own text would round its numbers."""
    if not expression.args:
        return sympy.srepr(expression)
    return f"{type(expression).__name__}({','.join(map(_structure, expression.args))})"


@lru_cache(maxsize=1024)
def _select(frozen: _Frozen, wrt) -> Source:
    """Write what is differentiated by some parameters: by all, once a model, of which some stay."""
    every = _write(frozen, differentiated=True)
    names = list(frozen.model.parameters)
    return every.keep([names.index(name) for name in wrt])


@lru_cache(maxsize=1024)
def _write(frozen: _Frozen, *, differentiated: bool = False) -> Source:
    """Write a model's function, or read what another process has written."""
    if frozen.model.opaque_functions:
        return _written(frozen.model, differentiated)
    key = key_of("source", frozen.said, differentiated)
    kept = load(key)
    if kept is not None:
        return Source.from_bytes(kept)
    source = _written(frozen.model, differentiated)
    keep(key, source.to_bytes())
    return source


def _written(model: PhysicsModel, differentiated: bool) -> Source:
    dry = dry_friction(model)
    places = _places(model, dry)
    # before differentiating: SymPy compares the arguments of maxima anew in all that holds them
    local = {old: sympy.Symbol(f"{a}{i}", real=True) for old, (a, i) in places.items()}
    local[TIME] = sympy.Symbol("t", real=True)
    f = [_real(with_signs(e, dry)).xreplace(local) for e in model.equations.values()]
    g = [_real(with_signs(e, dry)).xreplace(local) for e in model.outputs.values()]
    x = [local[symbol(name)] for name in model.states]
    entries = f + g
    if differentiated:
        for part in (f, g):
            entries += [slope for e in part for slope in _slopes(e, x)]
            entries += [slope for e in part for slope in _by_parameters(model, local, e)]
    signs = [local[s] for s in dry.symbols]
    check_signs(f, signs, dry, list(model.states))
    by_signs = [sympy.diff(e, s) for e in (*g, *f) for s in signs]
    arguments = {local[old]: place for old, place in places.items()}
    n_parameters = len(model.parameters) if differentiated else None
    # apart, for a step of what does not stick needs none of it
    shared, written = _straight_line(arguments, entries)
    further, sides = _straight_line(arguments, by_signs, "d") if by_signs else ((), ())
    lines, filled = tuple(dict.fromkeys((*shared, *further))), (*written, *sides)
    return Source(lines, filled, dry.rows, len(f), len(g), n_parameters)


def _slopes(expression, variables) -> list:
    """Differentiate by every variable, by those that are not there without asking SymPy."""
    there = expression.free_symbols
    return [differentiate(expression, v) if v in there else sympy.Integer(0) for v in variables]


def _by_parameters(model, local, expression) -> list:
    """Differentiate by every parameter, through a late input where it is a delay."""
    late = [local[sympy.Symbol(name, real=True)] for name in model.delays]
    slopes = [local[sympy.Symbol(slope_name(name), real=True)] for name in model.delays]
    through = dict.fromkeys(model.parameters, sympy.Integer(0))
    by_late = _slopes(expression, late)
    for delay, by_input, slope in zip(model.delays.values(), by_late, slopes, strict=True):
        through[delay] += by_input * slope
    direct = _slopes(expression, [local[symbol(name)] for name in model.parameters])
    return [own + through[name] for name, own in zip(model.parameters, direct, strict=True)]


def _places(model, dry):
    """Return every symbol's place in the arguments."""
    inputs = [*model.inputs, *(slope_name(late) for late in model.delays)]
    places = {symbol(name): ("x", i) for i, name in enumerate(model.states)}
    places |= {sympy.Symbol(name, real=True): ("u", i) for i, name in enumerate(inputs)}
    places |= {symbol(name): ("p", i) for i, name in enumerate(model.parameters)}
    places |= {s: ("s", i) for i, s in enumerate(dry.symbols)}
    return places


def _straight_line(places, entries, prefix="c") -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Write what the entries share, line by line, and the entries."""
    names = sympy.numbered_symbols(prefix, real=True)
    shared, entries = sympy.cse(at_whole_points(entries), symbols=names, order="none", list=True)
    used = set().union(*(e.free_symbols for e in entries), *(e.free_symbols for _, e in shared))
    lines = [f"{name} = {array}[{i}]" for name, (array, i) in places.items() if name in used]
    lines += [f"{name} = {_printed(expression)}" for name, expression in shared]
    return tuple(lines), tuple(map(_printed, entries))


@lru_cache(maxsize=4096)
def _printed(expression) -> str:
    """Write an expression; most are zero, or were written for another model."""
    return _Printer().doprint(expression)
