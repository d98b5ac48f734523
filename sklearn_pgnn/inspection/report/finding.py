"""The finding in a line, with its size, and what to do next."""

from sklearn_pgnn.diagnosis.outside import OPEN
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.inspection.case import known_effects
from sklearn_pgnn.inspection.cause_names import cause_name, sizes_of
from sklearn_pgnn.inspection.numbers import number, sized, times, typeset_unit
from sklearn_pgnn.inspection.report.parameters import parameter_facts
from sklearn_pgnn.inspection.words import (
    UNNAMED,
    known_remedy,
    known_sentence,
    place_name,
    runaway_remedy,
    separation_sentence,
    spread_remedy,
)
from sklearn_pgnn.inspection.yardstick import is_adequate_as_given, over_windows
from sklearn_pgnn.physics.effects.rates import worded_for
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import listed
from sklearn_pgnn.record_quality.refits import differing


def title(diagnosis) -> str:
    """Return the finding in a line."""
    found, name = _FOUND[diagnosis.verdict_](diagnosis), diagnosis.model.name
    return found if name == PhysicsModel.name else f"{name}: {found}"


def verdict_line(diagnosis) -> str:
    """Return the verdict in few words, and what weakens it."""
    said = VERDICTS[diagnosis.verdict_]
    if diagnosis.verdict_ == "nothing_found":
        said += "; more than noise is left"
    elif diagnosis.verdict_ == "model_adequate":
        said += ", as given" if is_adequate_as_given(diagnosis) else ", after re-tuning"
    if diagnosis.causes_ and leaves_more(diagnosis):
        said += ", but further error remains"
    if not diagnosis.complete_:
        said += "; the search was not complete"
    if diagnosis.data_quality_:
        said += "; beware of data-quality problems"
    return said


def leaves_more(diagnosis) -> bool:
    """Return whether physics is missing beside the causes."""
    return diagnosis.remaining_.kind == "structure" or diagnosis.remaining_.is_much


def cause_with_size(cause) -> str:
    """Return a cause with the size of what its first parameter measures."""
    name = cause_name(cause.effect, cause.target)
    for field, e in cause.parameters.items():
        size = sized(e.value, e.low, e.high, typeset_unit(e.unit))
        return f"{name} ({field.replace('_', ' ')} {size})"
    return name


def _nothing_found(diagnosis) -> str:
    errors = (errors.extended for errors in over_windows(diagnosis).values())
    left = max([*errors, *diagnosis.remaining_.in_free_run.values()])
    return f"no cause of the catalogue; {times(left)} the noise is left"


def _so_far(diagnosis) -> str:
    if not diagnosis.causes_:
        return "something is missing, and the search ended before it was found"
    return f"provisional: {listed(cause_with_size(cause) for cause in diagnosis.causes_)}"


def _adequate(diagnosis) -> str:
    if is_adequate_as_given(diagnosis):
        return "the model is adequate as given"
    changed = parameter_facts(diagnosis).changed
    return f"the model is adequate with {listed(changed) or 'its parameters'} re-tuned"


def _named(diagnosis) -> str:
    found = listed(cause_with_size(cause) for cause in diagnosis.causes_)
    return f"{found}; further error remains" if leaves_more(diagnosis) else found


def _alternatives(cause) -> str:
    others = [cause_name(other.effect, other.target) for other in cause.confused_with]
    others += [UNNAMED] * (cause.outside >= OPEN)
    *first, last = [cause_with_size(cause), *others]
    return f"{', '.join(first)} or {last}"


def _unexplained(diagnosis) -> str:
    part = diagnosis.discrepancy_
    if part is None:
        place = place_name(diagnosis.model, diagnosis.remaining_.law.place)
        return f"something is missing in {place} that no known effect explains"
    place = place_name(diagnosis.model, part.target)
    if part.has_names:
        names = listed(cause_name(each.effect, each.target) for each in part.known)
        return f"something is missing in {place} that acts as {names}"
    return f"something unknown is missing in {place}"


_FOUND = {
    "cause_named": _named,
    "ambiguous": lambda diagnosis: "; and ".join(
        _alternatives(cause) if cause.is_open else cause_with_size(cause)
        for cause in sorted(diagnosis.causes_, key=lambda cause: cause.is_open)
    ),
    "unexplained": _unexplained,
    "provisional": _so_far,
    "predicts_nothing": lambda _: (
        "nothing can be told, the model predicts no better than carrying on"
    ),
    "nothing_found": _nothing_found,
    "model_adequate": _adequate,
}


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
    return f"Expect {listed(f'{name} {size}' for name, size in sizes_of(cause).items())}."


def _check(diagnosis) -> str:
    cause = diagnosis.causes_[0]
    return f"{cause.check} {expectation(cause)}".strip()


def _separate(diagnosis) -> str:
    found = sorted(diagnosis.separations_, key=lambda s: (not s.separable, s.equivalent))
    if not found:
        return _check(diagnosis)
    if found[0].separable:
        return separation_sentence(found[0])
    cause = next(c for c in diagnosis.causes_ if c.confused_with)
    known, model = known_effects(diagnosis), diagnosis.model
    others = (known[rival.effect](rival.target) for rival in cause.confused_with)
    every = (cause.check, *(worded_for(model, other)[1] for other in others))
    checks = " ".join(dict.fromkeys(check for check in every if check))
    return f"{separation_sentence(found[0])} Check each on the rig: {checks}"


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
    "nothing_found": lambda _: (
        "See the residual maps, and look for disturbances of the machine or its sensors there. "
        "Record one more quantity, and diagnose again."
    ),
    "model_adequate": _use,
}
