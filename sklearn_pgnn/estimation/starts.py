"""Starting values of an effect: all are evaluated, then some steps are made from the best."""

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sklearn_pgnn.estimation.budgets import COARSER, KEPT, STEPS, STRETCHES, TOLERANCE
from sklearn_pgnn.estimation.fitted_hypothesis import SubsampleFit, carry_over
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.problem import worst_first
from sklearn_pgnn.estimation.unusable import BREAKDOWNS
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.simulation.window_fit import ParameterPrior, expected_decrease

if TYPE_CHECKING:
    from sklearn_pgnn.estimation.fitting import HypothesisFitter


def best_start(
    fitter: "HypothesisFitter", base: SubsampleFit, hypothesis: Hypothesis, cause: Effect
) -> PhysicsModel:
    """Return the model of a hypothesis at the most promising start of its new cause.

    From the most promising of all starts some steps are made on a few windows, and further ones
    from the better half.
    """
    few = _Few(fitter, base, hypothesis)
    models = _at_starts(fitter, base, hypothesis, cause)
    if len(models) == 1:
        return models[0]
    names = cause.names().values()
    held = tuple(n for n in names if len({each.parameters[n].value for each in models}) > 1)
    if len(models) > 2 * KEPT:
        glances = [few.fit(model, held, steps=0) for model in models]
        models = [glances[place].model for place in _valleys(glances)[:KEPT]]
    nearer = sorted((few.fit(model, held) for model in models), key=_objective)
    further = [few.fit(glance.model) for glance in nearer[: -(-len(nearer) // 2)]]
    return min(further, key=_objective).model


class _Glance(NamedTuple):
    """The objective reached from a start, the expected one of further steps, and the model."""

    objective: float
    promise: float
    model: PhysicsModel


def _objective(glance: _Glance) -> float:
    return glance.objective


class _Few:
    """A hypothesis on a few windows of a subsample: the worst, and as many others."""

    def __init__(self, fitter: "HypothesisFitter", base: SubsampleFit, hypothesis: Hypothesis):
        self.fitter, self.base, self.hypothesis = fitter, base, hypothesis
        order = worst_first(base.fit.evaluation.squares)
        count = max(order.size // KEPT, STRETCHES) // 2
        self.which = np.unique(
            np.concatenate([order[:count], order[:: max(1, order.size // count)]])
        )

    def fit(self, model: PhysicsModel, held: tuple[str, ...] = (), steps: int = STEPS) -> _Glance:
        """Make some steps from a model, with some of its parameters held."""
        fitter, which = self.fitter, self.which
        whole = fitter.start_from(model, self.base)
        start = whole.select(which)
        model, free = fitter.models.free(self.hypothesis, model)
        windows = fitter.windows_of(model).select(which)
        fit = fitter.fit_model(
            suppress(*BREAKDOWNS),  # another start may work
            model,
            windows,
            tuple(_pinned(each, model) if each.name in held else each for each in free),
            start,
            carry_over(self.base.fit, self.base.start.x0, model, whole.x0)[which],
            max_steps=steps,
            tolerance=COARSER**2 * TOLERANCE,
        )
        promise = fit.objective - expected_decrease(fit, windows, *start)
        return _Glance(fit.objective, promise, fit.model)


def _pinned(freedom: ParameterPrior, model: PhysicsModel) -> ParameterPrior:
    """Return a parameter that stays as it is in a model, whose function is that of other fits."""
    value = model.parameters[freedom.name].value
    return replace(freedom, low=value, high=value, centre=value)


def _at_starts(
    fitter: "HypothesisFitter", base: SubsampleFit, hypothesis: Hypothesis, cause: Effect
) -> list[PhysicsModel]:
    """Return the model at all starts of a cause; also from the untuned prior if they are few."""
    model = fitter.models.extend(hypothesis, base.fit.model)
    scales = fitter.scales.of_either_sign(unsigned_states(model))
    starts, models = cause.proposals(fitter.problem.prior, scales), [model]
    if len(starts) <= KEPT:
        models.append(fitter.models.extend(hypothesis))
    return [_at_start(model, start) for model in models for start in starts]


def _at_start(model: PhysicsModel, start: Effect) -> PhysicsModel:
    """Return an extended model whose new parameters are at a start of the effect."""
    own = {name: getattr(start, field) for field, name in start.names().items()}
    return model.with_parameters(**{n: value for n, value in own.items() if value is not None})


def _valleys(glances: list[_Glance]) -> list[int]:
    """Order starts by expected objective, those better than their neighbours first."""
    promise = np.array([glance.promise for glance in glances])
    padded = np.concatenate([[np.inf], promise, [np.inf]])
    slope = (padded[:-2] < promise) | (padded[2:] < promise)
    return list(np.lexsort((promise, slope)))
