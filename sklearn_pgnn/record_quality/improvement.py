"""Whether a fit is better than another beyond chance."""

import numpy as np
from scipy.stats import chi2, norm
from scipy.stats import t as student

from sklearn_pgnn.record_quality.limits import ALPHA
from sklearn_pgnn.simulation.window_fit import WindowFit


def is_better(worse: WindowFit, better: WindowFit, n_parameters: int) -> bool:
    r"""Return whether a fit with more parameters is better than chance makes it.

    The squares must fall by more than noise lets them, :math:`\hat\sigma^2 \chi^2_q`, and the
    root errors of the blocks on average, as a t test says.
    """
    count = np.isfinite(worse.evaluation.residual).sum()
    noise = better.squares / max(count - n_parameters, 1)
    if not worse.squares - better.squares > noise * chi2.isf(ALPHA, n_parameters):
        return False
    fall = np.sqrt(worse.evaluation.block_squares) - np.sqrt(better.evaluation.block_squares)
    error = np.std(fall, ddof=1) / np.sqrt(fall.size) if fall.size > 1 else 0.0
    limit = student.isf(ALPHA, fall.size - 1) if fall.size > 1 else norm.isf(ALPHA)
    return bool(fall.mean() > limit * error)
