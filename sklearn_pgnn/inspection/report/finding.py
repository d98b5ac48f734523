"""The finding in a line, with its size: the title of a report."""

from sklearn_pgnn.diagnosis.outside import OPEN
from sklearn_pgnn.diagnosis.verdict import VERDICTS
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import sized, times, typeset_unit
from sklearn_pgnn.inspection.report.parameter_facts import parameter_facts
from sklearn_pgnn.inspection.words import UNNAMED, place_name
from sklearn_pgnn.inspection.yardstick import is_adequate_as_given, over_windows
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import listed


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
    left = times(max(errors.extended for errors in over_windows(diagnosis).values()))
    return f"no cause of the catalogue; {left} the noise is left"


def _predicts_nothing(diagnosis) -> str:
    return "nothing can be told, the model predicts no better than carrying on"


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


def _ambiguous(diagnosis) -> str:
    sure = [cause_with_size(cause) for cause in diagnosis.causes_ if not cause.is_open]
    open_ = [_alternatives(cause) for cause in diagnosis.causes_ if cause.is_open]
    return "; and ".join([*sure, *open_])


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
    "ambiguous": _ambiguous,
    "unexplained": _unexplained,
    "provisional": _so_far,
    "predicts_nothing": _predicts_nothing,
    "nothing_found": _nothing_found,
    "model_adequate": _adequate,
}
