r"""Outputs that repeat the expression of a rate, as that of an accelerometer does.

An output :math:`y = \sum_i c_i \dot x_i + r` is told from its terms: all terms of a rate, times
one factor of parameters and numbers, are among them. Only accelerations may have a factor: the
voltage at the resistor of a high-pass, u - x, is proportional to the rate (u - x)/T, and yet it
does not show a leak of the capacitor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import sympy

from sklearn_pgnn.physics.expressions import expanded, symbol
from sklearn_pgnn.physics.found_ports import is_velocity

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel
    from sklearn_pgnn.physics.port import Port

#: names and expressions
Items = tuple[tuple[str, sympy.Expr], ...]
_BOTH = (True, False)


def shown_rates(model: PhysicsModel) -> dict[str, dict[str, sympy.Expr]]:
    """Return the factors of the rates that a model's outputs repeat, by output and state."""
    outputs, fast = tuple(model.outputs.items()), [s for s in model.states if is_velocity(model, s)]
    parts = [tuple((s, r) for s, r in model.equations.items() if (s in fast) is it) for it in _BOTH]
    constants = frozenset(map(symbol, model.parameters))
    accelerations, others = (repeated_rates(part, outputs, constants) for part in parts)
    found = {name: dict(factors) for name, factors in accelerations.items()}
    for name, factors in others.items():
        found[name] = {**found.get(name, {}), **{s: c for s, c in factors.items() if abs(c) == 1}}
    return {name: factors for name, factors in found.items() if factors}


def with_rates(model: PhysicsModel, rates: Mapping[str, sympy.Expr]) -> dict[str, Any]:
    """Return the changes of a model by new rates, those of outputs that show them with them.

    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> fall = PhysicsModel({"v": "m/s"}, {"v": "F/m"}, {"m": 2.0}, {"F": "N"}, {"a": "der(v)"})
    >>> with_rates(fall, {"v": sympy.Integer(0)})
    {'equations': {'v': 0}, 'outputs': {'a': 0}}
    """
    outputs = dict(model.outputs)
    for output, factors in shown_rates(model).items():
        for state in factors.keys() & rates:
            old, new = model.equations[state], rates[state]
            whole = outputs[output] == old
            outputs[output] = new if whole else outputs[output] + factors[state] * (new - old)
    return {"equations": {**model.equations, **rates}, "outputs": outputs}


def with_output(
    model: PhysicsModel, output: str, change: Callable[[sympy.Expr], sympy.Expr]
) -> dict[str, Any]:
    """Return the changes of a model by an output that is shown otherwise, by ports as well.

    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> brake = PhysicsModel({"w": "rad/s"}, {"w": "-T/J"}, {"J": 2.0}, outputs={"torque": "T"},
    ...                      ports={"disc": {"effort": "T", "flow": "w"}})
    >>> with_output(brake, "torque", lambda shown: 3 * shown)["ports"]["disc"].outputs
    {'torque': 3}
    """
    y = symbol("_y")
    slope, ports = change(y).diff(y), model.kept_ports
    if not slope.has(y):
        ports = {name: _scaled(port, output, slope) for name, port in ports.items()}
    return {"outputs": {**model.outputs, output: change(model.outputs[output])}, "ports": ports}


def _scaled(port: Port, output: str, slope: sympy.Expr) -> Port:
    """Return a port with the coefficient of one output multiplied."""
    return replace(
        port, outputs={n: c * slope if n == output else c for n, c in port.outputs.items()}
    )


@lru_cache(maxsize=256)
def repeated_rates(
    equations: Items, outputs: Items, constants: frozenset[sympy.Symbol]
) -> dict[str, dict[str, sympy.Expr]]:
    """Return the factors of the rates that outputs repeat, by output and state.

    >>> F, m, k, x, b = sympy.symbols("F m k x b")
    >>> rates, outputs = (("v", (F - k * x) / m),), (("acc", b - 2 * (F - k * x) / m), ("F", F))
    >>> repeated_rates(rates, outputs, frozenset({m, k, b}))
    {'acc': {'v': -2}}
    """
    found: dict[str, dict[str, sympy.Expr]] = {}
    longest_first = sorted(equations, key=lambda item: -len(_terms(item[1])))
    for output, left in outputs:
        for state, rate in longest_first:
            factor, left = _factor(left, rate, constants)
            if factor != 0:
                found.setdefault(output, {})[state] = factor
    return found


def _terms(expression: sympy.Expr) -> tuple[sympy.Expr, ...]:
    return sympy.Add.make_args(expanded(expression))


def _factor(
    shown: sympy.Expr, rate: sympy.Expr, constants: frozenset[sympy.Symbol]
) -> tuple[sympy.Expr, sympy.Expr]:
    """Return the factor of a rate in an output, 0 if it is not repeated, and what is left."""
    moving, total = rate.free_symbols - constants, sympy.Integer(0)
    if rate.is_Symbol or not moving or not moving <= shown.free_symbols:
        return total, shown
    if shown == rate:
        return sympy.Integer(1), total
    left, terms = set(_terms(shown)), _terms(rate)
    factors = [part / terms[0] for part in _terms(shown)]
    for factor in factors:
        needed = {factor * term for term in terms}
        still = abs(factor) == 1 if len(terms) == 1 else factor.free_symbols <= constants
        if still and needed <= left:  # what is only one term need not be a rate
            left, total = left - needed, total + factor
    return total, shown if total == 0 else sympy.Add(*left)
