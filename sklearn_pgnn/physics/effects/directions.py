"""Coefficients that differ by the direction of their flow."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import sympy

from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.rates import is_velocity
from sklearn_pgnn.physics.expressions import maximum, minimum, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales

#: signals in a flow, whose signs at all ends of their ranges are looked at
MOST = 6


@dataclass(frozen=True)
class CoefficientByDirection(Effect):
    r"""A coefficient that has another value in one direction of the flow that it causes.

    .. math:: k\,s \quad\text{for}\ s \leq 0, \qquad k\,(1 + a)\,s \quad\text{for}\ s > 0

    The flow :math:`s` is what :math:`k` multiplies (or is divided by it) in an equation: the heat
    that comes in, the current that charges, the flow through a valve. Where it enters two
    equations with opposite signs, it goes from one store to the other, and its direction is that
    in the first. What was known as the parameter may be the value in either direction, or one
    between: both values are fitted, within the parameter's bounds.

    Parameters
    ----------
    target : str
        The parameter.
    change : float, default=0
        Relative difference :math:`a` of the parameter for a positive flow [-].

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> water = PhysicsModel(
    ...     {"T": "K"}, {"T": "UA*(Ta - T)/C"}, {"UA": 5.0, "C": 9e4}, {"Ta": "K"}
    ... )
    >>> CoefficientByDirection.targets(water)
    ('UA',)
    >>> print((water + CoefficientByDirection("UA", change=-0.5)).to_text())
    T' = dir_UA*max(0, UA*(-T + Ta)/C) + UA*(-T + Ta)/C
    """

    change: float = quantity("dir", "", low=-0.99)
    id = "coefficient_by_direction"
    generalises = ("wrong_parameter",)
    revalues = True
    phrase = "{target} that differs by direction"
    lacking = "has a"
    summary = (
        "This parameter differs in the two directions of its flow: heating and cooling, charge and "
        "discharge, a check valve."
    )
    check = "Identify it from what goes in one direction, and from what goes in the other."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the coefficients of flows that move no mass, each flow once."""
        found: dict[tuple, str] = {}
        ways = {name: _flows(model, name) for name in model.free_parameters}
        for name in sorted(ways, key=lambda name: any(flow.divides for flow in ways[name])):
            places = tuple((flow.part, flow.name, flow.flow) for flow in ways[name])
            if places:
                found.setdefault(places, name)
        return tuple(name for name in model.free_parameters if name in found.values())

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Change the part of the flow in one direction."""
        parts = {"equations": dict(model.equations), "outputs": dict(model.outputs)}
        flows = _flows(model, self.target)
        for way in flows:
            same = (_ratio(model, way.flow, flows[0].flow) or 1.0) > 0
            forward = maximum(way.flow, 0) if same else minimum(way.flow, 0)
            change = 1 / (1 + p["change"]) - 1 if way.divides else p["change"]
            parts[way.part][way.name] += change * forward
        return dict(parts)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep a part of the flow, and a factor of twenty."""
        return {"change": (-0.98, 20.0)}

    def is_shown(self, model: PhysicsModel, scales: Scales) -> bool:
        """Return whether the flow may go in both directions within the signals' ranges."""
        values = {symbol(name): p.value for name, p in model.parameters.items()}
        flow = _flows(model, self.target)[0].flow.subs(values)
        moving = sorted(flow.free_symbols, key=str)
        if len(moving) > MOST or any(str(s) not in scales.peak for s in moving):
            return True
        ends = product(*(scales.ends(str(s)) for s in moving))
        at = [complex(flow.subs(dict(zip(moving, end, strict=True)))) for end in ends]
        signs = {np.sign(value.real) for value in at if not value.imag}
        return {-1.0, 1.0} <= signs


@dataclass(frozen=True)
class _Flow:
    """What a coefficient multiplies, or is divided by it, in an equation or an output."""

    part: str
    name: str
    flow: sympy.Expr
    divides: bool


def _flows(model: PhysicsModel, name: str) -> tuple[_Flow, ...]:
    """Return the flows of a coefficient; none if it acts in any other way."""
    found = []
    for part in ("equations", "outputs"):
        for key, whole in getattr(model, part).items():
            if whole.has(symbol(name)):
                flow = _flow(model, part, key, whole, symbol(name))
                if flow is None:
                    return ()
                found.append(flow)
    divides = any(flow.divides for flow in found)
    if divides and not all(_ratio(model, flow.flow, found[0].flow) for flow in found):
        return ()  # a capacity of several stores
    return tuple(found)


def _flow(
    model: PhysicsModel, part: str, key: str, whole: sympy.Expr, p: sympy.Symbol
) -> _Flow | None:
    """Return the flow of a coefficient in an expression, if it is one that may turn."""
    slope = whole.diff(p)
    divides = slope.has(p)
    flow = -slope * p if divides else slope * p
    if divides and (part == "outputs" or (flow * p).has(p)):
        return None
    moving = {str(s) for s in flow.free_symbols} - set(model.parameters)
    known = {*model.states, *model.inputs}
    if not moving or not moving <= known or model.parameters[str(p)].value == 0:
        return None
    positions = model.kinematic_pairs.values()
    if part == "equations" and (key in positions or is_velocity(model, key)):
        return _Flow(part, key, flow, divides) if moving <= set(model.inputs) else None
    return _Flow(part, key, flow, divides)


def _ratio(model: PhysicsModel, flow: sympy.Expr, first: sympy.Expr) -> float | None:
    """Return the ratio of two flows at the parameters' values; None where it is not constant."""
    values = {symbol(name): p.value for name, p in model.parameters.items()}
    ratio = sympy.cancel(flow / first).subs(values)
    return float(ratio) if ratio.is_number else None
