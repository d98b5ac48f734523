"""Which terms of a formula have a name, in words, and how to have them fitted."""

import math

from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import readable
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import listed


def known_sentence(diagnosis, part) -> str:
    """Return which terms of a formula have a name, and how to have it fitted; empty for none."""
    if not part.known:
        return ""
    said = listed(
        f"{listed(map(readable, each.terms))} as {cause_name(each.effect, each.target)}"
        for each in part.known
    )
    which = "Its term acts" if len(part.effect.terms) == 1 else "Its terms act"
    which = which if part.has_names else "Some of its terms act"
    tried = [each for each in part.known if _was_enough_tried(diagnosis, each)]
    parts = (
        f"{which} like what has a name: {said}.",
        _in_vain(tried),
        known_remedy(diagnosis, part),
    )
    return " ".join(filter(None, parts))


def known_remedy(diagnosis, part) -> str:
    """Return how to have terms that have a name fitted; empty where the search has tried that."""
    open_ = [each for each in part.known if not _was_enough_tried(diagnosis, each)]
    remedies = dict.fromkeys(_remedy(diagnosis, each) for each in open_)
    return f"Remedy: {'; '.join(remedies)}." if remedies else ""


def _was_enough_tried(diagnosis, known) -> bool:
    """Return whether a complete search considered an effect, and could have named one more."""
    able = diagnosis.complete_ and len(diagnosis.causes_) < diagnosis.max_causes
    return able and _is_considered(diagnosis, known) and not known.is_parameter


def _is_considered(diagnosis, known) -> bool:
    tried = {(each.effect, each.target) for each in diagnosis.candidates_}
    return (known.effect, known.target) in tried


def _in_vain(known) -> str:
    """Return which effects were considered without being named; empty if none was."""
    if not known:
        return ""
    names = dict.fromkeys(cause_name(each.effect, each.target) for each in known)
    them = "them" if len(names) > 1 else "it"
    return f"The search considered {listed(names)}, but the evidence for {them} is too weak."


def _remedy(diagnosis, known) -> str:
    """Return how a parameter or an effect gets into a diagnosis that could not name it."""
    if not known.is_parameter:
        name = cause_name(known.effect, known.target)
        if not _is_considered(diagnosis, known):
            return f"let the diagnosis consider {name} (catalogue, targets)"
        how = "more causes (max_causes)" if diagnosis.complete_ else "more time (time_limit)"
        return f"allow {how}, and {name} may be named"
    return _remedy_of_parameter(diagnosis.model, known.target)


def _remedy_of_parameter(model: PhysicsModel, name: str) -> str:
    if model.parameters[name].fixed:
        return f"let {name} be fitted (it is fixed in the model)"
    if math.isinf(model.parameters[name].spread):
        return f"give {name} wider bounds"
    return f"give {name} a wider spread, or spread: .inf where nothing is known"
