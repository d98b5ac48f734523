"""A model's expressions as torch functions, built from the symbolic tree without source code."""

import operator
from functools import lru_cache, reduce

import sympy
import torch

_FUNCTIONS = {
    sympy.Abs: torch.abs,
    sympy.acos: torch.acos,
    sympy.asin: torch.asin,
    sympy.atan: torch.atan,
    sympy.atan2: torch.atan2,
    sympy.ceiling: torch.ceil,
    sympy.cos: torch.cos,
    sympy.cosh: torch.cosh,
    sympy.exp: torch.exp,
    sympy.floor: torch.floor,
    sympy.log: torch.log,
    sympy.sign: torch.sign,
    sympy.sin: torch.sin,
    sympy.sinh: torch.sinh,
    sympy.tan: torch.tan,
    sympy.tanh: torch.tanh,
    sympy.Heaviside: lambda z, *_: (z > 0).to(z.dtype),
}
_ARITHMETIC = {sympy.Add: operator.add, sympy.Mul: operator.mul}
_EXTREMES = {sympy.Max: torch.maximum, sympy.Min: torch.minimum}


def torch_value(expression, values) -> torch.Tensor:
    """Evaluate an expression on tensors, differentiably.

    All tensors have the same shape, and so has the value.

    Examples
    --------
    >>> x = torch.tensor([1.0, 4.0])
    >>> torch_value(sympy.sqrt(sympy.Symbol("x")) - 1, {"x": x}).tolist()
    [0.0, 1.0]
    """
    like = next(value for value in values.values() if torch.is_tensor(value))
    found = _function(sympy.sympify(expression))(values)
    return torch.as_tensor(found, dtype=like.dtype, device=like.device).expand(like.shape)


@lru_cache(maxsize=1024)
def _function(node):
    """Return the function of the values that an expression tree represents."""
    if node.is_Symbol:
        return operator.itemgetter(node.name)
    if node.is_number:
        number = float(node)
        return lambda values: number
    parts = [_function(part) for part in node.args]
    if node.func in _ARITHMETIC:
        return _chain(_ARITHMETIC[node.func], parts)
    if node.func in _EXTREMES:
        return _chain(_EXTREMES[node.func], [_as_tensor(part) for part in parts])
    if node.is_Pow:
        return _power(*map(_as_tensor, parts), node.exp)
    if node.func not in _FUNCTIONS:
        raise ValueError(f"expected a function that torch has, got {node.func.__name__!r}.")
    return _apply(_FUNCTIONS[node.func], [_as_tensor(part) for part in parts])


def _chain(operation, parts):
    return lambda values: reduce(operation, [part(values) for part in parts])


def _apply(function, parts):
    return lambda values: function(*[part(values) for part in parts])


def _as_tensor(part):
    """Return a function whose value is always a tensor."""
    return lambda values: torch.as_tensor(part(values), dtype=torch.float64)


def _power(base, exponent, known):
    """Raise to a power; a constant one keeps the derivative finite at zero."""
    if known == sympy.Rational(1, 2):
        return lambda values: torch.sqrt(base(values))
    if known.is_number:
        number = float(known)
        return lambda values: torch.pow(base(values), number)
    return lambda values: _raised(base(values), exponent(values))


def _raised(base, exponent):
    """Raise to a power; with a GPU tensor torch takes a number as exponent, but not as base."""
    return torch.pow(base if base.dim() else base.to(exponent.device), exponent)
