"""A hypothesis: a set of effects; and what re-tuning under it may do."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache

import numpy as np
import sympy

from sklearn_pgnn.estimation.budgets import POINTS, ROUNDING
from sklearn_pgnn.estimation.point_values import values_at
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE, WrongParameter
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.simulation.window_fit import ParameterPrior


@dataclass(frozen=True)
class Hypothesis:
    """What is said to be missing: effects and their targets, in the order they were found.

    Parameters
    ----------
    causes : tuple of Effect
        The causes; what counts of each is its kind and target, not its size.
    order : tuple of Effect, optional
        The causes in the order in which they apply, which matters where, say, an input both
        saturates and lags; by default as they were found.
    """

    causes: tuple[Effect, ...] = ()
    order: tuple[Effect, ...] = ()

    def __post_init__(self):
        if not self.order:
            object.__setattr__(self, "order", self.causes)

    @property
    def n_parameters(self) -> int:
        """Number of parameters the causes add or free."""
        return sum(count_parameters(c) - len(self.taken_over(c)) for c in self.causes)

    @property
    def complexity(self) -> tuple[int, int]:
        """What orders hypotheses: fewest parameters, then a wrong number before a new part."""
        parts = [cause for cause in self.causes if not isinstance(cause, WrongParameter)]
        return self.n_parameters, len(parts)

    def taken_over(self, cause: Effect) -> tuple[str, ...]:
        """Return the fields of a cause that another cause of the hypothesis speaks for."""
        beside = {other.id for other in self.causes if other.target == cause.target}
        return tuple(name for id, names in cause.shared.items() if id in beside for name in names)

    def allows(self, cause: Effect) -> bool:
        """Return whether a cause may stand beside the others."""
        return cause not in self.causes and not any(
            other.id in cause.excludes or cause.id in other.excludes for other in self.causes
        )

    def plus(self, cause: Effect, at: int | None = None) -> "Hypothesis":
        """Return the hypothesis with one more cause, the last to apply or at a place."""
        at = len(self.order) if at is None else at
        return Hypothesis((*self.causes, cause), (*self.order[:at], cause, *self.order[at:]))

    def without(self, cause: Effect) -> "Hypothesis":
        """Return the hypothesis with one cause less."""
        causes, order = (tuple(c for c in of if c != cause) for of in (self.causes, self.order))
        return Hypothesis(causes, order)

    def before(self, cause: Effect, new: Effect) -> "Hypothesis":
        """Return the hypothesis with one more cause in front of another."""
        causes, order = (_before(of, cause, new) for of in (self.causes, self.order))
        return Hypothesis(causes, order)


def _before(causes: tuple[Effect, ...], cause: Effect, new: Effect) -> tuple[Effect, ...]:
    at = causes.index(cause)
    return (*causes[:at], new, *causes[at:])


def commute(model: PhysicsModel, one: Effect, other: Effect) -> bool:
    """Return whether two causes make the same model in either order, as those of two targets do.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    one, other : Effect
        The causes.

    Returns
    -------
    bool
        Whether the equations are the same.

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import ActuatorLag, InputDelay, InputSaturation
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> cart, lag = cart_on_spring(), ActuatorLag("force")
    >>> commute(cart, lag, InputSaturation("force")), commute(cart, lag, InputDelay("force"))
    (False, True)
    """
    if one.target != other.target:
        return True
    try:
        first, second = one.apply(model), other.apply(model)
    except ModelError:  # a formula may be made of a state that the other one adds
        return False
    if not (other.can_act(other.target, first) and one.can_act(one.target, second)):
        return True
    a, b = other.apply(first), one.apply(second)
    return dict(a.equations) == dict(b.equations) and dict(a.outputs) == dict(b.outputs)


def count_parameters(cause: Effect) -> int:
    """Count the parameters a cause adds or frees."""
    return max(1, len(cause.names()))


def resemble(problem: EstimationProblem, model: PhysicsModel, cause: Effect, other: Effect) -> bool:
    """Return whether a cause is so small that it may be another, which is not sought so small.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    model : PhysicsModel
        The model with the cause, fitted.
    cause, other : Effect
        The causes, such as a delay and a lag that is shorter than half a sample.

    Returns
    -------
    bool
        Whether records with these samples cannot tell.
    """
    if cause.target != other.target or other.id not in cause.resembles:
        return False
    mine, its = cause.resembles[other.id]
    low, _ = other.limits(other.target, problem.prior, problem.scales)[its]
    return model.parameters[cause.names()[mine]].value < low


def possible_causes(model: PhysicsModel, catalogue, targets=None) -> tuple[Effect, ...]:
    """List the causes of a catalogue that a model does not already hold.

    An effect that the model was extended by is none: it may have wrong parameters only.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    catalogue : iterable of type[Effect]
        The effects to think of.
    targets : collection of str, optional
        Targets to think of; by default all.

    Returns
    -------
    tuple of Effect
        The candidates.
    """
    return tuple(
        effect
        for effect in (kind(target) for kind in catalogue for target in kind.targets(model))
        if (targets is None or effect.target in targets)
        and not _is_there(model, effect)
        and same_parameter(model, effect) is None
    )


def check_targets(model: PhysicsModel, targets) -> None:
    """Refuse targets that a model does not have.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    targets : collection of str or None
        The targets; None means all.

    Raises
    ------
    OptionError
        If one is no state, input, output or parameter of the model.
    """
    known = [*model.states, *model.inputs, *model.outputs, *model.parameters]
    known += [target for kind in CATALOGUE for target in kind.targets(model)]
    for name in targets or ():
        if name not in known:
            near = get_close_matches(str(name), known, n=1)
            meant = f"did you mean {near[0]!r}?" if near else f"one of {', '.join(known)}."
            raise OptionError(
                f"targets: expected states, inputs, outputs and parameters of {model.name!r}, "
                f"got {name!r}; {meant}"
            )


def _is_there(model: PhysicsModel, effect: Effect) -> bool:
    """Return whether a model has the parameters that an effect would add."""
    return any(parameter.name in model.parameters for parameter in effect.parameters(model))


def same_parameter(model: PhysicsModel, effect: Effect) -> str | None:
    r"""Name the parameter of a model that does just what an effect would do.

    Of an effect that the model was extended by, that is the effect's own, fixed or free; else only
    free ones count.

    An effect with a single parameter :math:`q` is the same as the parameter :math:`p` if
    :math:`\partial (f, g)/\partial q` is :math:`\partial (f, g)/\partial p` times a factor
    that depends on parameters only.
    """
    names = tuple(effect.names().values())
    if isinstance(effect, WrongParameter) or len(names) != 1:
        return None
    if _is_there(model, effect):
        return names[0]
    extended = effect.apply(model)
    if is_of_other_order(model, extended):
        return None
    mine = _derivatives(extended, names)[names[0]]
    theirs = _derivatives_by_parameters(model)
    return next((name for name, values in theirs.items() if _proportional(mine, values)), None)


def same_causes(
    model: PhysicsModel, causes: tuple[Effect, ...]
) -> dict[Effect, tuple[Effect, ...]]:
    r"""Sort causes into classes that no record can tell apart.

    Two effects with a single parameter each, :math:`q` and :math:`q'`, are the same if
    :math:`\partial (f, g)/\partial q` is :math:`\partial (f, g)/\partial q'` times a factor that
    depends on parameters only, or if both do nothing but delay the same inputs.

    Parameters
    ----------
    model : PhysicsModel
        The prior.
    causes : tuple of Effect
        The causes.

    Returns
    -------
    dict of cause to tuple of cause
        The first cause of every class, and the others of it.
    """
    classes: dict[Effect, list[Effect]] = {}
    changes: dict[Effect, _Change] = {}
    for cause in causes:
        change = _only_change(model, cause)
        same = [c for c, known in changes.items() if change is not None and change.equals(known)]
        classes.setdefault(same[0] if same else cause, []).append(cause)
        if change is not None and not same:
            changes[cause] = change
    return {first: tuple(c for c in members if c != first) for first, members in classes.items()}


@dataclass(frozen=True)
class _Change:
    """What an effect's only parameter changes: inputs that it delays, or rates and outputs."""

    late: frozenset[str]
    slopes: np.ndarray  # by the parameter, at two values of it

    def equals(self, other: "_Change") -> bool:
        """Return whether another effect changes the same."""
        if self.late or other.late:
            return self.late == other.late
        return all(map(_proportional, self.slopes, other.slopes))


