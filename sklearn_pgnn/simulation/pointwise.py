"""Expressions as NumPy functions of samples."""

from collections.abc import Mapping
from functools import lru_cache, reduce

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.windows import ShootingWindows

#: NumPy's own extremes do not mix numbers and arrays; SymPy writes a step out as conditions, within
#: which NumPy takes no others
_FUNCTIONS = {
    "amax": lambda values, axis: reduce(np.maximum, values),
    "amin": lambda values, axis: reduce(np.minimum, values),
    "Heaviside": np.heaviside,
}


def numpy_function(names, expression):
    """Write an expression, or a list, as a NumPy function of named quantities, in order.

    >>> numpy_function(["x"], sympy.Max(symbol("x"), 0))(np.array([-1.0, 2.0]))
    array([0., 2.])
    """
    return sympy.lambdify([symbol(n) for n in names], expression, [_FUNCTIONS, "numpy"])


#: an expression is written once: SymPy takes long over conditions
_known_function = lru_cache(maxsize=1024)(numpy_function)


def evaluate_samples(expression, table: Mapping[str, np.ndarray | float], size: int) -> np.ndarray:
    """Evaluate an expression at every sample, not finite where it is not."""
    names = tuple(sorted(map(str, expression.free_symbols)))
    # SymPy's conditions do not mix numbers and arrays
    values = (np.broadcast_to(np.asarray(table[name], dtype=float), (size,)) for name in names)
    with np.errstate(all="ignore"):
        value = _known_function(names, expression)(*values)
        return np.broadcast_to(np.asarray(value, dtype=float), (size,))


def sample_table(model: PhysicsModel, windows: ShootingWindows, x: np.ndarray) -> dict:
    """Return the value of every quantity of a model by name, the inputs as commanded."""
    table = {"t": windows.t} | {name: p.value for name, p in model.parameters.items()}
    table |= dict(zip(model.states, x.T, strict=True))
    return table | dict(zip(model.inputs, windows.u.T, strict=True))
