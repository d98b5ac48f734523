"""Numbers that record the computations with them.

A function of numbers that is called with traced quantities returns its equation. Operators and
NumPy functions are traced; a comparison becomes a step, 0 or 1, so that ``np.where`` is, too.
"""

import operator
from collections.abc import Callable, Sequence
from numbers import Real
from typing import NoReturn

import numpy as np
import sympy
from numpy.lib.mixins import NDArrayOperatorsMixin

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import maximum, minimum, symbol


def _step(difference):
    return (1 + sympy.sign(difference)) / 2


def _choose(condition, one, other):
    return other + (one - other) * condition


#: equations of NumPy functions
UFUNCS: dict[np.ufunc, Callable] = {
    np.absolute: sympy.Abs,
    np.add: operator.add,
    np.arccos: sympy.acos,
    np.arcsin: sympy.asin,
    np.arctan2: sympy.atan2,
    np.arctan: sympy.atan,
    np.bitwise_and: operator.mul,
    np.bitwise_or: lambda a, b: a + b - a * b,
    np.cbrt: lambda x: sympy.sign(x) * sympy.Abs(x) ** sympy.Rational(1, 3),
    np.ceil: sympy.ceiling,
    np.cos: sympy.cos,
    np.cosh: sympy.cosh,
    np.deg2rad: lambda x: x * sympy.pi / 180,
    np.divide: operator.truediv,
    np.exp: sympy.exp,
    np.expm1: lambda x: sympy.exp(x) - 1,
    np.fabs: sympy.Abs,
    np.float_power: operator.pow,
    np.floor: sympy.floor,
    np.fmax: maximum,
    np.fmin: minimum,
    np.greater: lambda a, b: _step(a - b),
    np.greater_equal: lambda a, b: _step(a - b),
    np.hypot: lambda a, b: sympy.sqrt(a**2 + b**2),
    np.invert: lambda a: 1 - a,
    np.less: lambda a, b: _step(b - a),
    np.less_equal: lambda a, b: _step(b - a),
    np.log10: lambda x: sympy.log(x) / sympy.log(10.0),
    np.log1p: lambda x: sympy.log(1 + x),
    np.log2: lambda x: sympy.log(x) / sympy.log(2.0),
    np.log: sympy.log,
    np.logical_and: operator.mul,
    np.logical_not: lambda a: 1 - a,
    np.logical_or: lambda a, b: a + b - a * b,
    np.maximum: maximum,
    np.minimum: minimum,
    np.multiply: operator.mul,
    np.negative: operator.neg,
    np.positive: operator.pos,
    np.power: operator.pow,
    np.rad2deg: lambda x: x * 180 / sympy.pi,
    np.reciprocal: lambda x: 1 / x,
    np.sign: sympy.sign,
    np.sin: sympy.sin,
    np.sinh: sympy.sinh,
    np.sqrt: sympy.sqrt,
    np.square: lambda x: x**2,
    np.subtract: operator.sub,
    np.tan: sympy.tan,
    np.tanh: sympy.tanh,
}
#: methods that NumPy calls by name on the elements of an array
_METHODS = {f.__name__: f for f in UFUNCS if f.nin == 1}
_FUNCTIONS: dict[Callable, Callable] = {
    np.clip: lambda x, low, high: minimum(maximum(x, low), high),
    np.where: _choose,
}


