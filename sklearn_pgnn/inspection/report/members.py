"""All that may stand in a cause's place: each with its sizes, what it leaves, and its model."""

from dataclasses import dataclass

from sklearn_pgnn.diagnosis.noise_units import scaled_error
from sklearn_pgnn.estimation.fitted_records import FittedWindows, as_judged
from sklearn_pgnn.experiment_design.separation import swap
from sklearn_pgnn.inspection.case import known_effects
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.yardstick import together
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class Member:
    """A cause, or what may stand in its place.

    `left` is what the model with it leaves, in units of the noise.
    """

    name: str
    effect: Effect
    probability: float
    left: float
    fit: FittedWindows
    model: PhysicsModel

    @property
    def sizes(self) -> list[tuple[str, float, str]]:
        """Its parameters: name, value and unit."""
        found = self.fit.model.parameters
        own = {field: found[name] for field, name in self.effect.names().items() if name in found}
        return [(field.replace("_", " "), p.value, p.unit) for field, p in own.items()]


def all_members(diagnosis) -> dict[int, list[Member]]:
    """Return by the number of a cause all that may stand in its place, where there is anything."""
    return {
        number: members_of(diagnosis, cause)
        for number, cause in enumerate(diagnosis.causes_)
        if cause.confused_with
    }


def members_of(diagnosis, cause) -> list[Member]:
    """Return a cause and its rivals, every rival fitted in its place."""
    records, known = diagnosis.records_, known_effects(diagnosis)
    mine = next(e for e in records.causes if (e.id, e.target) == (cause.effect, cause.target))
    extended = records.fits["extended"]
    found = [
        Member(
            cause_name(cause.effect, cause.target),
            mine,
            cause.probability,
            together(diagnosis).extended,
            extended,
            diagnosis.extended_model_,
        )
    ]
    for rival in cause.confused_with:
        effect = known[rival.effect](rival.target)
        fit = swap(records, mine, effect, None)
        left = found[0].left * scaled_error(records, fit) / scaled_error(records, extended)
        name = cause_name(rival.effect, rival.target)
        model = as_judged(records.problem, fit)
        found.append(Member(name, effect, rival.probability, left, fit, model))
    return found
