r"""External functions, of Python or another tool, that equations call where none can be written.

A call is an atom of SymPy, so it can stand wherever a model has an expression. Its derivative
is another such atom, the slope :math:`(f(a + h) - f(a - h))/2h` with
:math:`h = \sqrt[3]{\varepsilon}\max(|a|, 0.01)` and the rounding :math:`\varepsilon` of a double;
the derivative of order :math:`n` nests them, with the root of order :math:`n + 2`. Where the
slopes on both sides differ by more than a factor of ten the function has a jump or a kink between
them, and the smaller one is taken: jumps contribute nothing, as for equations.
"""

import hashlib
import io
import marshal
import math
import pickle
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from itertools import count
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any, ClassVar
from uuid import uuid4

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel

#: least size of an argument that a step of a difference quotient is measured by
SMALL = 1e-2
#: slopes of two sides that differ by more than this factor are those of a jump or a kink
JUMP = 10.0
#: results that a function keeps: those of one point and of the steps beside it
KEPT = 256
#: what an argument is that a function does not depend on
UNUSED = math.nan

_FUNCTIONS: dict[str, "ExternalFunction"] = {}
_CLASSES: dict[str, type["External"]] = {}
#: what the names of their calls begin with
_PREFIX, _NUMBERS = "_external_", count()
_FAILURES: dict[str, None] = {}


class ExternalFunction:
    """A function of numbers that has no equation and computes several results at once.

    `call` takes a tuple of numbers, one per argument, and returns a sequence of numbers, one per
    result; it must be picklable if the model is to be. The last `n_parameters` of the arguments are
    parameters. `token` identifies the function in every process; `external_function` chooses it.
    """

    def __init__(
        self,
        call: Callable,
        name: str,
        arguments: Sequence[str],
        results: Sequence[str],
        n_parameters: int,
        token: str,
    ):
        self.call, self.name, self.token = call, name, token
        self.arguments, self.results = tuple(arguments), tuple(results)
        self.n_parameters = n_parameters
        self._known: dict[tuple, tuple[float, ...]] = {}
        self._nothing = (math.nan,) * len(self.results)

    def at(self, point: tuple[float, ...]) -> tuple[float, ...]:
        """Return the results at a point, NaN where the function raises; the error is recorded."""
        found = self._known.get(point)
        if found is None:
            if len(self._known) >= KEPT:
                self._known.clear()
            found = self._known[point] = self.compute(point)
        return found

    def compute(self, point: tuple[float, ...]) -> tuple[float, ...]:
        """Compute the results at a point anew, NaN where the function raises (recorded)."""
        try:
            return tuple(map(float, self.call(point)))
        except Exception as error:
            _FAILURES.setdefault(f"{self.name}{line_of(self.call, error)}: {said_by(error)}")
            return self._nothing

    def __reduce__(self) -> tuple[Callable, tuple]:
        return _restored, (
            self.call, self.name, self.arguments, self.results, self.n_parameters, self.token,
        )  # fmt: skip


def external_function(
    call: Callable,
    name: str,
    arguments: Sequence[str],
    results: Sequence[str],
    n_parameters: int = 0,
    token: str | None = None,
) -> ExternalFunction:
    """Return a function that equations can call; the same one for the same callable."""
    parts = (name, tuple(arguments), tuple(results), n_parameters, token or _content_of(call))
    key = hashlib.sha256(repr(parts).encode()).hexdigest()
    while key in _FUNCTIONS and _FUNCTIONS[key].call != call:
        key += "+"
    return _restored(call, name, arguments, results, n_parameters, key)


def _restored(
    call: Callable,
    name: str,
    arguments: Sequence[str],
    results: Sequence[str],
    n_parameters: int,
    token: str,
) -> ExternalFunction:
    """Return the function of a token, which another process may have chosen."""
    if token not in _FUNCTIONS:
        _FUNCTIONS[token] = ExternalFunction(call, name, arguments, results, n_parameters, token)
    return _FUNCTIONS[token]


def _content_of(call: Callable) -> str:
    """Return a hash of a callable's code and data; a random one if it has none."""
    content = io.BytesIO()
    try:
        _Content(content, 4).dump(call)
    except Exception:  # whatever cannot be pickled is told from others all the same
        return uuid4().hex
    return hashlib.sha256(content.getvalue()).hexdigest()