def _only_change(model: PhysicsModel, cause: Effect) -> _Change | None:
    """Return what an effect's only parameter changes; None where it has more, or adds states."""
    names = tuple(cause.names().values())
    if isinstance(cause, WrongParameter) or len(names) != 1:
        return None
    extended = cause.apply(model)
    late = only_delayed(model, extended)
    if is_of_other_order(model, extended) and not late:
        return None
    value = extended.parameters[names[0]].value
    further = extended.with_parameters(**{names[0]: value + 1.0})
    slopes = [_derivatives(each, names)[names[0]] for each in (extended, further)]
    return _Change(late, np.stack(slopes))


def only_delayed(model: PhysicsModel, extended: PhysicsModel) -> frozenset[str]:
    """Return the inputs that an extension delays, if it does nothing else."""
    before, after = ([dict(each.equations), dict(each.outputs)] for each in (model, extended))
    if before != after:
        return frozenset()
    return frozenset(extended.delays) - frozenset(model.delays)


def held_parameters(model: PhysicsModel, cause: Effect) -> tuple[str, ...]:
    r"""Name the model's parameters that a cause speaks for: re-tuning both would be one too many.

    They are those of which :math:`\partial (f, g)/\partial p` is a combination of the derivatives
    by the cause's own parameters. Friction that differs by direction holds the viscous friction
    that a model may have: the model's own stays at its prior value, and the cause tells what comes
    on top.
    """
    names = tuple(cause.names().values())
    if isinstance(cause, WrongParameter) or len(names) < 2:
        return ()
    extended = cause.apply(model)
    if is_of_other_order(model, extended):
        return ()
    own = np.column_stack([slope.ravel() for slope in _derivatives(extended, names).values()])
    theirs = _derivatives_by_parameters(model)
    return tuple(name for name, slope in theirs.items() if _is_combined(own, slope.ravel()))


