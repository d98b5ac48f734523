"""A diagnosis in words: what a screen and a report say of it, and of what to do about it."""

import itertools
import math

import numpy as np

from sklearn_pgnn.diagnosis.outside import OPEN
from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.hypothesis import commute
from sklearn_pgnn.estimation.without_model import free_values, squares_without_model
from sklearn_pgnn.inspection.cause_names import candidate_name, cause_name
from sklearn_pgnn.inspection.numbers import chance, number, percent, readable, times
from sklearn_pgnn.inspection.yardstick import (
    in_free_run,
    is_adequate_as_given,
    over_windows,
    told_error,
)
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import find_effect
from sklearn_pgnn.physics.effects.rates import is_moving
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.places import is_effort
from sklearn_pgnn.physics.port import against
from sklearn_pgnn.physics.spread_ends import at_bounds, at_spread_ends
from sklearn_pgnn.record_quality.finding import listed
from sklearn_pgnn.record_quality.refits import differing

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


#: what a cause may be confused with, if the search ended before it had rivals
NOT_COMPARED = "not known: the diagnosis ended before others were compared"
#: what acts where no cause of the catalogue does
UNNAMED = "something that is not in the catalogue"
#: smallest probability of it that is listed with the others
WORTH_SAYING = 0.01


def rivals(cause) -> str:
    """Return the rivals of a cause with their probabilities; no name, or nothing, is one too."""
    others = [(cause_name(o.effect, o.target), o.probability) for o in cause.confused_with]
    none = 1.0 - cause.probability - sum(probability for _, probability in others)
    if none >= WORTH_SAYING:
        others.append((UNNAMED, none))
    return listed(f"{name} ({chance(probability)})" for name, probability in others)


def rivals_or_none(cause, complete: bool) -> str:
    """Return the rivals of a cause; if there are none, whether it was compared with others."""
    return rivals(cause) or ("nothing" if complete else NOT_COMPARED)


def held_beside(cause, causes) -> str:
    """Return the other causes that may be something else, with which the sizes of one may change.

    Empty where every other cause is sure.
    """
    others = (other for other in causes if other is not cause and other.is_open)
    names = listed(cause_name(other.effect, other.target) for other in others)
    return f"{names}: with another cause in its place the sizes may differ" if names else ""


def verdict_sentence(diagnosis) -> str:
    """Return the verdict of a diagnosis in plain words, and what else is to be said of it."""
    return " ".join(filter(None, (early_end(diagnosis), *told_verdict(diagnosis))))


def told_verdict(diagnosis) -> tuple[str, str]:
    """Return the verdict of a diagnosis in one sentence, and what else is to be said of it."""
    said, *more = _SAID[diagnosis.verdict_](diagnosis)
    return said, " ".join(filter(None, more))


def early_end(diagnosis) -> str:
    """Return why a diagnosis ended early, and what that means; empty where it did not."""
    if not diagnosis.stopped_:
        return ""
    is_whole = diagnosis.complete_
    left = "the search was complete" if is_whole else "this is the best result so far"
    return f"Ended early ({diagnosis.stopped_}); {left}."


def _so_far(diagnosis) -> tuple[str, ...]:
    """Return what an unfinished search holds."""
    the_model = _the_model(diagnosis)
    if not diagnosis.causes_:
        said = f"The {the_model} lacks something, and no cause was found yet"
        return (f"{said}{_worth(diagnosis)}.",)
    said = f"The best guess so far is that the {the_model} {lacks(diagnosis.causes_)}"
    return f"{said}{_worth(diagnosis)}.", "It was not tested against the rest of the catalogue."


def _the_model(diagnosis) -> str:
    """Return what the prior is called in a sentence, after its article."""
    name = diagnosis.model.name
    return "model" if name == PhysicsModel.name else f"model of the {name}"


def unusable_sentence(diagnosis) -> str:
    """Return how many candidates could not be fitted, and which; empty if there are none."""
    lost = diagnosis.unusable_
    if not lost:
        return ""
    names = listed(dict.fromkeys(candidate_name(effect, target) for effect, target, _ in lost))
    fits = "fit" if len(lost) == 1 else "fits"
    return f"{len(lost)} {fits} failed and could not be evaluated: {names}."