class _Content(pickle.Pickler):
    """Pickle functions with their code and the outside numbers that they read."""

    def reducer_override(self, thing: Any) -> Any:
        if not isinstance(thing, FunctionType):
            return NotImplemented
        code, around = thing.__code__, thing.__globals__
        read = {name: around[name] for name in code.co_names if isinstance(around.get(name), _DATA)}
        held = [cell.cell_contents for cell in thing.__closure__ or ()]
        bound = thing.__defaults__, thing.__kwdefaults__
        return tuple, ((marshal.dumps(code, 2), *bound, read, held),)


_DATA = (bool, int, float, complex, str, bytes, tuple, list, dict, np.ndarray)


# -- in equations ----------------------------------------------------------------------------------


class External(sympy.Function):
    """A call of one result of an external function, or of its slope, at its `places`."""

    function: ClassVar[ExternalFunction]
    result: ClassVar[int]
    places: ClassVar[tuple[int, ...]]
    by: ClassVar[tuple[int, ...]]

    is_real = True

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """Return the slope with respect to one argument."""
        known = getattr(self.function.call, "slope", None)
        if known is not None and not self.by:
            return self._known_slope(known(self.result, self.places[argindex - 1]))
        by = tuple(sorted((*self.by, argindex - 1)))
        return external(self.function, self.result, self.places, by)(*self.args)

    def _known_slope(self, found: tuple[ExternalFunction, int] | None) -> sympy.Expr:
        """Return the call of a slope that the function itself knows, or zero."""
        if found is None:
            return sympy.Integer(0)
        return external(*found, self.places)(*self.args)

    @classmethod
    def number(cls, *values: float) -> float:
        """Return the value for numbers; NaN if one of them is not finite."""
        if not all(map(math.isfinite, values)):
            return math.nan
        return cls._slope(values, cls.by)

    @classmethod
    def _slope(cls, values: tuple[float, ...], by: Sequence[int]) -> float:
        if not by:
            return cls._value(values)
        *rest, i = by
        step = sys.float_info.epsilon ** (1 / (2 + len(cls.by))) * max(abs(values[i]), SMALL)
        low, high = values[i] - step, values[i] + step
        before, here, behind = (
            cls._slope((*values[:i], at, *values[i + 1 :]), rest) for at in (low, values[i], high)
        )
        left, right = (here - before) / (values[i] - low), (behind - here) / (high - values[i])
        if abs(right - left) > JUMP * min(abs(left), abs(right)):
            return min(left, right, key=abs)
        return (behind - before) / (high - low)

    @classmethod
    def _value(cls, values: tuple[float, ...]) -> float:
        point = [UNUSED] * len(cls.function.arguments)
        for place, value in zip(cls.places, values, strict=True):
            point[place] = value
        return cls.function.at(tuple(point))[cls.result]

    @classmethod
    def label(cls) -> str:
        """Return the text before the brackets in an equation."""
        function = cls.function
        label = f"{function.name}[{function.results[cls.result]}]"
        for i in cls.by:
            label = f"d({label})/d({function.arguments[cls.places[i]]})"
        return label

    def _split(self) -> tuple[tuple[sympy.Expr, ...], tuple[sympy.Expr, ...]]:
        """Return the arguments, and those that are parameters."""
        function = self.function
        first = len(function.arguments) - function.n_parameters
        n = sum(place < first for place in self.places)
        return self.args[:n], self.args[n:]

    # SymPy's printers ask an expression for these

    def _pythoncode(self, printer: Any) -> str:
        return f"{type(self).__name__}({', '.join(map(printer._print, self.args))})"

    _numpycode = _pythoncode

    def _mathml_presentation(self, printer: Any) -> Any:
        row = printer.dom.createElement("mrow")
        label = printer.dom.createElement("mi")
        label.appendChild(printer.dom.createTextNode(self.label()))
        row.appendChild(label)
        row.appendChild(printer._print(sympy.Tuple(*self.args)))
        return row

    def _sympystr(self, printer: Any) -> str:
        parts = (", ".join(map(printer._print, part)) for part in self._split())
        return f"{self.label()}({'; '.join(filter(None, parts))})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        parts = (", ".join(map(printer._print, part)) for part in self._split())
        label = rf"\mathtt{{\text{{{self.label()}}}}}".replace("_", r"\_")
        power = "" if exp is None else f"^{{{exp}}}"
        return rf"{label}{power}\left({'; '.join(filter(None, parts))}\right)"

    def __reduce_ex__(self, protocol: Any) -> tuple[Callable, tuple]:
        return _called, (self.function, self.result, self.places, self.by, self.args)


def external(
    function: ExternalFunction, result: int, places: tuple[int, ...], by: tuple[int, ...] = ()
) -> type[External]:
    """Return the class of calls of one result of a function."""
    return _class(function, result, tuple(places), tuple(by))


