"""Test whether one of two simulations is significantly closer to the records."""

import numpy as np

from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times
from sklearn_pgnn.estimation.residuals import Residuals


def accuracy_gained(before: Residuals, after: Residuals) -> float:
    r"""Return the gain in accuracy of the second of two simulations, in standard errors.

    .. math:: z = \frac{\sum_k d_k}{\sqrt{n \tau_d \operatorname{var} d}}, \qquad
        d_k = \sum_o \frac{e_{o,0}^2(k) - e_{o,1}^2(k)}{S_{o,0} + S_{o,1}}

    The errors of two wrong models may differ by chance by much more than a likelihood ratio says:
    where one of them sticks, the other slips.

    References
    ----------
    .. [1] F. X. Diebold, R. S. Mariano, "Comparing predictive accuracy", Journal of Business and
       Economic Statistics 13(3), 1995, :doi:`10.1080/07350015.1995.10524599`.
    """
    if before.errors is None or after.errors is None or before.segment is None:
        raise ValueError("expected residuals with their errors, got squares only.")
    known = np.isfinite(before.squares).all(), np.isfinite(after.squares).all()
    if not all(known):
        return 0.0 if known[0] == known[1] else float(np.inf if known[1] else -np.inf)
    weight = 1.0 / (before.squares + after.squares)
    difference = ((before.errors**2 - after.errors**2) * weight).sum(axis=1)
    known = np.isfinite(difference)
    if known.sum() < 2:
        return 0.0
    spread = difference - difference[known].mean()
    (time,) = autocorrelation_times(np.where(known, spread, np.nan)[:, None], before.segment)
    error = np.sqrt(known.sum() * time * np.var(difference[known]))
    return float(difference[known].sum() / error) if error > 0 else 0.0
