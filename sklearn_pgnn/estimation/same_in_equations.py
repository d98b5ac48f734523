"""Parameters and effects that are equivalent in the equations, whatever their size."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy

from sklearn_pgnn.estimation.budgets import POINTS, ROUNDING
from sklearn_pgnn.estimation.point_values import values_at
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import WrongParameter
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel


def same_parameter(model: PhysicsModel, effect: Effect) -> str | None:
    r"""Name the parameter of a model whose change is equivalent to an effect.

    If the model already contains the effect, this is the effect's own parameter, fixed or free;
    else only free ones count.

    An effect with a single parameter :math:`q` is the same as the parameter :math:`p` if
    :math:`\partial (f, g)/\partial q` is :math:`\partial (f, g)/\partial p` times a factor
    that depends on parameters only.
    """
    names = tuple(effect.names().values())
    if isinstance(effect, WrongParameter) or len(names) != 1:
        return None
    if already_holds(model, effect):
        return names[0]
    extended = effect.apply(model)
    if is_of_other_order(model, extended):
        return None
    mine = _derivatives(extended, names)[names[0]]
    theirs = _derivatives_by_parameters(model)
    return next((name for name, values in theirs.items() if _proportional(mine, values)), None)


def same_causes(
    model: PhysicsModel,
    causes: tuple[Effect, ...],
    each_step: Callable[[], bool | None] = lambda: None,
) -> dict[Effect, tuple[Effect, ...]]:
    r"""Sort causes into classes that no record can separate.

    Two effects with a single parameter each, :math:`q` and :math:`q'`, are the same if
    :math:`\partial (f, g)/\partial q` is :math:`\partial (f, g)/\partial q'` times a factor that
    depends on parameters only, or if both only delay the same inputs. The result holds the first
    cause of every class, with its other causes; without those left where `each_step` returns true.
    """
    classes: dict[Effect, list[Effect]] = {}
    changes: dict[Effect, _Change] = {}
    for cause in causes:
        if each_step():
            break
        change = _only_change(model, cause)
        same = [c for c, known in changes.items() if change is not None and change.equals(known)]
        classes.setdefault(same[0] if same else cause, []).append(cause)
        if change is not None and not same:
            changes[cause] = change
    return {first: tuple(c for c in members if c != first) for first, members in classes.items()}


@dataclass(frozen=True)
class _Change:
    """Changes by an effect's only parameter: inputs that it delays, or rates and outputs."""

    late: frozenset[str] = frozenset()
    slopes: np.ndarray | None = None  # by the parameter, at two values of it

    def equals(self, other: "_Change") -> bool:
        """Return whether another effect causes the same changes."""
        if self.slopes is None or other.slopes is None:
            return self.late == other.late
        return all(map(_proportional, self.slopes, other.slopes))


def _only_change(model: PhysicsModel, cause: Effect) -> _Change | None:
    """Return the changes by an effect's only parameter; None if it has more, or adds states."""
    names = tuple(cause.names().values())
    if isinstance(cause, WrongParameter) or len(names) != 1:
        return None
    extended = cause.apply(model)
    late = only_delayed(model, extended)
    if late:
        return _Change(late)
    if is_of_other_order(model, extended):
        return None
    value = extended.parameters[names[0]].value
    further = extended.with_parameters(**{names[0]: value + 1.0})
    slopes = [_derivatives(each, names)[names[0]] for each in (extended, further)]
    return _Change(slopes=np.stack(slopes))


def only_delayed(model: PhysicsModel, extended: PhysicsModel) -> frozenset[str]:
    """Return the inputs that an extension delays, if it has no other effect."""
    before, after = ([dict(each.equations), dict(each.outputs)] for each in (model, extended))
    if before != after:
        return frozenset()
    return frozenset(extended.delays) - frozenset(model.delays)


@lru_cache(maxsize=512)
def shared_parameters(model: PhysicsModel, cause: Effect) -> dict[str, dict[str, float]]:
    r"""Return the model's free parameters that are directions of a cause, too, with their weights.

    A change of such a parameter :math:`p` is the same as one of the cause's own :math:`q_i`:
    :math:`\partial (f, g)/\partial p = \sum_i w_i\, \partial (f, g)/\partial q_i`. Friction that
    differs by direction shares the viscous friction of a model, with :math:`w = 1` for both slopes.
    """
    names = tuple(cause.names().values())
    if isinstance(cause, WrongParameter) or len(names) < 2:
        return {}
    extended = cause.apply(model)
    if is_of_other_order(model, extended):
        return {}
    own = np.column_stack([slope.ravel() for slope in _derivatives(extended, names).values()])
    theirs = _derivatives_by_parameters(model)
    told = {name: _weights(own, slope.ravel()) for name, slope in theirs.items()}
    found = {name: zip(names, w.tolist(), strict=True) for name, w in told.items() if w is not None}
    return {name: {own: w for own, w in pairs if w} for name, pairs in found.items()}