class Traced(NDArrayOperatorsMixin):
    """A quantity in an equation that is being written.

    >>> x = Traced(symbol("x"))
    >>> (np.sin(x) + 2.0 * np.maximum(x, 0)).expression
    sin(x) + 2*Max(0, x)
    """

    def __init__(self, expression):
        self.expression = expression

    def __array_ufunc__(self, ufunc, method, *inputs, **options):
        if ufunc not in UFUNCS or method != "__call__" or options:
            _refuse(f"np.{ufunc.__name__}")
        return _each(UFUNCS[ufunc], *inputs)

    def __array_function__(self, function, types, inputs, options):
        if function in _FUNCTIONS and not options:
            return _each(_FUNCTIONS[function], *inputs)
        return function(*_plain(inputs), **options)

    def __getattr__(self, name):
        if name in _METHODS:
            return lambda: self.__array_ufunc__(_METHODS[name], "__call__", self)
        raise AttributeError(name)

    def __bool__(self) -> bool:
        raise ModelError(
            "expected an equation, got a branch that depends on a value (if, and, or, min, max). "
            "Remedy: np.where, np.minimum, np.maximum or np.sign in its place."
        )

    def __float__(self) -> float:
        raise ModelError(
            "expected functions of numpy, got one that needs a number (math.sin, float, or an "
            "element of an array of floats). Remedy: np.sin in place of math.sin; a list, or "
            "np.zeros_like(x), in place of np.zeros."
        )

    __int__ = __index__ = __float__

    def __repr__(self):
        return f"Traced({self.expression})"


class Quantities(np.ndarray):
    """States, inputs or parameters, by number, by name, or all at once.

    >>> p = Quantities.of(["m", "k"], [2.0, 50.0])
    >>> float(p[1]), float(p["k"])
    (50.0, 50.0)
    """

    names: tuple[str, ...] = ()

    @classmethod
    def of(cls, names: Sequence[str], values: Sequence) -> "Quantities":
        """Return quantities with names."""
        traced = any(isinstance(value, Traced) for value in values)
        found = np.empty(len(names), dtype=object if traced else float).view(cls)
        found[:] = values
        found.names = tuple(names)
        return found

    @classmethod
    def traced(cls, names: Sequence[str]) -> "Quantities":
        """Return traced quantities."""
        return cls.of(names, [Traced(symbol(name)) for name in names])

    def __getitem__(self, key):
        if isinstance(key, str):
            if key not in self.names:
                raise ModelError(f"expected one of {', '.join(self.names)}, got {key!r}.")
            key = self.names.index(key)
        return super().__getitem__(key)

    def __array_ufunc__(self, ufunc, method, *inputs, **options):
        if self.dtype == object and ufunc in UFUNCS and method == "__call__" and not options:
            return _each(UFUNCS[ufunc], *inputs)
        return getattr(ufunc, method)(*_plain(inputs), **options)

    def __array_function__(self, function, types, inputs, options):
        if self.dtype == object and function in _FUNCTIONS and not options:
            return _each(_FUNCTIONS[function], *inputs)
        return function(*_plain(inputs), **options)


def expression_of(value) -> sympy.Expr:
    """Return the equation of a traced quantity, or a number as an expression.

    >>> expression_of(2.0), expression_of(Traced(symbol("x")))
    (2, x)
    """
    if isinstance(value, Traced):
        return value.expression
    if isinstance(value, np.ndarray) and value.size == 1:
        return expression_of(value.item())
    if not isinstance(value, Real | np.bool_):
        raise ModelError(f"expected a number, got {type(value).__name__}.")
    number = float(value)
    return sympy.Integer(int(number)) if number.is_integer() else sympy.Float(number)


def _each(function, *inputs):
    """Apply a function of expressions to quantities, or to each element of arrays of them."""

    def one(*values):
        return Traced(function(*map(expression_of, values)))

    arrays = [np.asarray(value, dtype=object) for value in _plain(inputs)]
    if all(array.ndim == 0 for array in arrays):
        return one(*(array.item() for array in arrays))
    return np.frompyfunc(one, len(arrays), 1)(*arrays).view(Quantities)


def _plain(values):
    """Return values with quantities as elements of plain arrays."""
    if isinstance(values, list | tuple):
        return type(values)(map(_plain, values))
    if isinstance(values, Traced):
        found = np.empty((), dtype=object)
        found[()] = values
        return found
    return values.view(np.ndarray) if isinstance(values, Quantities) else values


def _refuse(what: str) -> NoReturn:
    known = sorted({*(f.__name__ for f in UFUNCS), *(f.__name__ for f in _FUNCTIONS)})
    raise ModelError(f"expected one of numpy's {', '.join(known)}, got {what}.")
