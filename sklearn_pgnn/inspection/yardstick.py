"""The common measure of a report: errors over held-out windows in units of the noise."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.diagnosis.noise_units import error_together, ratio
from sklearn_pgnn.inspection.numbers import typeset_unit

#: the models of a diagnosis and what they are called
MODELS = {
    "prior": "as given",
    "refitted": "re-tuned",
    "extended": "extended",
    "formula": "with formula",
}


@dataclass(frozen=True)
class Errors:
    """Errors of the models in units of the noise: infinite if it diverges, NaN if there is none."""

    prior: float
    refitted: float
    extended: float
    formula: float

    @classmethod
    def of(cls, errors, noise: float) -> "Errors":
        """Return errors in an output's unit in units of its noise."""
        return cls(*(ratio(getattr(errors, which), noise) for which in MODELS))

    @property
    def best(self) -> float:
        """The error of the model with all that was found."""
        return self.extended if math.isnan(self.formula) else self.formula


def shown_models(diagnosis) -> dict[str, str]:
    """Return the models of a diagnosis and what they are called in a table, the best last."""
    return models_called(bool(diagnosis.causes_), diagnosis.discrepancy_ is not None)


def models_called(has_causes: bool, has_formula: bool) -> dict[str, str]:
    """Return the models, without the extended one where it is but the re-tuned one.

    >>> models_called(has_causes=False, has_formula=True)
    {'prior': 'as given', 'refitted': 're-tuned', 'formula': 'with formula'}
    """
    titles = {**MODELS, "extended": "without formula"} if has_formula else MODELS
    is_shown = {"extended": has_causes, "formula": has_formula}
    return {which: title for which, title in titles.items() if is_shown.get(which, True)}


def over_windows(diagnosis) -> dict[str, Errors]:
    """Return the errors over held-out windows, by output, in units of the noise."""
    return {output: Errors.of(gain, gain.noise) for output, gain in diagnosis.gain_.items()}


def in_free_run(diagnosis) -> dict[str, Errors]:
    """Return the errors in free run, by output, in units of the noise."""
    noise = {output: gain.noise for output, gain in diagnosis.gain_.items()}
    return {output: Errors.of(e, noise[output]) for output, e in diagnosis.free_run_.items()}


class ToldError(NamedTuple):
    """The errors of an output by the model, the best last: in free run, or over windows."""

    output: str
    unit: str
    is_free: bool
    by_model: dict[str, float]


def told_error(diagnosis) -> ToldError:
    """Return the errors of the output that is missed most as given, in free run if that tells."""
    runs = diagnosis.free_run_
    tells = {output: e for output, e in in_free_run(diagnosis).items() if runs[output].tells}
    missed = {o: np.nan_to_num(e.prior) for o, e in (tells or over_windows(diagnosis)).items()}
    output = max(missed, key=missed.__getitem__)
    found = (runs if tells else diagnosis.gain_)[output]
    errors = {which: getattr(found, which) for which in shown_models(diagnosis)}
    return ToldError(output, typeset_unit(diagnosis.model.unit(output)), bool(tells), errors)


def together(diagnosis) -> Errors:
    """Return the errors over held-out windows of all outputs together, in units of the noise."""
    gains, records = diagnosis.gain_, diagnosis.records_
    return Errors(*(error_together(gains, records, which) for which in MODELS))


class LeftAlone(NamedTuple):
    """A candidate, and the error it leaves alone, with a 95 % interval, in units of the noise."""

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
    """Return the error that each candidate leaves as the only cause, the best first."""
    refitted = together(diagnosis).refitted
    return [
        LeftAlone(effect, target, *(refitted * math.sqrt(max(share, 0.0)) for share in shares))
        for effect, target, *shares in diagnosis.candidates_
    ]


def retuning_counts(diagnosis) -> bool:
    """Return whether re-tuning alone removes a share of the error that is worth mentioning."""
    errors = together(diagnosis)
    return not 1.0 - (errors.refitted / errors.prior) ** 2 < diagnosis.smallest_share


def is_adequate_as_given(diagnosis) -> bool:
    """Return whether re-tuning neither changed a parameter nor is worth mentioning."""
    changed = any(parameter.changed for parameter in diagnosis.parameters_.values())
    return not (changed or retuning_counts(diagnosis))
