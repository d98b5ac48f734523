"""Effects that are equivalent in the equations, so that no record can separate them."""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache

import numpy as np
import sympy

from sklearn_pgnn.estimation.budgets import POINTS, ROUNDING
from sklearn_pgnn.estimation.point_values import values_at
from sklearn_pgnn.estimation.same_in_equations import is_of_other_order, only_delayed
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import WrongParameter
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel

#: functions with a kink or a jump
KINKED = (sympy.sign, sympy.Abs, sympy.Max, sympy.Min, sympy.Heaviside, sympy.Piecewise)


def are_equivalent(
    model: PhysicsModel,
    one: Effect,
    other: Effect,
    retuned: bool = True,
    beside: tuple[str, ...] = (),
) -> bool:
    r"""Return whether no inputs and outputs of a model can separate two causes.

    With the parameters :math:`p` that re-tuning changes and those of the two causes, :math:`a` and
    :math:`b`, they are equivalent, for small sizes, if the spans of

    .. math::
        \left[\frac{\partial (f, g)}{\partial p}, S, \frac{\partial (f, g)}{\partial a}\right]
        \quad\text{and}\quad
        \left[\frac{\partial (f, g)}{\partial p}, S, \frac{\partial (f, g)}{\partial b}\right]

    are the same over states, inputs and time, :math:`f` being the rates and :math:`g` the outputs.
    The columns :math:`S` are the changes due to another zero or another scale of a state: with a
    spring, a constant load is the same as a biased sensor. In a shifted or scaled
    coordinate :math:`x + \epsilon \xi(x)` the rates change by
    :math:`\epsilon (\xi_x f - f_x \xi)` and the outputs by :math:`-\epsilon g_x \xi`.
    """
    if _delay_the_same(model, one, other):
        return True
    mine, theirs = _slopes(model, one), _slopes(model, other)
    if mine is None or theirs is None or not _rank(mine) or not _rank(theirs):
        return False
    wrong = {each.target for each in (one, other) if isinstance(each, WrongParameter)}
    names = model.free_parameters if retuned else beside
    free = tuple(name for name in names if name not in wrong)
    common = np.hstack([_by_names(model, free), _by_coordinates(model)])
    rank = _rank(common, mine, theirs)
    return rank == _rank(common, mine) == _rank(common, theirs)


def _delay_the_same(model: PhysicsModel, one: Effect, other: Effect) -> bool:
    """Return whether two causes only delay the same inputs."""
    late = only_delayed(model, one.apply(model))
    return bool(late) and late == only_delayed(model, other.apply(model))


@lru_cache(maxsize=512)
def _slopes(model: PhysicsModel, cause: Effect) -> np.ndarray | None:
    """Differentiate by a cause's parameters at no effect; None where the order changes."""
    extended = cause.apply(model)
    if is_of_other_order(model, extended):
        return None
    return _by_names(extended, tuple(cause.names().values()))


def _by_names(model: PhysicsModel, names: Iterable[str]) -> np.ndarray:
    """Differentiate rates and outputs by parameters: a column each."""
    expressions = [*model.equations.values(), *model.outputs.values()]
    return _columns(model, [[sympy.diff(e, symbol(name)) for e in expressions] for name in names])


@lru_cache(maxsize=16)
def _by_coordinates(model: PhysicsModel) -> np.ndarray:
    """Return the changes of rates and outputs if a state has another zero or unit.

    A zero at which a function has a kink would move with it; dry friction keeps its sign in any
    unit.
    """
    expressions = [*model.equations.values(), *model.outputs.values()]
    kinks = [kink for e in expressions for kink in e.atoms(*KINKED)]
    changes = []
    for state in map(symbol, model.states):
        at = [kink for kink in kinks if state in kink.free_symbols]
        if not at:
            changes.append(_change(model, state, sympy.Integer(1)))
        # a kink at the zero of the state, as that of dry friction, is kept
        if all(isinstance(k, sympy.sign | sympy.Abs) and k.args[0] == state for k in at):
            changes.append(_change(model, state, state))
    return _columns(model, changes)


def _change(model: PhysicsModel, state: sympy.Symbol, by: sympy.Expr) -> list[sympy.Expr]:
    """Return the changes of rates and outputs for a small change of a state's coordinate."""
    rates = {name: -_slope(f, state) * by for name, f in model.equations.items()}
    rates[str(state)] += sympy.diff(by, state) * model.equations[str(state)]
    return [*rates.values(), *(-_slope(g, state) * by for g in model.outputs.values())]


def _slope(expression: sympy.Expr, state: sympy.Symbol) -> sympy.Expr:
    """Return the slope beside a jump."""
    return sympy.diff(expression, state).replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))


def _columns(model: PhysicsModel, columns: Sequence[Sequence[sympy.Expr]]) -> np.ndarray:
    """Evaluate expressions at random points, all points of an expression in one column."""
    points = _points(model)
    values = [values_at(column, points, POINTS).T.ravel() for column in columns]
    n_rows = POINTS * (len(model.equations) + len(model.outputs))
    return np.array(values).reshape(len(columns), n_rows).T


def _points(model: PhysicsModel) -> Mapping[sympy.Symbol, float | np.ndarray]:
    """Draw states, inputs and times of either sign, small enough not to exceed every limit."""
    fixed = {symbol(name): p.value for name, p in model.parameters.items()}
    moving = [symbol(name) for name in (*model.states, *model.inputs)] + [TIME]
    rng = np.random.default_rng(0)
    draws = rng.choice([-1, 1], (POINTS, len(moving))) * 10.0 ** rng.uniform(
        -2, 1, (POINTS, len(moving))
    )
    return fixed | dict(zip(moving, draws.T, strict=True))


def _rank(*parts: np.ndarray) -> int:
    """Count independent columns of several matrices side by side."""
    columns = np.column_stack(parts)
    columns = columns[np.isfinite(columns).all(axis=1)]
    size = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(size > 0, size, 1.0)
    return int(np.sum(np.linalg.svd(columns, compute_uv=False) > ROUNDING))
