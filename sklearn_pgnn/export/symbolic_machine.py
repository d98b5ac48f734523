"""A model's rates, outputs and step over the symbols of another library."""

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.export.assignments import Assignments, outputs_of, rates_of
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.model_function import METHODS

_OPERATIONS: dict[type, Callable] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_CONSTANTS = {"pi": 3.141592653589793, "e": 2.718281828459045}


class SymbolicMachine:
    """A model over symbols of a library, whose functions `function` returns by name in C."""

    def __init__(
        self,
        model: PhysicsModel,
        function: Callable[[str], Callable],
        free: Mapping[str, Any] | None = None,
        friction_width: float | None = None,
    ):
        self._function, self._width = function, friction_width
        self._p = [(free or {}).get(name, p.value) for name, p in model.parameters.items()]
        self._dry = dry_friction(model).rows
        self._rates, self._outputs = rates_of(model), outputs_of(model)

    def rates(self, t, x: Sequence, u: Sequence) -> list:
        """Return the rates under inputs as they act."""
        return self._evaluate(self._rates, t, x, u)

    def outputs(self, t, x: Sequence, u: Sequence) -> list:
        """Return the outputs under inputs as they act."""
        return self._evaluate(self._outputs, t, x, u)

    def next_sample(self, t, interval: float, substeps: int, x, u, u_next) -> list:
        """Return the states an interval [s] later, by Runge-Kutta steps of order four."""
        h = interval / substeps
        for k in range(substeps):
            start, end = (self._between(u, u_next, (k + i) / substeps) for i in (0, 1))
            x = self._step(t + k * h, h, x, start, end)
        return x

    def _step(self, t, h, x, u, u_next) -> list:
        rate, moved = [0.0] * len(x), list(x)
        for node, weight in zip(*(part.tolist() for part in METHODS["rk4"]), strict=True):
            at = [a + h * node * b for a, b in zip(x, rate, strict=True)]
            rate = self.rates(t + h * node, at, self._between(u, u_next, node))
            moved = [a + h * weight * b for a, b in zip(moved, rate, strict=True)]
        return moved

    @staticmethod
    def _between(u, u_next, share: float) -> list:
        """Return linearly interpolated inputs; held ones are unchanged."""
        ends = zip(u, u_next, strict=True)
        return [a if a is b else a + share * (b - a) for a, b in ends]

    def _evaluate(self, code: Assignments, t, x, u) -> list:
        arrays = {"x": x, "u": u, "p": self._p}
        if self._width is not None:
            arrays["s"] = [self._function("tanh")(v / self._width) for v in self._flows(x)]
        names = {name: arrays[array][i] for name, (array, i) in code.places.items()} | {"t": t}
        for name, expression in code.shared.items():
            names[name] = self._value(expression, names)
        return [self._value(result, names) for result in code.results]

    def _flows(self, x: Sequence) -> list:
        """Return the flows under dry friction."""
        return [sum(c * v for c, v in zip(row, x, strict=True) if c) for row in self._dry]

    def _value(self, node, names: dict[str, Any]):
        """Evaluate a node of a straight-line expression."""
        match node:
            case ast.Name():
                return names[node.id]
            case ast.Constant():
                return float(node.value)  # type: ignore[arg-type]
            case ast.Attribute():
                return _CONSTANTS[node.attr]
            case ast.UnaryOp():
                value = self._value(node.operand, names)
                return -value if isinstance(node.op, ast.USub) else value
            case ast.BinOp():
                parts = (self._value(part, names) for part in (node.left, node.right))
                return _OPERATIONS[type(node.op)](*parts)
            case ast.Compare():
                parts = (self._value(part, names) for part in (node.left, *node.comparators))
                return _OPERATIONS[type(node.ops[0])](*parts)
            case ast.IfExp():
                parts = (self._value(part, names) for part in (node.test, node.body, node.orelse))
                return self._function("if_else")(*parts)
            case ast.Call():
                values = [self._value(argument, names) for argument in node.args]
                return self._called(node.func, values)
        raise ModelError(f"{ast.unparse(node)!r} has no form here.")

    def _called(self, function, values):
        name = getattr(function, "attr", getattr(function, "id", ""))
        if name in ("min", "max"):
            return reduce(self._function(f"f{name}"), values)
        return self._function({"abs": "fabs"}.get(name, name))(*values)
