r"""Ports that a model has without saying so.

Every state but a position is one: a force at a velocity with its inertia, a heat flow at a
temperature. On coupled machines the force enters several rates. These are known from an input that
does so, since it acts at its own velocity, or from the kinetic energy:

.. math:: E = \tfrac12 v^\top M(x)\, v, \qquad \dot v = M^{-1}(x) (e + \ldots) .
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import sympy

from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.mass_matrix import coupled, mobility, own_entry
from sklearn_pgnn.physics.model_units import EFFORTS, flow_unit, force_unit, rate_unit
from sklearn_pgnn.physics.port import Port
from sklearn_pgnn.physics.units import is_like, read_unit

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel

#: units that make a state a velocity even where no other state is its integral
SPEED_UNITS = frozenset(
    {"m/s", "mm/s", "km/h", "rad/s", "deg/s", "rpm", "1/s", "rev/s", "r/min", "1/min"}
)
#: states and parameters are drawn anew so often to tell a sign
DRAWS = 24
#: range of states: every angle, and a bit of everything else
RANGE = np.pi
#: parameters are drawn within this share of their values
NEAR = 0.1
#: most velocities, and most operations in a mass matrix, for which it is inverted
MOST_VELOCITIES, MOST_OPERATIONS = 4, 400


def is_velocity(model: PhysicsModel, state: str) -> bool:
    """Return whether a state is a velocity, judged by a position, an inertia or its unit."""
    return (
        state in model.kinematic_pairs
        or state in model.inertia
        or model.states[state].strip() in SPEED_UNITS
    )


def found_ports(model: PhysicsModel, declared: Collection[Port]) -> dict[str, Port]:
    """Return the ports beside the declared ones: one for each other state but positions."""
    positions, taken = set(model.kinematic_pairs.values()), {port.flow for port in declared}
    own = [s for s in model.states if s not in positions or is_velocity(model, s)]
    free = [s for s in own if symbol(s) not in taken]
    several = _coupled(model, declared, free)
    return {s: several[s] if s in several else _own_port(model, s) for s in free}


def _port(model: PhysicsModel, state: str, rates: Mapping[str, sympy.Expr], unit: str) -> Port:
    pair = model.kinematic_pairs.get(state)
    return Port(state, symbol(state), None if pair is None else symbol(pair), rates, {}, unit)


def _own_port(model: PhysicsModel, state: str) -> Port:
    """Return the port at which an effort changes the rate of one state alone."""
    entries = model.inertia if state in model.inertia else model.capacity
    rates = mobility(entries)[state] if state in entries else {state: sympy.Integer(1)}
    return _port(model, state, rates, unit_of_effort(model, state))


def unit_of_effort(model: PhysicsModel, state: str, inertia: sympy.Expr | None = None) -> str:
    """Return the unit of a force on a velocity, of a flow into a store, or else of the rate."""
    velocity = model.unit(state)
    if state in model.capacity:
        return flow_unit(model.unit_of(own_entry(model.capacity, state) * symbol(state)))
    inertia = own_entry(model.inertia, state) if inertia is None else inertia
    if inertia is None:
        return rate_unit(velocity)
    unit = model.unit_of(inertia)
    if not unit and state in coupled(model.inertia):
        return EFFORTS.get(velocity, "")
    return force_unit(unit, velocity)


# -- forces that enter several rates ---------------------------------------------------------------


def _coupled(model: PhysicsModel, declared: Collection[Port], free: list[str]) -> dict[str, Port]:
    """Return the ports of velocities whose mass matrix the model does not state."""
    stated = {*model.forces, *coupled(model.inertia)}
    if all(v in stated for v in free if is_velocity(model, v)):
        return {}
    found = {**_of_inputs(model, [dict(port.rates) for port in declared]), **_of_energy(model)}
    return {v: port for v, port in found.items() if v not in stated}


def _of_inputs(model: PhysicsModel, known: list[dict[str, sympy.Expr]]) -> dict[str, Port]:
    """Return the ports of inputs that enter the rates of several velocities.

    A force acts at the one velocity that it always drives forward. Where no coefficient depends on
    a state, the input may as well act between two masses, and so it does where it moves no more
    than the velocity's own inertia: then the port must be declared.
    """
    found: dict[str, Port] = {}
    twice = set()
    for name, unit in model.inputs.items():
        slopes = column(model, name)
        driven = "" if slopes in known else _driven(model, slopes)
        own = own_entry(model.inertia, driven)
        alone = own is not None and slopes[driven] == 1 / own
        if driven and not alone and _is_effort(unit, model.unit(driven)):
            twice |= {driven} & set(found)
            found[driven] = _port(model, driven, slopes, unit)
    return {state: port for state, port in found.items() if state not in twice}


def column(model: PhysicsModel, name: str) -> dict[str, sympy.Expr]:
    """Return the derivatives of the rates that contain an input or a parameter by it."""
    u = symbol(name)
    return {s: rate.diff(u) for s, rate in model.equations.items() if u in rate.free_symbols}


def _driven(model: PhysicsModel, column: Mapping[str, sympy.Expr]) -> str:
    """Return the velocity at which an input acts that enters several rates; empty if unclear."""
    moving = {symbol(s) for s in model.states}
    inputs = {symbol(u) for u in model.inputs}
    used = {s for each in column.values() for s in each.free_symbols}
    known = all(is_velocity(model, s) for s in column)
    if len(column) < 2 or not known or not used & moving or used & inputs:
        return ""
    values = {symbol(name): p.value for name, p in model.parameters.items()}
    forward = [s for s, b in column.items() if always_positive(b, values, moving)]
    return forward[0] if len(forward) == 1 else ""


def _is_effort(unit: str, flow: str) -> bool:
    """Return whether a unit times that of a velocity may be a power."""
    one, other = read_unit(unit), read_unit(flow)
    if not unit or not flow or one is None or other is None:
        return True
    return is_like(one * other, read_unit("W"))


def _of_energy(model: PhysicsModel) -> dict[str, Port]:
    """Return the ports of velocities that the stored energy couples, or that have no inertia."""
    stored = model.energy.get("stored")
    moving = tuple(symbol(s) for s in model.states if is_velocity(model, s))
    if stored is None or not moving:
        return {}
    found = {}
    for v, column in inverse_masses(stored, moving).items():
        rates = {str(s): b for s, b in column.items() if b != 0}
        if len(rates) > 1 or str(v) not in model.inertia:
            unit = unit_of_effort(model, str(v), 1 / column[v])
            found[str(v)] = _port(model, str(v), rates, unit)
    return found


def always_positive(
    expression: sympy.Expr,
    parameters: Mapping[sympy.Symbol, float],
    states: Collection[sympy.Symbol],
) -> bool:
    """Return whether an expression is positive at all states that are drawn.

    >>> m, q = sympy.symbols("m q", real=True)
    >>> [always_positive(each, {m: 2.0}, {q}) for each in (1 / (m + sympy.sin(q)), sympy.cos(q))]
    [True, False]
    """
    rng = np.random.default_rng(0)
    signs = [_sign(expression, parameters, states, rng) for _ in range(DRAWS)]
    known = [sign for sign in signs if np.isfinite(sign)]
    return 2 * len(known) >= DRAWS and min(known) > 0


def _sign(
    expression: sympy.Expr,
    parameters: Mapping[sympy.Symbol, float],
    states: Collection[sympy.Symbol],
    rng: np.random.Generator,
) -> float:
    point = {p: value * (1 + NEAR * rng.uniform(-1, 1)) for p, value in parameters.items()}
    point |= {s: RANGE * rng.uniform(-1, 1) for s in sorted(states, key=str)}
    values = {s: sympy.Float(point.get(s, 1.0)) for s in expression.free_symbols}
    try:
        return float(np.sign(float(expression.xreplace(values))))
    except (TypeError, ValueError):  # not real there
        return np.nan


@lru_cache(maxsize=64)
def inverse_masses(
    energy: sympy.Expr, velocities: tuple[sympy.Symbol, ...]
) -> dict[sympy.Symbol, dict[sympy.Symbol, sympy.Expr]]:
    r"""Return the columns of the inverse of :math:`\partial^2 E/\partial v_i \partial v_j`."""
    moving = tuple(v for v in velocities if energy.has(v))
    if not 0 < len(moving) <= MOST_VELOCITIES or energy.count_ops() > MOST_OPERATIONS:
        return {}
    mass = sympy.hessian(energy, moving).applyfunc(sympy.expand)
    if mass.free_symbols & set(moving) or sum(each.count_ops() for each in mass) > MOST_OPERATIONS:
        return {}
    size = sympy.factor_terms(mass.det())
    if size == 0:
        return {}
    inverse = mass.adjugate().applyfunc(lambda above: sympy.factor_terms(above) / size)
    return {v: dict(zip(moving, inverse[:, i], strict=True)) for i, v in enumerate(moving)}
