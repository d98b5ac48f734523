"""Standard errors of the parameters that were trained with the network."""

import numpy as np

from sklearn_pgnn.estimators.network.least_squares import SimulationObjective
from sklearn_pgnn.simulation.uncertainty import FLAT, invert


def parameter_errors(objective: SimulationObjective, theta: np.ndarray) -> np.ndarray:
    r"""Return the standard errors of the free parameters, with the weights adapting to them.

    .. math:: \mathrm{cov} = S^{-1} M S^{-1}, \qquad
              S = H_{pp} - H_{pw} H_{ww}^{-1} H_{wp},

    with the Hessian :math:`H` of the error, and, for every parameter, the larger result of two
    :math:`M`: that of white residuals, and the sum over the trajectories of the squared gradients
    after elimination of the weights. The records do not determine what the network can compensate.
    """
    n_free = len(objective.step.free)
    parts = objective.parts(theta)
    if not all(part.is_finite for part in parts):
        return np.full(n_free, np.inf)
    hessian = np.sum([part.curvature for part in parts], axis=0)
    following = _following(hessian, n_free)
    schur = hessian[-n_free:, -n_free:] - following @ hessian[:-n_free, -n_free:]
    inverse, flat = invert(schur)
    n = objective.n_errors
    variance = sum(part.cost for part in parts) * n / max(n - theta.size, 1)
    scores = np.array([p.gradient[-n_free:] - following @ p.gradient[:-n_free] for p in parts])
    scores -= scores.mean(axis=0)
    by_record = scores.T @ scores * len(parts) / max(len(parts) - 1, 1)
    meats = 2 / n * variance * schur, by_record
    variances = np.max([np.diag(inverse @ meat @ inverse) for meat in meats], axis=0)
    return np.where(flat | ~(variances > 0), np.inf, np.sqrt(np.maximum(variances, 0.0)))


def _following(hessian, n_free) -> np.ndarray:
    """Return how the weights adapt to the parameters, as the product that eliminates them."""
    of_weights, across = hessian[:-n_free, :-n_free], hessian[-n_free:, :-n_free]
    size = np.sqrt(np.maximum(np.diag(of_weights), np.finfo(float).tiny))
    inverse = np.linalg.pinv(of_weights / np.outer(size, size), rcond=FLAT, hermitian=True)
    return across / size @ inverse / size
