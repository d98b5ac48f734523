"""The tiles at the top of a report: the error, how sure it is, and what is to be looked at."""

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
    told_error,
)
from sklearn_pgnn.physics.effects import CATALOGUE, read_catalogue
from sklearn_pgnn.record_quality.finding import listed

#: the colours of a tile, the best first, and what they mean to those who see none
STATES = {"good": "OK", "look": "look at this", "bad": "not OK"}
#: probability from which on a cause counts as sure
SURE = 0.95


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

    >>> worst([Tile("good", "", "", ""), Tile("look", "", "", "")])
    'look'
    """
    return max((tile.state for tile in tiles), key=list(STATES).index)


# -- the error -------------------------------------------------------------------------------------


def _error(diagnosis) -> Tile:
    """Return the tile of the error that tells most; its state is that of the worst output."""
    told, models, runs = told_error(diagnosis), shown_models(diagnosis), in_free_run(diagnosis)
    left = {
        name: max(e.best, runs[name].best if diagnosis.free_run_[name].tells else 0.0)
        for name, e in over_windows(diagnosis).items()
    }
    much = [name for name, error in left.items() if not error <= MUCH]
    structured = diagnosis.remaining_.kind == "structure" and diagnosis.discrepancy_ is None
    state = "bad" if much and structured else "look" if much or structured else "good"
    before, *between, after = map(free_run_error, told.by_model.values())
    first, *names, last = models.values()
    middle = listed(f"{name} {e}" for name, e in zip(names, between, strict=True))
    known = ratio(list(told.by_model.values())[-1], diagnosis.gain_[told.output].noise)
    others = "".join(f", {times(left[name])} of {name}" for name in much if name != told.output)
    text = (
        f"{first} → {last}{middle and f' ({middle})'}, root mean square of all records; "
        f"left: {times(known)} the noise{others}"
    )
    about = f"Error of {told.output} {'in free run' if told.is_free else 'over held-out windows'}"
    return Tile(state, about, f"{before} → {after} {told.unit}".rstrip(), text)


# -- how sure --------------------------------------------------------------------------------------


def _sure(diagnosis) -> Tile:
    about = "How sure"
    if diagnosis.causes_ and not diagnosis.tested_:
        return Tile("look", about, "provisional", "not tested, for the search ended early")
    if diagnosis.causes_:
        cause = min(diagnosis.causes_, key=lambda each: each.probability)
        text = f"for {cause_name(cause.effect, cause.target)}"
        if cause.is_open:
            text += f", which these records cannot distinguish from {rivals(cause)}"
        elif nearest := _runner_up(diagnosis):
            text += f"; {nearest}"
        is_whole = len(read_catalogue(diagnosis.catalogue)) >= len(CATALOGUE)
        if diagnosis.targets is not None or not is_whole:
            text += f"; of {len(diagnosis.candidates_)} candidates that were asked for"
        sure = cause.probability >= SURE and not cause.is_open and diagnosis.complete_
        return Tile("good" if sure else "look", about, chance(cause.probability), text)
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
