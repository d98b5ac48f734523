"""Targets of two quantities, one of which depends on the other, and names of added states."""

from sklearn_pgnn.physics.expressions import same_name
from sklearn_pgnn.physics.model import PhysicsModel


def pair(quantity: str, other: str) -> str:
    """Return two quantities as one target.

    >>> pair("R", "T"), parts("R(T)")
    ('R(T)', ('R', 'T'))
    """
    return f"{quantity}({other})"


def parts(target: str) -> tuple[str, str]:
    """Return the two quantities of a target."""
    quantity, _, other = target.rstrip(")").partition("(")
    return quantity, other


def free_name(model: "PhysicsModel", wanted: str) -> str:
    """Return the first name for a further state that is free in a model."""
    taken = {same_name(name) for name in (*model.states, *model.inputs, *model.parameters)}
    names = (wanted, *(f"{wanted}_{number}" for number in range(2, len(taken) + 3)))
    return next(name for name in names if same_name(name) not in taken)
