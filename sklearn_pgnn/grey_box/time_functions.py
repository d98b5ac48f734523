"""What is a function of the time alone: it describes how one record went, not the machine."""

from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.physics.expressions import TIME
from sklearn_pgnn.physics.model import PhysicsModel


def depends_on_time(model: PhysicsModel) -> bool:
    """Return whether the time itself stands in a model's equations or outputs.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> depends_on_time(lag), depends_on_time(lag.replace(equations={"y": "(u - y)/T + t"}))
    (False, True)
    """
    return any(TIME in e.free_symbols for e in (*model.equations.values(), *model.outputs.values()))


def time_invariant_causes(model: PhysicsModel) -> tuple[type[Effect], ...]:
    """Return the effects of the catalogue that make no model depend on the time that did not."""
    if depends_on_time(model):
        return tuple(CATALOGUE)
    return tuple(
        kind
        for kind in CATALOGUE
        if not any(depends_on_time(kind(target).apply(model)) for target in kind.targets(model))
    )