def lacks(causes) -> str:
    """Return a phrase for what a model without some causes lacks, or has a wrong value of."""
    names: dict[str, list[str]] = {}
    for cause in causes:
        verb, name = find_effect(cause.effect).lacking, cause_name(cause.effect, cause.target)
        is_likeness = verb == Effect.lacking and cause.outside > cause.probability
        names.setdefault(verb, []).append(f"something like {name}" if is_likeness else name)
    return " and ".join(f"{verb} {listed(each)}" for verb, each in names.items())


def _causes(diagnosis) -> tuple[str, ...]:
    """Return the causes and what they are worth."""
    said = f"The {_the_model(diagnosis)} {lacks(diagnosis.causes_)}"
    if diagnosis.verdict_ == "ambiguous":
        said += f", or {_others(diagnosis)}, which these records do not separate"
    more = _order(diagnosis).strip(), _in_free_run(diagnosis), _described(diagnosis)
    return f"{said}{_worth(diagnosis)}.", *more


def _missing(diagnosis) -> tuple[str, ...]:
    """Return what is missing and has no name."""
    part, why = diagnosis.discrepancy_, "no known effect explains"
    if part is not None and part.has_names:
        why = "no cause that was considered explains, though its formula has names"
    said = f"The {_the_model(diagnosis)} lacks something that {why}{_worth(diagnosis)}."
    return said, _in_free_run(diagnosis), _described(diagnosis)


def _nothing_found(diagnosis) -> tuple[str, ...]:
    """Return that much is left, and that nothing that was tried explains it."""
    left = _left(over_windows(diagnosis), "refitted") + much_in_free_run(diagnosis)
    said = f"No effect of the catalogue improves the {_the_model(diagnosis)}; but after re-tuning"
    return f"{said} its error is {left}.", _in_free_run(diagnosis)


def much_in_free_run(diagnosis) -> str:
    """Return where far more is left in free run beside what the errors of the fit explain."""
    left = diagnosis.remaining_.in_free_run
    much = [f"{times(x)} {_of(o, 'the noise', left)}" for o, x in left.items() if not x <= MUCH]
    return f", and in free run {listed(much)} beyond the errors of the fit" if much else ""


def _is_adequate(diagnosis) -> str:
    """Return that the model is adequate, as given or re-tuned."""
    the_model, errors = _the_model(diagnosis), over_windows(diagnosis)
    if not diagnosis.complete_:
        return f"The error of the re-tuned {the_model} is little more than noise."
    if is_adequate_as_given(diagnosis):
        said = f"as given: its error is {_left(errors, 'prior')}"
    else:
        left = listed(
            f"{times(e.refitted)} {_of(output, 'the noise', errors)} (as given {times(e.prior)})"
            for output, e in errors.items()
        )
        said = f"after re-tuning: its error is {left}"
    return f"The {the_model} is adequate {said}, and no effect of the catalogue improves it."


def _left(errors, which: str) -> str:
    """Return what a model leaves of every output, in units of the noise."""
    return listed(
        f"{times(getattr(e, which))} {_of(output, 'the noise', errors)}"
        for output, e in errors.items()
    )


def _of(output: str, what: str, outputs) -> str:
    """Return a statement about an output, with its name where there are several."""
    return f"{what} of {output}" if len(outputs) > 1 else what


def remaining_sentence(diagnosis) -> str:
    """Return a sentence on the remaining residuals: noise, a disturbance or structure."""
    remaining = diagnosis.remaining_
    if remaining.kind == "noise":
        return f"What is left is white noise{much_in_free_run(diagnosis)}."
    errors = {output: e.extended for output, e in over_windows(diagnosis).items()}
    much = listed(
        f"{times(x)} the white noise of {output}"
        for output, x in sorted(errors.items(), key=lambda item: -item[1])
    )
    if remaining.kind == "structure":
        without = "" if diagnosis.discrepancy_ is None else " without the formula"
        law = law_sentence(diagnosis.model, remaining.law)
        why = _of_single_records(diagnosis) or ", so physics is still missing."
        return f"What is left{without} is structure ({much}): {law}{why}"
    if not diagnosis.complete_:
        return f"What is left is more than noise ({much}); what it depends on was not tested."
    if diagnosis.verdict_ == "predicts_nothing":
        return "What is left is the model's own error: it says nothing about the machine."
    return _disturbance(diagnosis, much)


