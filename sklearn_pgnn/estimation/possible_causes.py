"""The possible causes of a model's error: the effects of a catalogue, each at every target."""

from collections.abc import Callable, Collection, Iterable, Iterator
from difflib import get_close_matches
from itertools import takewhile

from sklearn_pgnn.estimation.same_in_equations import already_holds, same_parameter
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.channel_kinds import can_have
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.user_line import warn_user


def possible_causes(
    model: PhysicsModel,
    catalogue: Iterable[type[Effect]],
    targets: Collection[str] | None = None,
    each_step: Callable[[], bool | None] = lambda: None,
) -> tuple[Effect, ...]:
    """List the causes of a catalogue that a model does not hold, where `each_step` lets."""
    listed = takewhile(lambda _: not each_step(), _effects_on(model, catalogue, targets))
    return tuple(effect for effect in listed if _is_candidate(model, effect))


def is_possible(
    model: PhysicsModel,
    catalogue: Iterable[type[Effect]],
    targets: Collection[str] | None = None,
) -> bool:
    """Return whether a catalogue has any cause that a model does not already hold."""
    return any(_is_candidate(model, effect) for effect in _effects_on(model, catalogue, targets))


def _is_candidate(model: PhysicsModel, effect: Effect) -> bool:
    """Return whether a model does not already hold an effect."""
    return not already_holds(model, effect) and same_parameter(model, effect) is None


def _effects_on(
    model: PhysicsModel, catalogue: Iterable[type[Effect]], targets: Collection[str] | None
) -> Iterator[Effect]:
    """Yield the effects of a catalogue on the targets that are considered, and can have them."""
    effects = (kind(target) for kind in catalogue for target in kind.targets(model))
    asked = (effect for effect in effects if targets is None or effect.target in targets)
    return (effect for effect in asked if can_have(model, effect))


def warn_of_taken_names(
    model: PhysicsModel, catalogue: Iterable[type[Effect]], targets: Collection[str] | None = None
) -> None:
    """Warn of effects that are no candidates because the model uses a name of theirs otherwise.

    A parameter of another unit is not the effect's own, where that is known.
    """
    for effect in _effects_on(model, catalogue, targets):
        for parameter in effect.parameters(model):
            known = model.parameters.get(parameter.name)
            if known is not None and parameter.unit not in ("", known.unit):
                warn_user(
                    f"{effect.id} of {effect.target!r} is not considered: it would add a parameter "
                    f"{parameter.name!r} [{parameter.unit}], and the model has one of that name "
                    f"[{known.unit}]. Remedy: rename the model's parameter."
                )


def check_targets(
    model: PhysicsModel, targets: Collection[str] | None, catalogue: Iterable[type[Effect]] = ()
) -> None:
    """Refuse targets that a model does not have."""
    if isinstance(targets, str):
        raise OptionError(
            f"targets: expected a sequence of states, inputs, outputs and parameters of "
            f"{model.name!r}, got {targets!r}. Remedy: targets=[{targets!r}]."
        )
    if not targets:
        return
    known = [*model.states, *model.inputs, *model.outputs, *model.parameters]
    known += [target for kind in (*CATALOGUE, *catalogue) for target in kind.targets(model)]
    known = list(dict.fromkeys(known))
    for name in targets:
        if name not in known:
            near = get_close_matches(str(name), known, n=1)
            meant = f"did you mean {near[0]!r}?" if near else f"one of {', '.join(known)}."
            raise OptionError(
                f"targets: expected states, inputs, outputs and parameters of {model.name!r}, "
                f"got {name!r}; {meant}"
            )
