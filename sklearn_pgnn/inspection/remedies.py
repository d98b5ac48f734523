"""What limits a verdict, in words, and what to do about it: a model, a parameter, a formula."""

import math

import numpy as np

from sklearn_pgnn.estimation.without_model import free_values, squares_without_model
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import number, readable
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.spread_ends import at_bounds, at_spread_ends
from sklearn_pgnn.record_quality.finding import listed

#: what to do about a model that runs away
REMEDY = (
    "Check the signs, units and values of the model, and give wider spreads to parameters that are "
    "not well known. If the machine is unstable by itself, sample faster: in windows of a few "
    "samples the model cannot run away. If a controller holds it against a load, record the load; "
    "or put the controller into the model, with the reference as the input."
)


def runaway_sentences(diagnosis) -> tuple[str, str]:
    """Return where a model runs away, then what was expected of it and what came."""
    windows = diagnosis.records_.windows
    counts = np.isfinite(windows.y[windows.rows]).sum(axis=0)
    squares = squares_without_model(windows, free_values(diagnosis.model))
    without_model = windows.scale * np.sqrt(squares / np.maximum(counts, 1))
    came = [
        f"{number(gain.refitted, 3)} {gain.unit}".rstrip() + f" of {output} instead of less than "
        f"{number(expected, 3)}"
        for (output, gain), expected in zip(diagnosis.gain_.items(), without_model, strict=True)
    ]
    return (
        f"Nothing can be told: over windows of {number(diagnosis.window_, 3)} s the re-tuned model "
        f"runs away from the records, as that of an unstable machine does, or of one that a "
        f"controller holds against a load that is not recorded.",
        f"It predicts no output better than is possible without a model, by carrying on as at the "
        f"start: its error is {listed(came)}. No cause is named that merely ends the divergence.",
    )


def runaway_remedy(diagnosis) -> str:
    """Return what to do about a model that runs away, first about windows of a given length."""
    given = "" if diagnosis.window_length is None else "Leave window_length out. "
    return f"{given}{REMEDY}"


def spread_sentence(diagnosis) -> str:
    """Return which parameters lie at an end of a spread or at a bound, and what to do."""
    retuned, said = _retuned(diagnosis), []
    due = "what is named and what is left" if diagnosis.causes_ else "what is left"
    if names := at_spread_ends(diagnosis.model, retuned):
        lies, spread = ("lie", "spreads") if len(names) > 1 else ("lies", "spread")
        shares = listed(f"{100 * diagnosis.model.parameters[name].spread:.3g} %" for name in names)
        said.append(
            f"{listed(names)} {lies} at the end of what the {spread} in the model file allowed, "
            f"{shares} of the value: {due} may come from a wrong parameter value. If it is not "
            f"known that well, give a wider spread, or spread: .inf, and diagnose again."
        )
    if names := at_bounds(retuned):
        lies, bounds = ("lie", "bounds") if len(names) > 1 else ("lies", "a bound")
        said.append(
            f"{listed(names)} {lies} at {bounds} of the model file: {due} may come from that. If "
            f"values beyond are possible, give wider bounds, and diagnose again."
        )
    known = diagnosis.model.parameters.items()
    if turned := [name for name, p in known if p.value * retuned.parameters[name].value < 0]:
        said.append(f"{listed(turned)} changed sign: give bounds if that cannot be.")
    return " ".join(said)


def spread_remedy(diagnosis) -> str:
    """Return what to do first where parameters lie at an end of a spread."""
    names = at_spread_ends(diagnosis.model, _retuned(diagnosis))
    if not names:
        return ""
    spread, lie = ("wider spreads", "they lie") if len(names) > 1 else ("a wider spread", "it lies")
    return (
        f"Give {listed(names)} {spread} first, or spread: .inf where nothing is known, and "
        f"diagnose again: {lie} at the end of what was allowed, so a wrong value of a parameter "
        f"may be taken for a cause."
    )


def _retuned(diagnosis) -> PhysicsModel:
    """Return the prior with its re-tuned values."""
    values = {name: parameter.value for name, parameter in diagnosis.parameters_.items()}
    return diagnosis.model.with_parameters(**values)


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
    tried = (each for each in part.known if _was_enough_tried(diagnosis, each))
    names = dict.fromkeys(cause_name(each.effect, each.target) for each in tried)
    them, vain = "them" if len(names) > 1 else "it", ""
    if names:
        vain = f"The search considered {listed(names)}, but the evidence for {them} is too weak."
    said = f"{which} like what has a name: {said}."
    return " ".join(filter(None, (said, vain, known_remedy(diagnosis, part))))


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


def _remedy(diagnosis, known) -> str:
    """Return how a parameter or an effect gets into a diagnosis that could not name it."""
    if known.is_parameter:
        name, parameter = known.target, diagnosis.model.parameters[known.target]
        if parameter.fixed:
            return f"let {name} be fitted (it is fixed in the model)"
        wider = "wider bounds"
        if not math.isinf(parameter.spread):
            wider = "a wider spread, or spread: .inf where nothing is known"
        return f"give {name} {wider}"
    name = cause_name(known.effect, known.target)
    if not _is_considered(diagnosis, known):
        return f"let the diagnosis consider {name} (catalogue, targets)"
    how = "more causes (max_causes)" if diagnosis.complete_ else "more time (time_limit)"
    return f"allow {how}, and {name} may be named"