def _disturbance(diagnosis, much: str) -> str:
    """Return what is left that no law predicts; a test that finds nothing proves nothing."""
    why = _of_single_records(diagnosis)
    if why:
        return f"What is left is more than noise ({much}){why}"
    if diagnosis.discrepancy_ is not None:
        return f"What is left without the formula is more than noise ({much}); it explains most."
    if diagnosis.remaining_.is_much:
        much += much_in_free_run(diagnosis)
        return (
            f"What is left is more than noise ({much}), and no law that was tried predicts it "
            f"beyond chance from what was recorded, neither as it is nor as it was before: "
            f"coloured noise, a disturbance, or physics that these records do not show."
        )
    return (
        f"What is left is coloured noise or a disturbance ({much}): nothing that was recorded "
        f"predicts it, neither as it is nor as it was before."
    )


def _of_single_records(diagnosis) -> str:
    """Return that a parameter differs between records; empty where none was seen to."""
    differs = differing(diagnosis.data_quality_, diagnosis.model)
    if differs is None:
        return ""
    return f". The same model fitted to each record alone explains most of it: {differs.text}."


def law_sentence(model: PhysicsModel, law: Structure) -> str:
    """Return where a law without a name acts, what it depends on, and what it explains."""
    on = listed(law.depends_on) or "what was recorded"
    memory = f", and on what was some {number(law.memory, 2)} s before" if law.memory else ""
    return (
        f"it depends on {on}{memory}. A law that acts on {place_name(model, law.place)} explains "
        f"{percent(law.share)} of it in records not used for it"
    )


def place_name(model: PhysicsModel, target: str) -> str:
    """Return the place of a missing part."""
    if is_effort(model, target):
        of = model.port(target)
        force = "torque" if of.unit.endswith("N m") else "force"
        return f"the {force} {against(of, model)}" if is_moving(model, of) else f"the {of.name}"
    return f"the rate of {target}" if target in model.states else target


def dependence(diagnosis, part) -> str:
    """Return a sentence on what a missing part depends on; empty where that is not known."""
    if not part.quantities:
        return ""
    several, names = len(part.quantities) > 1, listed(part.quantities)
    if part.share < diagnosis.smallest_share:
        say = "these explain" if several else "that explains"
        return (
            f"Its formula holds {names}, but in records not used for it {say} almost nothing of "
            f"its smoothed time series: treat it as a hint only. "
        )
    verb, share = "explain" if several else "explains", percent(part.share)
    return f"It depends on {names}, which {verb} {share} of its smoothed time series. "


def _described(diagnosis) -> str:
    """Return the place and the formula of a missing part; empty if there is none."""
    part = diagnosis.discrepancy_
    if part is None:
        return ""
    on, errors, runs = dependence(diagnosis, part), over_windows(diagnosis), in_free_run(diagnosis)
    free = listed(
        f"{times(run.best)}{f' of {output}' if len(runs) > 1 else ''}"
        for output, run in runs.items()
        if diagnosis.free_run_[output].tells
    )
    return (
        f"Something is missing in {place_name(diagnosis.model, part.target)}. {on}With "
        f"{readable(part.formula)} added there the error is {_left(errors, 'best')} over "
        f"held-out windows{f', and in free run {free}' if free else ''}. "
        f"{known_sentence(diagnosis, part)}"
    ).rstrip()


def _others(diagnosis) -> str:
    others = {
        cause_name(other.effect, other.target): None
        for cause in diagnosis.causes_
        for other in cause.confused_with
    }
    if any(cause.outside >= OPEN for cause in diagnosis.causes_):
        others[UNNAMED] = None
    place = "in its place" if len(diagnosis.causes_) == 1 else "in the place of one of them"
    return f"{' or '.join(others)} {place}"


def _order(diagnosis) -> str:
    """Return the order in which causes act on a signal, where another would change the model.

    An effect added later to a model acts earlier on a command, and later on a sensor's signal.
    """
    model, said = diagnosis.model, ""
    for signal in (*model.inputs, *model.outputs):
        met = [cause for cause in diagnosis.records_.causes if cause.target == signal]
        if not all(commute(model, *pair) for pair in itertools.combinations(met, 2)):
            met = met[::-1] if signal in model.inputs else met
            names = [cause_name(effect.id, effect.target) for effect in met]
            said += f"{signal} passes through {', then '.join(names)} (the order matters). "
    return said


