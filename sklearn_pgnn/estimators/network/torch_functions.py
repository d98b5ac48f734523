"""A model in torch: its expressions, built from the symbolic tree, and the energy it loses."""

import operator
from functools import lru_cache, reduce

import sympy
import torch

from sklearn_pgnn.physics.model import PhysicsModel

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
    """Evaluate an expression on tensors of one shape, differentiably."""
    like = next(value for value in values.values() if torch.is_tensor(value))
    found = _function(sympy.sympify(expression))(values)
    return torch.as_tensor(found, dtype=like.dtype, device=like.device).expand(like.shape)


def values_of(model: PhysicsModel, x, u, t, tuned=None) -> dict:
    """Return time [s], states, inputs and parameters, those `tuned` in their place, by name."""
    values = {"t": t}
    values |= {name: x[..., i] for i, name in enumerate(model.states)}
    values |= {name: u[..., i] for i, name in enumerate(model.inputs)}
    values |= {name: parameter.value for name, parameter in model.parameters.items()}
    return values | (tuned or {})


def outputs_of(model: PhysicsModel, x, u, t, tuned=None) -> torch.Tensor:
    """Return the outputs of states, see `values_of`."""
    values = values_of(model, x, u, t, tuned)
    return torch.stack([torch_value(g, values) for g in model.outputs.values()], dim=-1)


def dissipated(output, parts, root, dt) -> torch.Tensor:
    r"""Return the change of some states, see `sklearn_pgnn.simulation.dissipation`.

    .. math:: \delta = -\Delta t\,L\,(1 + \Delta t\,L^T H L)^{-1} L^T e

    `output` has shape (n, n_lossy * (n_lossy + 1) / 2); `parts`, slopes and Hessian of the stored
    energy, (n, n_lossy + n_lossy**2); `root`, the unit of every row of L, (n_lossy,); and the steps
    `dt` [s] (n, 1).
    """
    m = len(root)
    rows, columns = torch.tril_indices(m, m, device=output.device)
    lower = torch.zeros(len(output), m, m, dtype=output.dtype, device=output.device)
    lower[:, rows, columns] = output
    lower = root[:, None] * (lower + torch.eye(m, dtype=output.dtype, device=output.device))
    hessian, step = parts[:, m:].reshape(-1, m, m), dt[:, :, None]
    turned = lower.transpose(1, 2)
    matrix = torch.eye(m, dtype=output.dtype, device=output.device)
    matrix = matrix + step * (turned @ hessian @ lower)
    slopes = turned @ parts[:, :m, None]
    return (-step * (lower @ torch.linalg.solve(matrix, slopes)))[:, :, 0]


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
    function, parts = _FUNCTIONS[node.func], [_as_tensor(part) for part in parts]
    return lambda values: function(*[part(values) for part in parts])


def _chain(operation, parts):
    return lambda values: reduce(operation, [part(values) for part in parts])


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

    def raised(values):  # with a GPU tensor torch takes a number as exponent, but not as base
        a, b = base(values), exponent(values)
        return torch.pow(a if a.dim() else a.to(b.device), b)

    return raised
