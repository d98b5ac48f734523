"""Squared residuals that a fit leaves, by output, in units of the noise."""

from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

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


class ShareLeft(NamedTuple):
    """A share of squares with its 95 % interval."""

    left: float
    low: float
    high: float


def share_left(before: np.ndarray, after: np.ndarray) -> ShareLeft:
    r"""Return the share of the squares of windows that remains.

    .. math:: s = \frac{\sum_w b_w}{\sum_w a_w}, \qquad
        \operatorname{se}(\log s)^2 = \frac{W}{W - 1}
        \frac{\sum_w (b_w - s\,a_w)^2}{(\sum_w b_w)^2}

    The interval is that of Student's distribution on the logarithm, with the windows less one as
    its degrees of freedom.
    """
    share = float(after.sum() / before.sum())
    if after.size < 2:
        return ShareLeft(share, 0.0, np.inf)
    if not (np.isfinite(share) and share > 0):
        return ShareLeft(share, share, share)
    scatter = np.sum((after - share * before) ** 2) * after.size / (after.size - 1)
    reach = student.ppf(0.975, after.size - 1) * np.sqrt(scatter) / after.sum()
    return ShareLeft(share, float(share * np.exp(-reach)), float(share * np.exp(reach)))