def _worth(diagnosis) -> str:
    """Return a clause on the error as given, and with all that was found."""
    told = told_error(diagnosis)
    before, *_, after = told.by_model.values()
    found = ["it" if len(diagnosis.causes_) == 1 else "them"] * bool(diagnosis.causes_)
    found += ["a formula"] * (diagnosis.discrepancy_ is not None)
    how = f"with {listed(found)}" if found else "re-tuned"
    where = "in free run" if told.is_free else f"over windows of {number(diagnosis.window_, 3)} s"
    changes = "falls" if after < before else "goes"
    ends = (number(e, 3) if math.isfinite(e) else "infinite (it diverges)" for e in (before, after))
    said = f": {how}, the error of {told.output} {where} {changes} from {' to '.join(ends)}"
    return f"{said} {told.unit}".rstrip()


def _in_free_run(diagnosis) -> str:
    """Return for which outputs the free run is not informative, and which are worse in it."""
    return f"{_silent(diagnosis)} {_worse_in_free_run(diagnosis)}".strip()


def _silent(diagnosis) -> str:
    """Return the outputs whose free run is not informative, if there are any."""
    silent = [output for output, error in diagnosis.free_run_.items() if not error.tells]
    if not silent:
        return ""
    of = f" of {listed(silent)}" if len(silent) < len(diagnosis.free_run_) else ""
    return (
        f"The free run{of} is not informative: without restarts, no model predicts the records "
        f"better than their mean does, as with an unstable or chaotic machine, or where a "
        f"parameter's spread excludes its true value."
    )


def _worse_in_free_run(diagnosis) -> str:
    """Return the outputs that are farther from the records than as given, if there are any."""
    runs = in_free_run(diagnosis).items()
    found = {output: error for output, error in runs if diagnosis.free_run_[output].tells}
    much = 1.0 / math.sqrt(1.0 - diagnosis.smallest_share)
    worse = {output: e for output, e in found.items() if not e.best <= much * e.prior}
    if not worse:
        return ""
    rise = [
        _of(output, f"{times(e.prior)} as given, {times(e.best)} now", found)
        for output, e in worse.items()
    ]
    is_short = any(finding.kind == "short records" for finding in diagnosis.data_quality_)
    cure = "record longer" if is_short else "make window_length longer"
    return (
        f"But in free run, without restarts, its error is larger than as given, in units of the "
        f"noise: {listed(rise)}. Windows are re-initialised, so they show little of what builds up "
        f"over a whole record: {cure}, or fix known parameters."
    )


def separation_sentence(separation) -> str:
    """Return a sentence on the experiment that would separate two causes."""
    one, other = (cause_name(c.effect, c.target) for c in (separation.cause, separation.other))
    if separation.equivalent:
        return (
            f"No experiment with these inputs and outputs separates {one} from {other}: in the "
            f"equations they are the same."
        )
    if not separation.separable:
        return (
            f"No experiment tried within these amplitudes separates {one} from {other}: look for "
            f"another sensor, a larger range or a higher sampling rate."
        )
    best = separation.experiments[0]
    reached = listed(f"{name} up to {number(top, 2)}" for name, top in best.reached.items())
    often = f", recorded {best.repeats:g} times" if best.repeats > 1 else ""
    unit = "" if best.unit in ("", "1") else f" {best.unit}"
    return (
        f"To separate {one} from {other}, apply {best.excitation}, {best.input} by "
        f"{number(best.amplitude, 2)}{unit} about {number(best.offset, 2)}{unit}, for "
        f"{number(best.duration, 3)} s ({reached}){often}. The two then differ by "
        f"{times(best.difference)} the noise, {number(best.evidence, 2)} standard errors "
        f"in one record."
    )


_SAID = {
    "cause_named": _causes,
    "ambiguous": _causes,
    "unexplained": _missing,
    "provisional": _so_far,
    "predicts_nothing": runaway_sentences,
    "nothing_found": _nothing_found,
    "model_adequate": lambda diagnosis: (_is_adequate(diagnosis), _in_free_run(diagnosis)),
}
