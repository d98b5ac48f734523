"""The states of a model that its outputs measure."""

from sklearn_pgnn.physics.model import PhysicsModel


def shown_by(model: PhysicsModel, output: str) -> tuple[str, ...]:
    """Return the state that an output measures directly, then the velocity of that position.

    >>> from sklearn_pgnn.physics import systems
    >>> shown_by(systems.cart_on_spring(), "position")
    ('x', 'v')
    """
    state = str(model.outputs[output])
    if state not in model.states:
        return ()
    return (state, *(v for v, position in model.slope_pairs.items() if position == state))


def shown_states(model: PhysicsModel) -> frozenset[str]:
    """Return the states that outputs measure: directly, or as velocity of a measured position."""
    return frozenset(state for output in model.outputs for state in shown_by(model, output))


def told_states(model: PhysicsModel) -> frozenset[str]:
    """Return the states on which the outputs depend directly, and the velocities of such positions.

    >>> lever = PhysicsModel({"x": "m", "v": "m/s"}, {"x": "v", "v": "-x"}, outputs={"y": "2*x"})
    >>> sorted(told_states(lever)), sorted(shown_states(lever))
    (['v', 'x'], [])
    """
    read = {str(s) for output in model.outputs.values() for s in output.free_symbols}
    velocities = {v for v, position in model.slope_pairs.items() if position in read}
    return frozenset((read & set(model.states)) | velocities)
