r"""The one yardstick of a report: errors over held-out windows in units of the noise.

.. math:: e = \sqrt{\frac{\sum_o n_o (r_o / s_o)^2}{\sum_o n_o (w_o / s_o)^2}}

with the root mean square error :math:`r_o` of output :math:`o` on :math:`n_o` samples, its noise
:math:`w_o` (the white part of what the extended model leaves), and its scale :math:`s_o` in the
fit. Of a single output it is :math:`r / w`.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.estimation.budgets import MUCH


@dataclass(frozen=True)
class Errors:
    """Errors of the three models, in units of the noise.

    Parameters
    ----------
    prior, refitted, extended : float
        The model as given, re-tuned, and re-tuned and extended; infinite where it diverges.
    """

    prior: float
    refitted: float
    extended: float


def over_windows(diagnosis) -> dict[str, Errors]:
    """Return the errors over held-out windows, by output, in units of the noise."""
    return {
        output: Errors(*(ratio(e, gain.noise) for e in (gain.prior, gain.refitted, gain.extended)))
        for output, gain in diagnosis.gain_.items()
    }


def in_free_run(diagnosis) -> dict[str, Errors]:
    """Return the errors in free run, by output, in units of the noise."""
    found = {}
    for output, e in diagnosis.free_run_.items():
        noise = diagnosis.gain_[output].noise
        found[output] = Errors(*(ratio(each, noise) for each in (e.prior, e.refitted, e.extended)))
    return found


def together(diagnosis) -> Errors:
    """Return the errors over held-out windows of all outputs together, in units of the noise."""
    return Errors(*(_together(diagnosis, which) for which in ("prior", "refitted", "extended")))


def _together(diagnosis, which: str) -> float:
    windows, gains = diagnosis.records_.windows, list(diagnosis.gain_.values())
    weights = np.isfinite(windows.y).sum(axis=0) / windows.scale**2
    errors, noise = (
        float(np.sum(weights * np.array([getattr(gain, name) for gain in gains]) ** 2))
        for name in (which, "noise")
    )
    return math.sqrt(ratio(errors, noise))


def ratio(error: float, noise: float) -> float:
    """Return an error in units of the noise; not a number where there is none.

    Examples
    --------
    >>> ratio(3.0, 0.5), ratio(float("inf"), 0.1)
    (6.0, inf)
    """
    if not noise > 0:
        return math.nan
    return error / noise


class Suspect(NamedTuple):
    """A suspect, and what it leaves alone beside re-tuning, in units of the noise.

    Parameters
    ----------
    effect, target : str
        What it is.
    left, low, high : float
        What is left, with its 95 % interval.
    """

    effect: str
    target: str
    left: float
    low: float
    high: float

    @property
    def name(self) -> tuple[str, str]:
        """Effect and target."""
        return self.effect, self.target


def suspects(diagnosis) -> list[Suspect]:
    """Return what every suspect leaves, the best first.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        A fitted diagnosis.

    Returns
    -------
    list of Suspect
        The suspects.
    """
    refitted = together(diagnosis).refitted
    return [
        Suspect(effect, target, *(refitted * math.sqrt(max(share, 0.0)) for share in shares))
        for effect, target, *shares in diagnosis.candidates_
    ]


def formula_error(diagnosis) -> float:
    """Return what the model with the formula for the unnamed leaves, in units of the noise."""
    windows = diagnosis.records_.windows
    residual = diagnosis.records_.fits["extended"].residual / windows.scale
    without = math.sqrt(np.nansum(residual**2) / np.isfinite(residual).sum())
    return together(diagnosis).extended * diagnosis.discrepancy_.error / without


def leaves_much(diagnosis) -> bool:
    """Return whether more than twice the noise of any output is left over windows."""
    return any(not errors.extended <= MUCH for errors in over_windows(diagnosis).values())


def retuning_counts(diagnosis) -> bool:
    """Return whether re-tuning alone removes a share of the error that is worth mentioning."""
    errors = together(diagnosis)
    return not 1.0 - (errors.refitted / errors.prior) ** 2 < diagnosis.smallest_share


def is_adequate_as_given(diagnosis) -> bool:
    """Return whether re-tuning neither changed a parameter nor is worth mentioning."""
    changed = any(parameter.changed for parameter in diagnosis.parameters_.values())
    return not (changed or retuning_counts(diagnosis))
