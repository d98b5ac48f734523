"""What a cause and a free parameter share belongs to the parameter."""

from dataclasses import replace

from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.same_in_equations import shared_parameters
from sklearn_pgnn.estimation.window_fitter import WindowFitter
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.freedom import freedom_of
from sklearn_pgnn.simulation.window_fit import ParameterPrior

#: the free parameters of a fit by name
Free = dict[str, ParameterPrior]


def in_terms_of_the_model(fitter: WindowFitter, trial: FittedHypothesis) -> FittedHypothesis:
    r"""Return a hypothesis with what its causes share with free parameters moved to these.

    With the weights :math:`w_i > 0` of `shared_parameters`, adding :math:`c` to the parameter and
    subtracting :math:`w_i c` from the cause's :math:`q_i` changes nothing. With
    :math:`c = \min_i q_i / w_i` one of them vanishes, and no other is negative.
    """
    model, free = trial.fit.model, {freedom.name: freedom for freedom in trial.fit.freedoms}
    for cause in trial.hypothesis.causes:
        model = _moved(fitter.problem.prior, model, cause, free)
    if set(free) == {freedom.name for freedom in trial.fit.freedoms}:
        return trial
    moved = fitter.polished(trial, model, tuple(free.values()), trial.fit.x0)
    return moved if moved.fit.usable else trial


def _moved(prior: PhysicsModel, model: PhysicsModel, cause: Effect, free: Free) -> PhysicsModel:
    """Move what one cause shares; where it does, its vanishing parameter is no longer free."""
    if not cause.can_act(cause.target, prior):
        return model
    for name, weights in shared_parameters(prior, cause).items():
        if name in free or not set(weights) <= set(free) or min(weights.values()) < 0.0:
            continue
        values = {own: model.parameters[own].value for own in weights}
        gone = min(weights, key=lambda own: values[own] / weights[own])
        part = values[gone] / weights[gone]
        parameter, usual = prior.parameters[name], freedom_of(prior, name, within_spread=True)
        value = max(parameter.value + part, parameter.bounds[0])
        if part > 0.0 and value > usual.high:
            continue  # the parameter is known too well to be that large
        less = {own: values[own] - weights[own] * part for own in weights} | {gone: 0.0}
        model = model.with_parameters(**{name: value}, **less)
        del free[gone]
        for own in set(weights) - {gone}:  # what it adds to the parameter stays an addition
            free[own] = replace(free[own], low=max(free[own].low, 0.0))
        free[name] = freedom_of(prior, name, within_spread=usual.low <= value)
    return model
