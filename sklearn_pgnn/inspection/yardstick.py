"""The common measure of a report: errors over held-out windows in units of the noise."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from sklearn_pgnn.diagnosis.noise_units import error_together, ratio


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
    gains, records = diagnosis.gain_, diagnosis.records_
    models = ("prior", "refitted", "extended")
    return Errors(*(error_together(gains, records, which) for which in models))


class LeftAlone(NamedTuple):
    """A candidate, and the error it leaves as the only cause with re-tuning, in units of the noise.

    Parameters
    ----------
    effect, target : str
        The candidate.
    left, low, high : float
        The remaining error, with its 95 % interval.
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


def left_alone(diagnosis) -> list[LeftAlone]:
    """Return the error that each candidate leaves as the only cause, the best first.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        A fitted diagnosis.

    Returns
    -------
    list of LeftAlone
        The candidates.
    """
    refitted = together(diagnosis).refitted
    return [
        LeftAlone(effect, target, *(refitted * math.sqrt(max(share, 0.0)) for share in shares))
        for effect, target, *shares in diagnosis.candidates_
    ]


def leaves_much(diagnosis) -> bool:
    """Return whether the residuals of any output over windows exceed twice its noise."""
    return diagnosis.remaining_.is_much


def retuning_counts(diagnosis) -> bool:
    """Return whether re-tuning alone removes a share of the error that is worth mentioning."""
    errors = together(diagnosis)
    return not 1.0 - (errors.refitted / errors.prior) ** 2 < diagnosis.smallest_share


def is_adequate_as_given(diagnosis) -> bool:
    """Return whether re-tuning neither changed a parameter nor is worth mentioning."""
    changed = any(parameter.changed for parameter in diagnosis.parameters_.values())
    return not (changed or retuning_counts(diagnosis))
