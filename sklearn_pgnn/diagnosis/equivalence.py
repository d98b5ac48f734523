"""Causes that are one and the same in the equations, whatever is recorded."""

import numpy as np
import sympy

from sklearn_pgnn.diagnosis.hypothesis import Cause
from sklearn_pgnn.physics.effects import WrongParameter
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel

#: random points at which derivatives are compared
POINTS = 40
#: singular values of columns of length one, from which on columns are independent
INDEPENDENT = 1e-7


def are_equivalent(model: PhysicsModel, one: Cause, other: Cause) -> bool:
    r"""Tell whether no inputs and outputs of a model can separate two causes.

    With the parameters :math:`p` that re-tuning changes and those of the two causes, :math:`a` and
    :math:`b`, they are equivalent, for small sizes, if the spans of

    .. math::
        \left[\frac{\partial (f, g)}{\partial p}, \frac{\partial (f, g)}{\partial a}\right]
        \quad\text{and}\quad
        \left[\frac{\partial (f, g)}{\partial p}, \frac{\partial (f, g)}{\partial b}\right]

    are the same over states, inputs and time, :math:`f` being the rates and :math:`g` the outputs.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    one, other : (effect class, target)
        The causes.

    Returns
    -------
    bool
        Whether they are equivalent.

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import ConstantLoad, CoulombFriction, InputBias
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"})
    >>> are_equivalent(cart, (InputBias, "F"), (ConstantLoad, "v"))
    True
    >>> are_equivalent(cart, (InputBias, "F"), (CoulombFriction, "v"))
    False

    A gain of the input is the same as a mass and a damping that are both off:

    >>> from sklearn_pgnn.physics.effects import WrongParameter
    >>> driven = cart.replace(equations={"v": "(b*F - d*v)/m"},
    ...                       parameters={"m": 2.0, "d": 0.5, "b": 1.0})
    >>> are_equivalent(driven, (WrongParameter, "b"), (WrongParameter, "m"))
    True
    """
    mine, theirs = _slopes(model, one), _slopes(model, other)
    if mine is None or theirs is None:
        return False
    suspected = {target for effect, target in (one, other) if effect is WrongParameter}
    free = tuple(name for name in model.free_parameters if name not in suspected)
    common = _columns(model, free)
    rank = _rank(common, mine, theirs)
    return rank == _rank(common, mine) == _rank(common, theirs)


def _slopes(model: PhysicsModel, cause: Cause) -> np.ndarray | None:
    """Differentiate by a cause's parameters where it does nothing; None where the order changes."""
    effect, target = cause
    extended = effect(target).apply(model)
    if dict(extended.delays) != dict(model.delays) or dict(extended.states) != dict(model.states):
        return None
    return _columns(extended, tuple(effect(target).names().values()))


def _columns(model, names) -> np.ndarray:
    """Give the derivatives of rates and outputs at random points, a column a parameter."""
    expressions = [*model.equations.values(), *model.outputs.values()]
    slopes = [[sympy.diff(e, symbol(name)) for name in names] for e in expressions]
    rows = [
        [_number(slope, point) for slope in line] for point in _points(model) for line in slopes
    ]
    return np.array(rows).reshape(len(rows), len(names))


def _points(model):
    """Draw states, inputs and times of either sign, small enough not to meet every limit."""
    fixed = {symbol(name): sympy.Float(p.value) for name, p in model.parameters.items()}
    moving = [symbol(name) for name in (*model.states, *model.inputs)] + [TIME]
    rng = np.random.default_rng(0)
    draws = rng.choice([-1, 1], (POINTS, len(moving))) * 10.0 ** rng.uniform(
        -2, 1, (POINTS, len(moving))
    )
    return [fixed | dict(zip(moving, map(sympy.Float, draw), strict=True)) for draw in draws]


def _number(expression, point) -> float:
    try:
        return float(expression.xreplace(point))
    except TypeError:  # not real there, or a derivative of a jump
        return np.nan


def _rank(*parts) -> int:
    """Count independent columns of several matrices side by side."""
    columns = np.column_stack([part for part in parts if part.size])
    columns = columns[np.isfinite(columns).all(axis=1)]
    size = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(size > 0, size, 1.0)
    return int(np.sum(np.linalg.svd(columns, compute_uv=False) > INDEPENDENT))
