"""Squared residuals that a fit leaves, by output, in units of the noise."""

import numpy as np

from sklearn_pgnn.estimation.autocorrelation import white_power
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.simulation.window_fit import WindowFit


def squares_by_output(problem: EstimationProblem, fit: WindowFit) -> np.ndarray:
    """Return the squared residuals of a fit by output, with the accuracy limit of a simulation."""
    residual, counts = _in_noise_units(problem, fit)
    return np.nansum(residual**2, axis=0) + counts * problem.resolution**2


def white_squares(problem: EstimationProblem, fit: WindowFit) -> np.ndarray:
    """Return the white part of the squared residuals of a fit, by output."""
    residual, counts = _in_noise_units(problem, fit)
    white = white_power(residual, problem.windows.starts)
    return counts * np.maximum(white, problem.resolution**2)


def block_squares(problem: EstimationProblem, fit: WindowFit) -> np.ndarray:
    """Return the squared residuals of a fit by window, block and output."""
    windows = problem.windows
    sums = windows.sum_blocks((fit.evaluation.residual / windows.scale) ** 2)
    sums[~np.isfinite(fit.evaluation.squares)] = np.inf
    return sums


def _in_noise_units(problem: EstimationProblem, fit: WindowFit) -> tuple[np.ndarray, np.ndarray]:
    """Return the residuals of a fit in units of the noise, and their number by output."""
    residual = fit.evaluation.residual / problem.windows.scale
    return residual, np.isfinite(residual).sum(axis=0)
