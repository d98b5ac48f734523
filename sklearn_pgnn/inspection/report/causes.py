"""What a report shows of every cause."""

from sklearn_pgnn.inspection.case import known_effects
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.model_files import file_of
from sklearn_pgnn.inspection.numbers import chance, measured, number, times, typeset_unit
from sklearn_pgnn.inspection.report.members import Member
from sklearn_pgnn.inspection.report.next_step import expectation
from sklearn_pgnn.inspection.report.who_did_what import parts_of_error
from sklearn_pgnn.inspection.words import separation_sentence
from sklearn_pgnn.physics.effects.rates import worded_for
from sklearn_pgnn.record_quality.finding import listed


def told_causes(diagnosis, members: dict[int, list[Member]]) -> list[dict]:
    """Return what is shown of every cause."""
    worth = [part for part in parts_of_error(diagnosis) if part.kind == "cause"]
    return [
        {
            **_cause(diagnosis, cause),
            "worth": f"{times(part.before)} → {times(part.after)}",
            "members": [_member(diagnosis, member) for member in members.get(number_, ())],
        }
        for number_, (cause, part) in enumerate(zip(diagnosis.causes_, worth, strict=True))
    ]


def _cause(diagnosis, cause) -> dict:
    symbols = known_effects(diagnosis)[cause.effect](cause.target).names()
    mine = (cause.effect, cause.target)
    return {
        "name": cause_name(*mine),
        "summary": cause.summary,
        "check": cause.check,
        "expectation": expectation(cause),
        "parameters": [
            {
                "name": field.replace("_", " "),
                "symbol": symbols[field],
                "value": measured(e.value, e.low, e.high, typeset_unit(e.unit)),
            }
            for field, e in cause.parameters.items()
        ],
        "probability": chance(cause.probability),
        "outside": chance(cause.outside),
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
