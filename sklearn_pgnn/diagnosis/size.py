"""Whether the sizes of causes can be told from none."""

import math
from collections.abc import Collection

import numpy as np
from scipy.stats import norm

from sklearn_pgnn.estimation.fitting import FittedHypothesis
from sklearn_pgnn.estimation.hypothesis import held_freedoms
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.simulation.uncertainty import errors_by_held, standard_errors


def parameter_errors(problem: EstimationProblem, trial: FittedHypothesis) -> dict[str, float]:
    """Return the parameters' standard errors, with what comes from those that causes hold."""
    fit, estimate = trial.fit, problem.states.estimate(trial.fit.model)
    expected = estimate.x[problem.windows.starts], estimate.spread
    errors, held = standard_errors(fit, *expected), held_freedoms(problem, trial.hypothesis)
    if not held or not fit.usable:
        return errors
    more = errors_by_held(fit, problem.windows, held, *expected)
    return {name: math.hypot(error, more[name]) for name, error in errors.items()}


def all_have_size(
    problem: EstimationProblem,
    trial: FittedHypothesis,
    causes: Collection[Effect],
    alpha: float,
) -> bool:
    """Return whether each of some causes has a size that is not none.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    trial : FittedHypothesis
        A hypothesis, fitted on all windows.
    causes : collection of Effect
        Some of its causes.
    alpha : float
        Rate at which none is taken for a size.

    Returns
    -------
    bool
        Whether for every cause the interval of a quantity that measures its size, robust to
        residuals that are not white, leaves out the value at which it does nothing.
    """
    errors, reach = parameter_errors(problem, trial), float(norm.ppf(1.0 - alpha / 2.0))
    return all(_has_size(problem, trial, cause, errors, reach) for cause in causes)


def _has_size(problem, trial, cause: Effect, errors, reach: float) -> bool:
    measures = _measures(problem, cause)
    for name, none in measures.items():
        error = errors.get(name, np.inf)
        if abs(trial.fit.model.parameters[name].value - none) > reach * error:
            return True
    return not measures


def _measures(problem: EstimationProblem, cause: Effect) -> dict[str, float]:
    """Return the parameters that measure a cause's size, with the values at which it is none."""
    shapes = {f.name for f in cause.quantities() if f.metadata["role"] == "shape"}
    measures = {name: 0.0 for field, name in cause.names().items() if field not in shapes}
    main = cause.names().get(cause.size_field())
    if main is not None:
        measures[main] = cause.nothing(cause.target, problem.prior, problem.scales)
    return measures
