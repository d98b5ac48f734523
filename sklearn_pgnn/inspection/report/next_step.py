"""What to do next, in a line with numbers."""

from sklearn_pgnn.inspection.case import known_effects
from sklearn_pgnn.inspection.named_terms import known_remedy, known_sentence
from sklearn_pgnn.inspection.numbers import measured, number, typeset_unit
from sklearn_pgnn.inspection.parameter_ends import spread_remedy
from sklearn_pgnn.inspection.report.parameter_facts import parameter_facts
from sklearn_pgnn.inspection.runaway import runaway_remedy
from sklearn_pgnn.inspection.words import place_name, separation_sentence
from sklearn_pgnn.inspection.yardstick import is_adequate_as_given
from sklearn_pgnn.physics.effects.rates import worded_for
from sklearn_pgnn.record_quality.finding import listed
from sklearn_pgnn.record_quality.refits import differing


def next_step(diagnosis) -> str:
    """Return what to do next: model and records first, then what separates, then the rig."""
    wider = spread_remedy(diagnosis)
    if diagnosis.verdict_ == "predicts_nothing":
        return f"{wider} {runaway_remedy(diagnosis)}".lstrip()
    # no one value is right of a parameter that differs between records, however wide its spread
    differs = differing(diagnosis.data_quality_, diagnosis.model)
    if wider and differs is None:
        return wider
    if diagnosis.data_quality_:
        first = differs or diagnosis.data_quality_[0]
        return (
            f"Improve the records first ({first.kind} of {first.where}): {first.remedy}. Then "
            f"diagnose again."
        )
    if not diagnosis.complete_:
        return "Diagnose again with more time: the search was not complete."
    return _BY_VERDICT[diagnosis.verdict_](diagnosis)


def expectation(cause) -> str:
    """Return what the check of a cause on the rig should show: every parameter's interval."""
    sizes = (
        f"{field.replace('_', ' ')} {measured(e.value, e.low, e.high, typeset_unit(e.unit))}"
        for field, e in cause.parameters.items()
    )
    return f"Expect {listed(sizes)}."


def _check(diagnosis) -> str:
    cause = diagnosis.causes_[0]
    return f"{cause.check} {expectation(cause)}".strip()


def _separate(diagnosis) -> str:
    found = sorted(diagnosis.separations_, key=lambda s: (not s.separable, s.equivalent))
    if not found:
        return _check(diagnosis)
    if found[0].separable:
        return separation_sentence(found[0])
    checks = _checks(diagnosis, next(c for c in diagnosis.causes_ if c.confused_with))
    return f"{separation_sentence(found[0])} Check each on the rig: {checks}"


def _checks(diagnosis, cause) -> str:
    """Return how a cause and its rivals are checked on the rig."""
    known, model = known_effects(diagnosis), diagnosis.model
    others = (known[rival.effect](rival.target) for rival in cause.confused_with)
    every = (cause.check, *(worded_for(model, other)[1] for other in others))
    return " ".join(dict.fromkeys(check for check in every if check))


def _watch(diagnosis) -> str:
    return (
        "See the residual maps, and look for disturbances of the machine or its sensors there. "
        "Record one more quantity, and diagnose again."
    )


def _use(diagnosis) -> str:
    if is_adequate_as_given(diagnosis):
        return "Use the model as it is."
    facts = parameter_facts(diagnosis)
    names = listed(facts.changed) or "the parameters"
    where = "" if diagnosis.model.opaque_functions else " (extended_model.yaml)"
    return f"Use the new values of {names}{where}."


def _look(diagnosis) -> str:
    part = diagnosis.discrepancy_
    if part is None:
        law = diagnosis.remaining_.law
        on, where = listed(law.depends_on) or "time", place_name(diagnosis.model, law.place)
        before = f" as it was some {number(law.memory, 2)} s before" if law.memory else ""
        return f"Find out what acts on {where}, depends on {on}{before} and is not in the model."
    if part.has_names and known_remedy(diagnosis, part):
        return known_sentence(diagnosis, part)
    on = listed(part.quantities) or "time"
    where = place_name(diagnosis.model, part.target)
    return f"Find out what acts on {where} and depends on {on}: the formula gives its size."


_BY_VERDICT = {
    "cause_named": _check,
    "ambiguous": _separate,
    "unexplained": _look,
    "nothing_found": _watch,
    "model_adequate": _use,
}
