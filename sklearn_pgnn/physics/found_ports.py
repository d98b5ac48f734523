"""Ports that a model has without saying so: its velocities, and its other states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy

from sklearn_pgnn.physics.derived_units import force_unit, rate_unit
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.port import Port

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel

#: units that make a state a velocity even where no other state is its integral
SPEED_UNITS = frozenset(
    {"m/s", "mm/s", "km/h", "rad/s", "deg/s", "rpm", "1/s", "rev/s", "r/min", "1/min"}
)


def is_velocity(model: PhysicsModel, state: str) -> bool:
    """Return whether a state is a velocity, judged by a position, an inertia or its unit."""
    return (
        state in model.kinematic_pairs
        or state in model.inertia
        or model.states[state].strip() in SPEED_UNITS
    )


def found_ports(model: PhysicsModel) -> dict[str, Port]:
    """Return the ports of a model that it does not declare: one for each state but positions."""
    positions = set(model.kinematic_pairs.values())
    own = (s for s in model.states if s not in positions or is_velocity(model, s))
    return {state: _own_port(model, state) for state in own}


def _own_port(model: PhysicsModel, state: str) -> Port:
    """Return the port at which an effort changes the rate of one state alone."""
    inertia, pair = model.inertia.get(state), model.kinematic_pairs.get(state)
    mobility = sympy.Integer(1) if inertia is None else 1 / inertia
    unit = unit_of_effort(model, state, inertia)
    at = None if pair is None else symbol(pair)
    return Port(state, symbol(state), at, {state: mobility}, {}, unit)


def unit_of_effort(model: PhysicsModel, state: str, inertia: sympy.Expr | None) -> str:
    """Return the unit of a force on a velocity; without an inertia, that of its rate."""
    velocity = model.unit(state)
    if inertia is None:
        return rate_unit(velocity)
    return force_unit(model.unit_of(inertia), velocity)