def _is_combined(columns: np.ndarray, sought: np.ndarray) -> bool:
    """Return whether a column that is not zero is a linear combination of others."""
    known = np.isfinite(columns).all(axis=1) & np.isfinite(sought)
    columns, sought = columns[known], sought[known]
    left = sought - columns @ np.linalg.lstsq(columns, sought)[0]
    return bool(np.linalg.norm(left) < ROUNDING * np.linalg.norm(sought))


def held_by(model: PhysicsModel, hypothesis: "Hypothesis") -> set[str]:
    """Name the model's parameters that stay where they are under a hypothesis.

    Those are what any of the causes speaks for, see `held_parameters`, and what has no spread.
    """
    spoken_for = {name for cause in hypothesis.causes for name in held_parameters(model, cause)}
    return spoken_for | without_spread(model, hypothesis)


def without_spread(model: PhysicsModel, hypothesis: "Hypothesis") -> set[str]:
    """Name the parameters of value 0 that are not said to be wrong: a share of 0 is 0."""
    still = {name for name in model.free_parameters if model.parameters[name].reach == 0}
    return still - said_to_be_wrong(hypothesis)


def said_to_be_wrong(hypothesis: "Hypothesis") -> set[str]:
    """Name the parameters that a hypothesis says to be wrong."""
    return {each.target for each in hypothesis.causes if isinstance(each, WrongParameter)}


@lru_cache(maxsize=16)
def _derivatives_by_parameters(model: PhysicsModel) -> dict[str, np.ndarray]:
    return _derivatives(model, model.free_parameters)


