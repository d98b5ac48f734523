"""The top of a report: the four tiles, and the bar of what removes which part of the error."""

import math
from dataclasses import dataclass

from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.hypothesis import count_parameters
from sklearn_pgnn.inspection.case import known_effects
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import chance, times
from sklearn_pgnn.inspection.report.parameters import ParameterFacts, parameter_facts
from sklearn_pgnn.inspection.words import rivals
from sklearn_pgnn.inspection.yardstick import (
    in_free_run,
    left_alone,
    over_windows,
    retuning_counts,
    shown_models,
    together,
)
from sklearn_pgnn.record_quality.finding import listed

#: the colours of a tile, the best first, and what they mean to those who see none
STATES = {"good": "OK", "look": "look at this", "bad": "not OK"}
#: probability from which on a cause counts as sure
SURE = 0.95


@dataclass(frozen=True)
class Part:
    """A part of the given model's error: before and after it, in units of the noise."""

    kind: str
    name: str
    before: float
    after: float

    @property
    def size(self) -> float:
        """The part of the error, in units of the noise; not below zero."""
        return max(self.before - self.after, 0.0)


def parts_of_error(diagnosis) -> list[Part]:
    """Return the given model's error, part by part, from re-tuning down to the noise."""
    errors = together(diagnosis)
    parts = [Part("retuning", "re-tuning", errors.prior, errors.refitted)]
    level = errors.refitted
    for cause in diagnosis.causes_:
        after = level * (1.0 - cause.gain / 100.0)
        parts.append(Part("cause", cause_name(cause.effect, cause.target), level, after))
        level = after
    if diagnosis.discrepancy_ is not None:
        parts.append(Part("formula", "the formula", errors.extended, errors.formula))
    noise = min(errors.best, 1.0)
    if errors.best > noise:
        parts.append(Part("left", "left over", errors.best, noise))
    parts.append(Part("noise", "noise", noise, 0.0))
    return parts


def segments_of_bar(diagnosis) -> list[dict]:
    """Return the bar of the parts, in percent of the whole; empty where an error is not finite."""
    parts = parts_of_error(diagnosis)
    whole = sum(part.size for part in parts)
    if not (math.isfinite(whole) and whole > 0):
        return []
    segments, start = [], 0.0
    for part in parts:
        width = 100.0 * part.size / whole
        css = "left-over" if part.kind == "left" else part.kind
        place = {"start": f"{start:.2f}", "width": f"{width:.2f}"}
        segments.append({"size": part.size, "css": css, "text": _said(part), **place})
        start += width
    return segments


def _said(part: Part) -> str:
    if part.kind == "noise":
        return f"noise: {times(part.before)}"
    if part.kind == "left":
        return f"left over: {times(part.before)}, of which {times(part.after)} is noise"
    if not part.size:
        return f"{part.name}: nothing"
    return f"{part.name}: {times(part.before)} → {times(part.after)}"


@dataclass(frozen=True)
class Tile:
    """A tile of a report: its state is a key of `STATES`, its headline the one thing to see."""

    state: str
    about: str
    headline: str
    text: str

    @property
    def meaning(self) -> str:
        """What the colour says, in words."""
        return STATES[self.state]


def make_tiles(diagnosis) -> tuple[Tile, ...]:
    """Return the four tiles."""
    return (
        _left(diagnosis),
        _sure(diagnosis),
        _records(diagnosis),
        _parameters(diagnosis, parameter_facts(diagnosis)),
    )


def worst(tiles) -> str:
    """Return the worst state of some tiles.

    >>> worst([Tile("good", "", "", ""), Tile("look", "", "", "")])
    'look'
    """
    return max((tile.state for tile in tiles), key=list(STATES).index)


# -- what is left ----------------------------------------------------------------------------------


def _left(diagnosis) -> Tile:
    """Return the tile of the output of which most is left."""
    windows = over_windows(diagnosis)
    left = {name: errors.best for name, errors in windows.items()}
    output = max(left, key=lambda name: left[name] if math.isfinite(left[name]) else math.inf)
    errors, run = windows[output], in_free_run(diagnosis)[output]
    tells = diagnosis.free_run_[output].tells
    much = not errors.best <= MUCH or (tells and not run.best <= MUCH)
    structured = diagnosis.remaining_.kind == "structure" and diagnosis.discrepancy_ is None
    of = f" of {output}" if len(windows) > 1 else ""
    *others, (_, last) = shown_models(diagnosis).items()
    by = ", ".join(f"{said} {times(getattr(errors, which))}" for which, said in others)
    free = times(run.best) if tells else "not informative"
    text = f"left{of} over held-out windows {last} ({by}); in free run {free}"
    state = "bad" if much and structured else "look" if much or structured else "good"
    return Tile(state, "What is left", f"{times(errors.best)} noise", text)


