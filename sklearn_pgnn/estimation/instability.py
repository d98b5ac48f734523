r"""How long an unstable model can be simulated before its error says nothing any more.

An error at the start of a window grows by :math:`e^{T / \tau}` over its length :math:`T`, with the
time constant :math:`\tau` of the instability. An initial state is known as well as the noise
allows. From

.. math:: T = \tau \log(\text{variation of the output} / \text{its noise})

on, the error is as large as the output itself, and a fit has as many local minima as there are
smaller changes that would undo it.
"""

import numpy as np

from sklearn_pgnn.estimation.budgets import SAMPLES
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.source import differentiate


def horizon(problem: EstimationProblem, model: PhysicsModel) -> float:
    """Return the time after which noise at the start has grown to the size of the outputs [s]."""
    rate = growth_rate(problem, model)
    louder = float(np.max(problem.typical_outputs / problem.windows.scale))
    return np.log(max(louder, 1.0)) / rate if rate > 0 else np.inf


def growth_rate(problem: EstimationProblem, model: PhysicsModel) -> float:
    """Return the rate at which errors grow along the records [1/s], the median over samples.

    It is the largest real part of an eigenvalue of the equations, linearised; negative where
    errors decay.
    """
    if model.opaque_functions:
        return -np.inf
    slopes = _linearised(problem, model)
    slopes = slopes[np.isfinite(slopes).all(axis=(1, 2))]
    if not slopes.size:
        return -np.inf
    return float(np.median(np.linalg.eigvals(slopes).real.max(axis=1)))


def _linearised(problem: EstimationProblem, model: PhysicsModel) -> np.ndarray:
    """Return the derivatives of the rates by the states, of shape (n, n_states, n_states)."""
    x, states = problem.states.estimate(model).x, list(model.states)
    every = slice(None, None, max(1, len(x) // SAMPLES))
    table = sample_table(model, problem.windows, x)
    table = {name: value[every] if np.ndim(value) else value for name, value in table.items()}
    size = len(x[every])
    return np.stack(
        [
            [evaluate_samples(differentiate(rate, symbol(s)), table, size) for s in states]
            for rate in model.equations.values()
        ]
    ).transpose(2, 0, 1)
