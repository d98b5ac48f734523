"""What a report shows of every cause, and of all that may stand in its place."""

from dataclasses import dataclass

from sklearn_pgnn.diagnosis.noise_units import scaled_error
from sklearn_pgnn.estimation.fitted_records import FittedWindows, as_judged
from sklearn_pgnn.experiment_design.separation import swap
from sklearn_pgnn.inspection.case import known_effects
from sklearn_pgnn.inspection.cause_names import cause_name, sizes_of
from sklearn_pgnn.inspection.numbers import chance, number, times, typeset_unit
from sklearn_pgnn.inspection.report.finding import expectation
from sklearn_pgnn.inspection.words import held_beside, rivals, separation_sentence
from sklearn_pgnn.inspection.yardstick import together
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.rates import worded_for
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import listed


@dataclass(frozen=True)
class Member:
    """A cause, or what may stand in its place, and what it leaves in units of the noise."""

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
        said = self.effect.words
        return [(said.get(f, f.replace("_", " ")), p.value, p.unit) for f, p in own.items()]


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


def file_of(model: PhysicsModel) -> str:
    """Return a model as the text of a model file; empty if it calls functions without equation."""
    return "" if model.opaque_functions else model.to_yaml()


def told_causes(diagnosis, members: dict[int, list[Member]]) -> list[dict]:
    """Return what is shown of every cause."""
    level, told = together(diagnosis).refitted, []
    for place, cause in enumerate(diagnosis.causes_):
        after = level * (1.0 - cause.gain / 100.0)
        worth = f"{times(level).removesuffix(' ×')} → {times(after)}"
        found = [_member(diagnosis, member) for member in members.get(place, ())]
        told.append({**_cause(diagnosis, cause), "worth": worth, "members": found})
        level = after
    return told


def _cause(diagnosis, cause) -> dict:
    symbols = known_effects(diagnosis)[cause.effect](cause.target).names()
    mine = (cause.effect, cause.target)
    return {
        "name": cause_name(*mine),
        "summary": cause.summary,
        "check": cause.check,
        "expectation": expectation(cause),
        "parameters": [
            {"name": name, "symbol": symbol, "value": size}
            for (name, size), symbol in zip(
                sizes_of(cause).items(), map(symbols.get, cause.parameters), strict=True
            )
        ],
        "probability": chance(cause.probability),
        "outside": chance(cause.outside),
        "rivals": rivals(cause),
        "beside": held_beside(cause, diagnosis.causes_),
        "tested": cause.tested,
        "separations": [
            separation_sentence(found) for found in diagnosis.separations_ if found.cause == mine
        ],
    }


def _member(diagnosis, member: Member) -> dict:
    sizes = (f"{name} {number(value)} {typeset_unit(unit)}" for name, value, unit in member.sizes)
    return {
        "name": member.name,
        "probability": chance(member.probability),
        "sizes": listed(size.strip() for size in sizes),
        "left": times(member.left),
        "check": worded_for(diagnosis.model, member.effect)[1],
        "file": file_of(member.model),
    }
