"""A model's expressions as torch functions: the symbolic tree is walked, no code is made."""

from functools import reduce

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
_CHAINS = {
    sympy.Add: torch.add,
    sympy.Mul: torch.mul,
    sympy.Max: torch.maximum,
    sympy.Min: torch.minimum,
}


def torch_value(expression: sympy.Expr, values: dict[str, torch.Tensor]) -> torch.Tensor:
    """Evaluate an expression on tensors, differentiably.

    Parameters
    ----------
    expression : sympy.Expr
        An expression of a model.
    values : dict of str to Tensor
        Value of every name that stands in it; all of one shape.

    Returns
    -------
    Tensor
        Its value.

    Raises
    ------
    ValueError
        If torch has no such function.

    Examples
    --------
    >>> x = torch.tensor([1.0, 4.0])
    >>> torch_value(sympy.sqrt(sympy.Symbol("x")) - 1, {"x": x}).tolist()
    [0.0, 1.0]
    """
    like = next(iter(values.values()))

    def value(node):
        if node.is_Symbol:
            return values[node.name]
        if node.is_number:
            return torch.full_like(like, float(node))
        parts = [value(part) for part in node.args]
        if node.func in _CHAINS:
            return reduce(_CHAINS[node.func], parts)
        if node.is_Pow:
            return _power(parts[0], node.exp, parts[1])
        if node.func not in _FUNCTIONS:
            raise ValueError(f"expected a function that torch has, got {node.func.__name__!r}.")
        return _FUNCTIONS[node.func](*parts)

    return value(sympy.sympify(expression))


def _power(base, exponent, value):
    """Raise to a power; a constant one keeps the derivative finite at zero."""
    if exponent == sympy.Rational(1, 2):
        return torch.sqrt(base)
    return torch.pow(base, float(exponent)) if exponent.is_number else torch.pow(base, value)
