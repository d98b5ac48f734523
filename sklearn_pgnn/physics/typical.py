"""Typical values, from records, of the quantities that effects depend on."""

from collections.abc import Mapping

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import TIME, parse_expression, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import inertia_at
from sklearn_pgnn.physics.scales import Scales


def typical_by_kind(target: str, model: PhysicsModel, scales: Scales) -> dict[str, float]:
    """Return a typical value of every kind of unit that an effect may depend on."""
    scale = {"s": scales.window, "target": scales.typical.get(target, 1.0)}
    if target in model.ports:
        position = model.port(target).position
        scale["velocity"] = scales.typical[target]
        scale["force"] = scales.rate[target] * typical_inertia(target, model, scales)
        scale["position"] = scales.typical[position] if position else 1.0
    return scale


def typical_inertia(target: str, model: PhysicsModel, scales: Scales) -> float:
    """Return the inertia that an effort at a port moves, 1 where the model has none.

    >>> from sklearn_pgnn.physics.systems import golf_robot
    >>> robot = golf_robot()
    >>> typical_inertia("omega", robot, Scales({}, {}, {}, 0.01, 1.0))
    0.1445
    """
    inertia = inertia_at(model.port(target), model) if target in model.ports else sympy.Integer(1)
    known = dict(scales.typical) | {name: p.value for name, p in model.parameters.items()}
    known[str(TIME)] = 0.0
    return abs(float(inertia.subs({s: known.get(str(s), 1.0) for s in inertia.free_symbols})))


class _OneIfUnknown(dict):
    def __missing__(self, key: str) -> float:
        return 1.0


def typical_value(template: str, scale: Mapping[str, float]) -> float:
    """Return the typical value of a quantity from the template of its unit, 1 if it has none.

    >>> typical_value("{force}*s", {"force": 3.0, "s": 0.5})
    1.5
    """
    text = template.format_map(_OneIfUnknown(scale)).replace("^", "**") or "1"
    try:
        return float(parse_expression(text, ["s"]).subs(symbol("s"), scale.get("s", 1.0)))
    except ModelError:  # a unit of the effect's own
        return 1.0