def _derivatives(model: PhysicsModel, names) -> dict[str, np.ndarray]:
    """Evaluate the derivatives of rates and outputs by parameters at a few random points."""
    fixed = {symbol(n): p.value for n, p in model.parameters.items()}
    moving = [symbol(n) for n in (*model.states, *model.inputs)] + [TIME]
    draws = np.random.default_rng(0).uniform(0.1, 1.0, (POINTS, len(moving)))
    draws *= 10.0 ** np.linspace(-4, 1, POINTS)[:, None]  # small enough not to meet every limit
    draws[1::2] *= -1.0
    points = fixed | dict(zip(moving, draws.T, strict=True))
    expressions = [*model.equations.values(), *model.outputs.values()]
    slopes = {name: [sympy.diff(e, symbol(name)) for e in expressions] for name in names}
    return {name: values_at(of, points, POINTS).T for name, of in slopes.items()}


def is_of_other_order(model: PhysicsModel, extended: PhysicsModel) -> bool:
    """Return whether an extension has other states or delays than the model."""
    return extended.delays != model.delays or extended.states != model.states


def _proportional(mine: np.ndarray, theirs: np.ndarray) -> bool:
    """Return whether all that is not zero has one and the same ratio."""
    both = np.isfinite(mine) & np.isfinite(theirs)
    mine, theirs = mine[both], theirs[both]
    if np.count_nonzero(mine) < 2 or not np.array_equal(mine != 0, theirs != 0):
        return False
    ratio = mine[mine != 0] / theirs[mine != 0]
    return bool(np.ptp(ratio) < ROUNDING * np.abs(ratio).max())


def freedoms(
    problem: EstimationProblem,
    hypothesis: Hypothesis,
    start: PhysicsModel,
    held: Collection[str] = (),
) -> tuple[ParameterPrior, ...]:
    """Return how far every free parameter may go under a hypothesis.

    The prior's parameters stay within their spread, so one of value 0 stays there; one that is said
    to be wrong may go to its bounds; the effects' own stay within their limits.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    hypothesis : Hypothesis
        What is said to be missing.
    start : PhysicsModel
        The extended model.
    held : collection of str, default=()
        Parameters of the prior that stay where they are, see `held_parameters`.

    Returns
    -------
    tuple of ParameterPrior
        One for every free parameter.
    """
    wrong = said_to_be_wrong(hypothesis)
    still = {*held, *without_spread(problem.prior, hypothesis)}
    free = [
        _prior_freedom(problem.prior, name, name in wrong)
        for name in problem.prior.free_parameters
        if name not in still or name in wrong
    ]
    scales = problem.scales.of_either_sign(unsigned_states(start))
    for effect in hypothesis.causes:
        limits = effect.limits(effect.target, problem.prior, scales)
        taken = hypothesis.taken_over(effect)
        for field_name, name in effect.names().items():
            if name not in problem.prior.parameters and field_name not in taken:
                low, high = start.parameters[name].bounds
                inner = limits.get(field_name, (low, high))
                value = start.parameters[name].value
                free.append(
                    ParameterPrior(
                        name, max(low, inner[0]), min(high, inner[1]), value, math.inf, 1.0
                    )
                )
    return tuple(free)


def held_freedoms(problem: EstimationProblem, hypothesis: Hypothesis) -> tuple[ParameterPrior, ...]:
    """Return how far the prior's parameters may be off that the causes hold where they are.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    hypothesis : Hypothesis
        What is said to be missing.

    Returns
    -------
    tuple of ParameterPrior
        Those with a spread.
    """
    prior = problem.prior
    held = held_by(prior, hypothesis) - said_to_be_wrong(hypothesis)
    names = [name for name in prior.free_parameters if name in held]
    uncertain = [name for name in names if 0 < prior.parameters[name].reach < math.inf]
    return tuple(_prior_freedom(prior, name, False) for name in uncertain)


def _prior_freedom(prior, name, wrong) -> ParameterPrior:
    r"""Let a parameter be anywhere within its spread, or, if it is wrong, within its bounds.

    The variance of what is anywhere within :math:`\pm r` is :math:`r^2/3`.
    """
    parameter = prior.parameters[name]
    value, (low, high), reach = parameter.value, parameter.bounds, parameter.reach
    if wrong or not math.isfinite(reach):
        return ParameterPrior(name, low, high, value, math.inf, abs(value) or 1.0)
    low, high = max(low, value - reach), min(high, value + reach)
    return ParameterPrior(name, low, high, value, reach / math.sqrt(3.0), reach)
