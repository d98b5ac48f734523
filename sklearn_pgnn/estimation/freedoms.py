"""Ranges within which re-tuning may change each parameter under a hypothesis."""

import math
from collections.abc import Callable, Collection
from functools import reduce
from operator import add

from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.same_in_equations import held_parameters, shared_parameters
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.freedom import freedom_of
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.simulation.window_fit import ParameterPrior


def freedoms(
    problem: EstimationProblem,
    hypothesis: Hypothesis,
    start: PhysicsModel,
    held: Collection[str] = (),
) -> tuple[ParameterPrior, ...]:
    """Return the range and spread of every free parameter under a hypothesis.

    The prior's parameters stay within their spread, so one of value 0 stays there; one to which the
    hypothesis gives another value may vary within its bounds; the effects' own stay within their
    limits, and undo no more of a parameter than its bounds allow. What is `held` does not vary.
    """
    wrong = _revalued(hypothesis)
    still = {*held, *_without_spread(problem.prior, hypothesis)}
    free = [
        freedom_of(problem.prior, name, within_spread=name not in wrong)
        for name in problem.prior.free_parameters
        if name not in still or name in wrong
    ]
    scales = problem.scales.of_either_sign(unsigned_states(start))
    for effect in hypothesis.causes:
        limits = effect.limits(effect.target, problem.prior, scales)
        taken, least = hypothesis.taken_over(effect), _undoing(problem.prior, effect, held)
        for field_name, name in effect.names().items():
            if name not in problem.prior.parameters and field_name not in taken:
                low, high = start.parameters[name].bounds
                inner = limits.get(field_name, (low, high))
                value = start.parameters[name].value
                low, high = max(low, inner[0], least.get(name, low)), min(high, inner[1])
                scale = abs(value) or 1.0
                free.append(ParameterPrior(name, low, high, value, math.inf, scale))
    return tuple(free)


def _undoing(model: PhysicsModel, effect: Effect, held: Collection[str]) -> dict[str, float]:
    """Return the least values of a cause's parameters: what parameters that they share may lose."""
    if not held or not effect.can_act(effect.target, model):
        return {}
    return {
        own: weight * (model.parameters[name].bounds[0] - model.parameters[name].value)
        for name, weights in shared_parameters(model, effect).items()
        for own, weight in weights.items()
        if name in held and weight > 0.0
    }


def held_freedoms(problem: EstimationProblem, hypothesis: Hypothesis) -> tuple[ParameterPrior, ...]:
    """Return the spread of the prior's parameters that the causes keep fixed, of those with one."""
    prior = problem.prior
    held = held_by(prior, hypothesis) - _revalued(hypothesis)
    names = [name for name in prior.free_parameters if name in held]
    uncertain = [name for name in names if 0 < prior.parameters[name].reach < math.inf]
    return tuple(freedom_of(prior, name, within_spread=True) for name in uncertain)


def held_by(
    model: PhysicsModel,
    hypothesis: Hypothesis,
    held: Callable[[PhysicsModel, Effect], Collection[str]] = held_parameters,
) -> set[str]:
    """Name the parameters that a hypothesis keeps fixed: no spread, or see `held_parameters`."""
    spoken_for: set[str] = set()
    for place, cause in enumerate(hypothesis.causes):
        try:
            names = held(model, cause)
        except ModelError:  # it contains what earlier causes add, as a formula may
            names = held_parameters(reduce(add, hypothesis.causes[:place], model), cause)
        spoken_for |= set(names) & set(model.parameters)
    return spoken_for | _without_spread(model, hypothesis)


def _without_spread(model: PhysicsModel, hypothesis: Hypothesis) -> set[str]:
    """Name the parameters of value 0 that get no other value: a share of 0 is 0."""
    still = {name for name in model.free_parameters if model.parameters[name].reach == 0}
    return still - _revalued(hypothesis)


def _revalued(hypothesis: Hypothesis) -> set[str]:
    """Name the parameters to which a hypothesis gives other values."""
    return {each.target for each in hypothesis.causes if each.revalues}