@cache
def _class(
    function: ExternalFunction, result: int, places: tuple[int, ...], by: tuple[int, ...]
) -> type[External]:
    name = f"{_PREFIX}{next(_NUMBERS)}"
    kind: Any = type(External)
    made = kind(
        name, (External,), {"function": function, "result": result, "places": places, "by": by}
    )
    made._imp_ = staticmethod(_over_arrays(made))
    _CLASSES[name] = made
    return made


def _called(
    function: ExternalFunction,
    result: int,
    places: tuple[int, ...],
    by: tuple[int, ...],
    arguments: tuple[sympy.Expr, ...],
) -> sympy.Expr:
    """Restore a call from its pickled form."""
    return external(function, result, places, by)(*arguments)


def _over_arrays(made: type["External"]) -> Callable:
    """Return the function that NumPy calls in place of the class, number by number."""

    def over(*values: Any) -> np.ndarray:
        with np.errstate(invalid="ignore"):  # NaN is said to be one
            each = np.frompyfunc(lambda *one: made.number(*map(float, one)), len(values), 1)
            found = each(*values)
        return np.asarray(found, dtype=float)[()]

    return over


def class_of(name: str) -> type[External] | None:
    """Return the class of calls with a name in this process, if there is one."""
    return _CLASSES.get(name)


def calls_outside(text: str) -> bool:
    """Return whether code calls an external function, by a name that only this process knows."""
    return _PREFIX in text


def external_functions(expressions: Iterable[sympy.Basic]) -> tuple[ExternalFunction, ...]:
    """Return the external functions that expressions call, once each."""
    calls = (call for expression in expressions for call in expression.atoms(External))
    found = dict.fromkeys(call.function for call in calls)
    return tuple(sorted(found, key=lambda function: function.token))


def at_whole_points(expressions: Sequence[sympy.Expr]) -> list[sympy.Expr]:
    """Give the calls of a function in expressions the same arguments, where possible.

    A call has the arguments that its result depends on. Where those of several results agree, each
    call may take the arguments of all: the function is then evaluated once for all results.

    The result must not be differentiated.

    >>> x, y = sympy.symbols("x y", real=True)
    >>> both = external_function(lambda p: (p[0], p[1]), "f", ["x", "y"], ["a", "b"])
    >>> at_whole_points([external(both, 0, (0,))(x), external(both, 1, (1,))(y)])
    [f[a](x, y), f[b](x, y)]
    """
    calls = {call for expression in expressions for call in expression.atoms(External)}
    points: list[tuple[ExternalFunction, dict]] = []
    whole = {}
    for call in sorted(calls, key=lambda call: -len(call.places)):
        given = dict(zip(call.places, call.args, strict=True))
        for function, point in points:
            if function is call.function and all(point.get(k, v) == v for k, v in given.items()):
                point.update(given)
                break
        else:
            point = given
            points.append((call.function, point))
        whole[call] = point
    changed = {call: _with_point(call, dict(sorted(whole[call].items()))) for call in whole}
    return [expression.xreplace(changed) for expression in expressions]


def _with_point(call: External, point: Mapping[int, sympy.Expr]) -> sympy.Expr:
    places = tuple(point)
    by = tuple(places.index(call.places[i]) for i in call.by)
    return external(call.function, call.result, places, by)(*point.values())


def require_equations(model: "PhysicsModel", what: str) -> None:
    """Raise `ModelError` if a model calls functions that have no equations, which a task needs."""
    if model.opaque_functions:
        raise ModelError(
            f"{what}: expected a model given by equations, got {model.name!r}, which calls opaque "
            f"functions ({', '.join(model.opaque_functions)}). Remedy: write the equations as "
            f"text, or a NumPy function that from_function(..., trace=True) can trace."
        )


# -- what went wrong in a call ---------------------------------------------------------------------


def take_failures() -> tuple[str, ...]:
    """Return the errors of calls since the last request."""
    if not _FAILURES:
        return ()
    failures = tuple(_FAILURES)
    _FAILURES.clear()
    return failures


def line_of(function: Callable, error: BaseException) -> str:
    """Return the line of a function's file in which an error was raised."""
    inner = getattr(function, "function", function)
    code = getattr(inner, "__code__", None)
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if code is not None and f.filename == code.co_filename]
    ours = ours or [f for f in frames if not Path(f.filename).is_relative_to(_HERE)]
    return f", line {ours[-1].lineno}" if ours else ""


def said_by(error: BaseException) -> str:
    """Return an error's type and message in one line."""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


_HERE = Path(__file__).parents[1]
