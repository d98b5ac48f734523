r"""Errors over held-out windows in units of the noise: the common measure of all reported errors.

.. math:: e = \sqrt{\frac{\sum_o n_o (r_o / s_o)^2}{\sum_o n_o (w_o / s_o)^2}}

with the root mean square error :math:`r_o` of output :math:`o` on :math:`n_o` samples, its noise
:math:`w_o`, and its scale :math:`s_o` in the fit. Of a single output it is :math:`r / w`.
"""

import math
from collections.abc import Mapping

import numpy as np

from sklearn_pgnn.diagnosis.result import Gain
from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords, FittedWindows


def ratio(error: float, noise: float) -> float:
    """Return an error in units of the noise; NaN where there is no noise.

    >>> ratio(3.0, 0.5), ratio(float("inf"), 0.1)
    (6.0, inf)
    """
    if not noise > 0:
        return math.nan
    return error / noise


def error_together(gains: Mapping[str, Gain], records: DiagnosisRecords, which: str) -> float:
    """Return the error of all outputs together."""
    windows, found = records.windows, list(gains.values())
    weights = np.isfinite(windows.y).sum(axis=0) / windows.scale**2
    errors, noise = (
        float(np.sum(weights * np.array([getattr(gain, name) for gain in found]) ** 2))
        for name in (which, "noise")
    )
    return math.sqrt(ratio(errors, noise))


def scaled_error(records: DiagnosisRecords, fit: FittedWindows) -> float:
    """Return the root mean square residual of a fitted model over windows, in their scale."""
    with np.errstate(over="ignore"):  # a model that nearly diverges
        return float(np.sqrt(np.nanmean((fit.residual / records.windows.scale) ** 2)))