# -- how sure --------------------------------------------------------------------------------------


def _sure(diagnosis) -> Tile:
    about = "How sure"
    if diagnosis.causes_ and not diagnosis.tested_:
        return Tile("look", about, "not tested", "the search ended early")
    if diagnosis.causes_:
        return _sure_of(diagnosis, min(diagnosis.causes_, key=lambda cause: cause.probability))
    if diagnosis.verdict_ == "unexplained":
        nearest = _runner_up(diagnosis)
        said = f"{nearest}, not sufficient" if nearest else "no candidate was fitted"
        if diagnosis.discrepancy_ is None:
            return Tile("bad", about, "no cause", said)
        return Tile("look", about, "a formula, no cause", f"it describes the records; {said}")
    if not diagnosis.complete_:
        return Tile("look", about, "not complete", "the search ended early")
    parts = ("no candidate of the catalogue improves it", _runner_up(diagnosis))
    return Tile("good", about, "nothing named", "; ".join(filter(None, parts)))


def _sure_of(diagnosis, cause) -> Tile:
    name, sure = cause_name(cause.effect, cause.target), cause.probability >= SURE
    if cause.is_open:
        text = f"for {name}, which these records cannot distinguish from {rivals(cause)}"
    else:
        text = "; ".join(filter(None, (f"for {name}", _runner_up(diagnosis))))
    state = "good" if sure and not cause.is_open and diagnosis.complete_ else "look"
    return Tile(state, "How sure", chance(cause.probability), text)


def _runner_up(diagnosis) -> str:
    """Return what the nearest candidate that was not named leaves; empty if none was looked at."""
    named = {(cause.effect, cause.target) for cause in diagnosis.causes_}
    known = known_effects(diagnosis)
    most = max((count_parameters(known[e](target)) for e, target in named), default=math.inf)
    for candidate in left_alone(diagnosis):
        if candidate.name not in named:
            effect, target = candidate.name
            more = count_parameters(known[effect](target)) > most
            which = ", which has more parameters, leaves" if more else ", leaves"
            alone = " alone" if len(named) != 1 else ""
            left = f"{times(candidate.left)}{alone}"
            return f"the runner-up, {cause_name(effect, target)}{which} {left}"
    return ""


# -- records and parameters ------------------------------------------------------------------------


def _records(diagnosis) -> Tile:
    faults, about = diagnosis.data_quality_, "Faults of the records"
    if not faults:
        early = diagnosis.stopped_ is not None
        text = "not all checks were made" if early else "in the records, by all checks"
        return Tile("look" if early else "good", about, "0 faults", text)
    count = f"{len(faults)} {'fault' if len(faults) == 1 else 'faults'}"
    kinds = listed(f"{fault.kind} of {fault.where}" for fault in faults)
    return Tile("look", about, count, kinds)


def _parameters(diagnosis, facts: ParameterFacts) -> Tile:
    found = (
        (facts.at_limit, "at a limit"),
        (facts.unidentified, "not determined by the records"),
        (facts.changed, "changed beyond the interval"),
    )
    said = "; ".join(f"{listed(names)} {what}" for names, what in found if names)
    if facts.at_limit:
        return Tile("look", "Parameters", f"{len(facts.at_limit)} at a limit", said)
    if facts.unidentified:
        count = len(facts.unidentified)
        return Tile("look", "Parameters", f"{count} not identifiable", said)
    if facts.changed:
        headline = f"{len(facts.changed)} changed"
        return Tile("good", "Parameters", headline, f"{said}; none at a limit")
    return _unchanged(diagnosis)


def _unchanged(diagnosis) -> Tile:
    """Return the tile where no single parameter left its interval, whatever all did together."""
    text = "the interval of each holds the given value; none at a limit"
    found = ["cause" if len(diagnosis.causes_) == 1 else "causes"] if diagnosis.causes_ else []
    found += [] if diagnosis.discrepancy_ is None else ["formula"]
    if found or not retuning_counts(diagnosis):
        beside = f"with the {listed(found)} in the model, " if found else ""
        return Tile("good", "Parameters", "as given", f"{beside}{text}")
    errors = together(diagnosis)
    worth = f"{times(errors.prior)} → {times(errors.refitted)} noise"
    return Tile("good", "Parameters", "changed jointly", f"{worth}; yet {text}")
