"""Pairs of causes to separate, and causes that no record can separate."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from sklearn_pgnn.diagnosis.result import NamedCause
from sklearn_pgnn.estimation.candidate import Candidate
from sklearn_pgnn.experiment_design.separation import Separation
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.differences import DIFFERENCES
from sklearn_pgnn.physics.effects.wiring import WIRINGS

#: what has an effect and a target, or begins with them
Named: TypeAlias = Any


def pair_of(cause: NamedCause) -> Candidate:
    """Return the effect and target of a cause."""
    return Candidate(cause.effect, cause.target)


def effect_named(named: Named, catalogue: Sequence[type[Effect]]) -> Effect:
    """Return the effect of a catalogue with a given id and target.

    >>> from sklearn_pgnn.physics.effects import InputBias
    >>> effect_named(("input_bias", "F"), (InputBias,)) == InputBias("F")
    True
    """
    if isinstance(named, str):
        raise ValueError(f"cause: expected an effect and its target, as ({named!r}, 'v'), got one.")
    effect, target = (named.effect, named.target) if hasattr(named, "effect") else named[:2]
    for kind in (*catalogue, *WIRINGS, *DIFFERENCES):
        if effect in (kind, kind.id):
            return kind(target)
    raise ValueError(
        f"cause: expected an effect of the catalogue "
        f"({', '.join(kind.id for kind in catalogue)}), got {effect!r}."
    )


def with_equivalent(cause: NamedCause, separations: Collection[Separation]) -> NamedCause:
    """Return a named cause with its equivalent causes, which no record separates from it."""
    mine = pair_of(cause)
    same = {found.other for found in separations if found.cause == mine and found.equivalent}
    equivalent = (Candidate(o.effect, o.target) for o in cause.confused_with)
    return replace(cause, equivalent=tuple(o for o in equivalent if o in same))


def two_to_separate(
    causes: Mapping[Effect, NamedCause],
    catalogue: Sequence[type[Effect]],
    cause: Named | None,
    other: Named | None,
) -> tuple[Effect, Effect]:
    """Return a named cause, and the cause to separate it from."""
    if cause is None and not causes:
        raise ValueError("cause: expected a cause, but the diagnosis names none.")
    mine = next(iter(causes)) if cause is None else effect_named(cause, catalogue)
    if mine not in causes:
        named = ", ".join(f"{each.id} of {each.target}" for each in causes) or "nothing"
        raise ValueError(
            f"cause: expected one that was named ({named}), got {mine.id} of {mine.target}."
        )
    confused = causes[mine].confused_with
    if other is None and not confused:
        raise ValueError(
            f"other: expected a cause, got none, and {mine.id} of {mine.target} has no rival. "
            f"Remedy: pass other=(effect, target), the cause to separate it from."
        )
    return mine, effect_named(confused[0] if other is None else other, catalogue)
