"""How strong an effect is, as one number: what the effect itself says of that."""

from collections.abc import Callable

from sklearn_pgnn.physics.effect import Effect, Scales
from sklearn_pgnn.physics.model import PhysicsModel


def sized(
    kind: type[Effect], target: str, model: PhysicsModel, scales: Scales
) -> Callable[[float], Effect]:
    """Return an effect as a function of its size, see `Effect.of_size`."""
    return kind.of_size(target, model, scales)


def has_size(kind: type[Effect]) -> bool:
    """Return whether an effect may be smaller or larger, or is there or not."""
    return bool(kind.size_field())


def main_field(kind: type[Effect]) -> str:
    """Return the field that tells how strong an effect is, see `Effect.size_field`."""
    return kind.size_field()


def nothing(kind: type[Effect], target: str, model: PhysicsModel, scales: Scales) -> float:
    """Return the value of `main_field` at which an effect does nothing, see `Effect.nothing`."""
    return kind.nothing(target, model, scales)
