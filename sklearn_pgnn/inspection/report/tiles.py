"""The top of a report: its tiles, and the bar of what removes which part of the error."""

import math
from dataclasses import dataclass

from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.hypothesis import count_parameters
from sklearn_pgnn.inspection.case import known_effects
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import chance, free_run_error, times
from sklearn_pgnn.inspection.report.parameters import parameter_facts
from sklearn_pgnn.inspection.words import rivals
from sklearn_pgnn.inspection.yardstick import (
    in_free_run,
    left_alone,
    over_windows,
    ratio,
    shown_models,
    together,
    told_error,
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


def make_tiles(diagnosis) -> tuple[Tile, ...]:
    """Return the error and how sure it is, then what else is to be looked at."""
    return (_error(diagnosis), _sure(diagnosis), *_doubts(diagnosis))


def worst(tiles) -> str:
    """Return the worst state of some tiles.

    Examples
    --------
    >>> worst([Tile("good", "", "", ""), Tile("look", "", "", "")])
    'look'
    """
    return max((tile.state for tile in tiles), key=list(STATES).index)


# -- the error -------------------------------------------------------------------------------------


def _error(diagnosis) -> Tile:
    """Return the tile of the error that tells most; its state is that of the worst output."""
    told, models = told_error(diagnosis), shown_models(diagnosis)
    errors = [e.best for e in over_windows(diagnosis).values()]
    runs = in_free_run(diagnosis).items()
    errors += [e.best for output, e in runs if diagnosis.free_run_[output].tells]
    much = not all(error <= MUCH for error in errors)
    structured = diagnosis.remaining_.kind == "structure" and diagnosis.discrepancy_ is None
    state = "bad" if much and structured else "look" if much or structured else "good"
    before, *between, after = map(free_run_error, told.by_model.values())
    about = f"Error of {told.output} {'in free run' if told.is_free else 'over held-out windows'}"
    first, *names, last = models.values()
    middle = listed(f"{name} {e}" for name, e in zip(names, between, strict=True))
    noise = diagnosis.gain_[told.output].noise
    left = f"left: {times(ratio(told.by_model[list(models)[-1]], noise))} the noise"
    text = f"{first} → {last}{middle and f' ({middle})'}, root mean square of all records; {left}"
    return Tile(state, about, f"{before} → {after} {told.unit}".rstrip(), text)


# -- how sure --------------------------------------------------------------------------------------


def _sure(diagnosis) -> Tile:
    about = "How sure"
    if diagnosis.causes_ and not diagnosis.tested_:
        return Tile("look", about, "provisional", "not tested, for the search ended early")
    if diagnosis.causes_:
        return _sure_of(diagnosis, min(diagnosis.causes_, key=lambda cause: cause.probability))
    if diagnosis.verdict_ == "unexplained":
        nearest = _runner_up(diagnosis)
        said = f"{nearest}, not sufficient" if nearest else "no candidate was fitted"
        if diagnosis.discrepancy_ is None:
            return Tile("bad", about, "no cause", said)
        return Tile("look", about, "a formula, no cause", f"it describes the records; {said}")
    if not diagnosis.complete_:
        return Tile("look", about, "provisional", "the search ended early")
    if diagnosis.verdict_ == "predicts_nothing":
        return Tile("bad", about, "nothing can be told", "the model runs away from the records")
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
            left = f"an error of {times(candidate.left)} the noise{alone}"
            return f"the runner-up, {cause_name(effect, target)}{which} {left}"
    return ""


# -- what else is to be looked at ------------------------------------------------------------------


def _doubts(diagnosis) -> list[Tile]:
    """Return a tile of the records and one of the parameters, where they are to be looked at."""
    faults, facts = diagnosis.data_quality_, parameter_facts(diagnosis)
    found = ((facts.at_limit, "at a limit"), (facts.unidentified, "not determined by the records"))
    limits = "; ".join(f"{listed(names)} {what}" for names, what in found if names)
    kinds = listed(f"{fault.kind} of {fault.where}" for fault in faults)
    if not faults and diagnosis.stopped_ is not None:
        kinds = "not all checks were made"
    tiles = (
        (
            "Faults of the records",
            f"{len(faults)} {'fault' if len(faults) == 1 else 'faults'}",
            kinds,
        ),
        ("Parameters", f"{len({*facts.at_limit, *facts.unidentified})} in doubt", limits),
    )
    return [Tile("look", *each) for each in tiles if each[-1]]