def held_parameters(model: PhysicsModel, cause: Effect) -> tuple[str, ...]:
    """Name the model's parameters that are held in a fit, since a cause shares their direction.

    The cause describes the difference from their prior value, until `shared_part` moves it there.
    """
    return tuple(shared_parameters(model, cause))


def expressed_parameters(model: PhysicsModel, terms: tuple[Effect, ...]) -> dict[str, np.ndarray]:
    r"""Return how much of each term a change of a parameter is, where terms express all of it.

    A small change of :math:`p` adds :math:`\partial (f, g)/\partial p` to rates and outputs; the
    terms express it if it is a combination of theirs.

    >>> from sklearn_pgnn.physics.effects.formula import Formula
    >>> cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"})
    >>> drag = Formula("v", ("v",), (1.0,))
    >>> {name: told.round(3).tolist() for name, told in expressed_parameters(cart, (drag,)).items()}
    {'d': [-0.5]}
    """
    slopes = [_derivatives(t.apply(model), tuple(t.names().values())) for t in terms]
    columns = np.column_stack([next(iter(slope.values())).ravel() for slope in slopes])
    names = sorted(model.parameters, key=lambda name: model.parameters[name].fixed)
    told = {name: _weights(columns, of.ravel()) for name, of in _derivatives(model, names).items()}
    return {name: weights for name, weights in told.items() if weights is not None}


def _weights(columns: np.ndarray, sought: np.ndarray) -> np.ndarray | None:
    """Return the weights of columns in one that they make up; None if they do not."""
    known = np.isfinite(columns).all(axis=1) & np.isfinite(sought)
    columns, sought = columns[known], sought[known]
    if not _is_combined(columns, sought):
        return None
    weights = np.linalg.lstsq(columns, sought)[0]
    part = np.abs(weights) * np.linalg.norm(columns, axis=0)
    return np.where(part > ROUNDING * np.linalg.norm(sought), weights, 0.0)


def _is_combined(columns: np.ndarray, sought: np.ndarray) -> bool:
    """Return whether a column that is not zero is a linear combination of others."""
    known = np.isfinite(columns).all(axis=1) & np.isfinite(sought)
    columns, sought = columns[known], sought[known]
    left = sought - columns @ np.linalg.lstsq(columns, sought)[0]
    return bool(np.linalg.norm(left) < ROUNDING * np.linalg.norm(sought))


def already_holds(model: PhysicsModel, effect: Effect) -> bool:
    """Return whether a model has the parameters that an effect would add."""
    return any(parameter.name in model.parameters for parameter in effect.parameters(model))


@lru_cache(maxsize=16)
def _derivatives_by_parameters(model: PhysicsModel) -> dict[str, np.ndarray]:
    return _derivatives(model, model.free_parameters)


def _derivatives(model: PhysicsModel, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Evaluate the derivatives of rates and outputs by parameters at a few random points."""
    fixed = {symbol(n): p.value for n, p in model.parameters.items()}
    moving = [symbol(n) for n in (*model.states, *model.inputs)] + [TIME]
    draws = np.random.default_rng(0).uniform(0.1, 1.0, (POINTS, len(moving)))
    draws *= 10.0 ** np.linspace(-4, 1, POINTS)[:, None]  # small enough not to exceed every limit
    draws[1::2] *= -1.0
    points = fixed | dict(zip(moving, draws.T, strict=True))
    expressions = [*model.equations.values(), *model.outputs.values()]
    slopes = {name: [sympy.diff(e, symbol(name)) for e in expressions] for name in names}
    return {name: values_at(of, points, POINTS).T for name, of in slopes.items()}


def is_of_other_order(model: PhysicsModel, extended: PhysicsModel) -> bool:
    """Return whether an extension has other states or delays than the model."""
    return extended.delays != model.delays or extended.states != model.states


def _proportional(mine: np.ndarray, theirs: np.ndarray) -> bool:
    """Return whether all entries that are not zero have the same ratio."""
    both = np.isfinite(mine) & np.isfinite(theirs)
    mine, theirs = mine[both], theirs[both]
    if np.count_nonzero(mine) < 2 or not np.array_equal(mine != 0, theirs != 0):
        return False
    ratio = mine[mine != 0] / theirs[mine != 0]
    return bool(np.ptp(ratio) < ROUNDING * np.abs(ratio).max())
