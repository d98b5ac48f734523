"""Places of a model where something without a name may act: efforts, rates, inputs and outputs."""

from typing import Any

import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.found_ports import column
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_units import rate_unit
from sklearn_pgnn.physics.repeated_rates import with_rates
from sklearn_pgnn.physics.scales import Scales, typical_inertia


def is_effort(model: PhysicsModel, place: str) -> bool:
    """Return whether a place is the effort of a port, rather than the rate of one state.

    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> is_effort(cart_on_spring(), "v")
    False
    """
    own = place in model.states
    return place in model.ports and not (own and len(model.port(place).rates) == 1)


def places_of(model: PhysicsModel) -> tuple[str, ...]:
    """Name the places where something may be missing: efforts of ports, rates, inputs and outputs.

    The rate of a position is its velocity by definition, and is left out; an input that enters only
    one rate is represented by that rate, and one that enters several as a port does by the port.
    """
    positions = set(model.kinematic_pairs.values())
    ports = tuple(name for name in model.ports if name not in positions)
    columns = [dict(model.port(name).rates) for name in ports]
    several = tuple(
        name for name in model.inputs if len(own := column(model, name)) > 1 and own not in columns
    )
    return (*ports, *several, *(name for name in model.outputs if name not in model.states))


def add_at(model: PhysicsModel, place: str, expression: sympy.Expr) -> dict[str, Any]:
    """Return the changes that add an expression to an effort, a rate, an input or an output."""
    if is_effort(model, place):
        changes = model.port(place).act(model, -expression)
        return {part: changes[part] for part in ("equations", "outputs")}
    if place in model.inputs:
        u = symbol(place)
        return model.changed(lambda each: each.subs(u, u + expression))
    if place in model.states:
        return with_rates(model, {place: model.equations[place] + expression})
    return {"outputs": {**model.outputs, place: model.outputs[place] + expression}}


def signals_at_ports(model: PhysicsModel) -> dict[str, sympy.Expr]:
    """Return the flows and displacements at ports that are no states, by name and by text.

    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> rates = {"x": "v", "v": "F - G", "y": "w", "w": "G"}
    >>> drive = PhysicsModel({"x": "m", "v": "m/s", "y": "m", "w": "m/s"}, rates, {}, {"F": "N"},
    ...     ports={"spring": {"effort": "G", "flow": "w - v"}})
    >>> signals_at_ports(drive)
    {'spring': -v + w, '-x + y': -x + y}
    """
    found = {}
    for name, port in model.ports.items():
        if name not in model.states:
            found[name] = port.flow
        if port.position and port.position not in model.states:
            found[port.position] = port.displacement
    return found


def unit_at(model: PhysicsModel, place: str) -> str:
    """Return the unit of what may be missing at a place.

    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> [unit_at(cart_on_spring(), place) for place in ("v", "force", "position")]
    ['m/s^2', 'N', 'm']
    """
    if is_effort(model, place):
        return model.port(place).unit
    return rate_unit(model.unit(place)) if place in model.states else model.unit(place)


def typical_at(model: PhysicsModel, place: str, scales: Scales) -> float:
    """Return a typical value of what may be missing at a place."""
    if is_effort(model, place):
        return scales.rate[place] * typical_inertia(place, model, scales)
    return scales.rate.get(place, scales.typical[place])
