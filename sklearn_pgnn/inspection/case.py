"""A named cause together with the records, from which its evidence is drawn."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sklearn_pgnn.diagnosis.records import DiagnosisRecords
from sklearn_pgnn.inspection.balance import Samples, shown_states, starts
from sklearn_pgnn.inspection.words import cause_name
from sklearn_pgnn.physics.effects import CATALOGUE, read_catalogue
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.windows import evaluate


@dataclass(frozen=True)
class Case:
    """A cause, the extended model with it and without it, and the records.

    Parameters
    ----------
    records : DiagnosisRecords
        The records.
    full, without : PhysicsModel
        The extended model with all causes, and with all but this one, at the same values.
    effect, target : str
        The cause.
    fields : dict of str to str
        The model's name of every parameter of the effect.
    """

    records: DiagnosisRecords
    full: PhysicsModel
    without: PhysicsModel
    effect: str
    target: str
    fields: dict[str, str]

    @property
    def name(self) -> str:
        """The cause in words."""
        return cause_name(self.effect, self.target)

    @property
    def prior(self) -> PhysicsModel:
        """The model as it was given."""
        return self.records.fits["prior"].model

    @cached_property
    def samples(self) -> Samples:
        """The records with the parameters of both models."""
        return self._samples(self.without)

    def _samples(self, model) -> Samples:
        found = Samples.of(self.records, model, self.full)
        values = {name: p.value for name, p in self.full.parameters.items()}
        return Samples(self.records, model, {**values, **found.table})

    @property
    def seen(self) -> frozenset[str]:
        """The states that the records show."""
        return shown_states(self.prior)

    def missing_rate(self, state: str) -> np.ndarray:
        """Return the measured rate of a state minus the rate of the model without the cause."""
        samples = self.samples
        return samples.rate(state) - samples.mean(self.without.equations[state])


def known_effects(diagnosis) -> dict:
    """Return the effects that a diagnosis may name, by id."""
    return {effect.id: effect for effect in (*CATALOGUE, *read_catalogue(diagnosis.catalogue))}


def make_case(diagnosis, cause) -> Case:
    """Build the extended model without a cause, and gather the records."""
    known = known_effects(diagnosis)
    full, without = diagnosis.extended_model_, diagnosis.model
    for other in diagnosis.causes_:
        if other is not cause:
            without = known[other.effect](other.target).apply(without)
    values = {n: p.value for n, p in full.parameters.items() if n in without.parameters}
    if cause.target in diagnosis.model.parameters:
        values.pop(cause.target)
    fields = known[cause.effect](cause.target).names()
    return Case(
        diagnosis.records_,
        full,
        without.with_parameters(**values),
        cause.effect,
        cause.target,
        {name: fields[name] for name in cause.parameters},
    )


def effect_parameters(case: Case):
    """Return the parameters of the effect."""
    return [case.full.parameters[name] for name in case.fields.values()]


def changes_in_time(case: Case) -> bool:
    """Return whether the cause delays or filters a signal."""
    return case.full.delays != case.without.delays or set(case.full.states) != set(
        case.without.states
    )


def window_residual(case: Case, model: PhysicsModel) -> np.ndarray:
    """Simulate the windows with or without the cause, from the initial states found with it."""
    return evaluate(model, case.records.windows, starts(case.records, model), ()).residual
