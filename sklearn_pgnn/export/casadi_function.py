"""Models as functions of CasADi, for optimal control."""

import ast
import operator
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export.assignments import Assignments, outputs_of, rates_of
from sklearn_pgnn.export.late_inputs import acting_inputs, late_inputs
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.source import dry_states
from sklearn_pgnn.simulation.stepping import METHODS

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


def to_casadi(
    model: PhysicsModel,
    interval: float | None = None,
    *,
    friction_width: float | None = None,
    free: Sequence[str] = (),
    substeps: int | None = None,
):
    r"""Return a model as a function of CasADi, with derivatives, for optimal control.

    Without an `interval` the function gives the rates, :math:`(x, u, p, t) \mapsto (f, g)`; with
    one it gives the next sample, :math:`(x_k, u_k, p, t_k) \mapsto (x_{k+1}, g)`, by the
    simulation's Runge-Kutta steps. Where inputs run straight, it takes ``u_next`` too.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    interval : float, optional
        Time from sample to sample [s].
    friction_width : float, optional
        Speed over which the jump of dry friction is rounded off, :math:`\tanh(v/w)` instead of
        :math:`\mathrm{sign}(v)`, in the unit of the state; a state with dry friction needs it, for
        an optimiser has to differentiate.
    free : sequence of str, default=()
        Parameters that the function takes as its argument ``p``, in this order; the others are
        constants.
    substeps : int, optional
        Integration steps from one sample to the next; by default as the model's `simulation` says,
        else 1.

    Returns
    -------
    casadi.Function
        Its arguments and results are named ``x``, ``u``, ``u_next``, ``p``, ``t`` and ``rate`` or
        ``x_next``, ``y``. The past samples of a late input stand in ``x`` after the states, the
        latest first.

    Raises
    ------
    ModelError
        If a state has dry friction and `friction_width` is not given, or an input acts late and
        `interval` is not.
    OptionError
        If `model` is no model, or an option is none of what it can be.

    Examples
    --------
    >>> from sklearn_pgnn.systems import cart_on_spring
    >>> to_casadi(cart_on_spring())([0.1, 0.0], [0.0], [], 0.0)[0]
    DM([0, -2])
    """
    if not isinstance(model, PhysicsModel):
        raise OptionError(f"to_casadi: expected a PhysicsModel, got {type(model).__name__}.")
    with needed_by("to_casadi"):
        import casadi
    unknown = [name for name in free if name not in model.parameters]
    if unknown:
        raise OptionError(f"free: {unknown[0]!r} is no parameter of the model.")
    _check_dry(model, friction_width)
    late, steps = _late(model, interval), _substeps(model, substeps)
    straight = interval is not None and bool(model.inputs) and hold_of(model) == "foh"
    n = len(model.states)
    sizes = {"x": n + sum(each.samples + 1 for each in late), "u": len(model.inputs)}
    sizes |= {"u_next": len(model.inputs)} if straight else {}
    sizes |= {"p": len(free), "t": 1}
    given = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
    parts = {name: casadi.vertsplit(symbols) for name, symbols in given.items()}
    machine = _Machine(casadi, model, friction_width, dict(zip(free, parts["p"], strict=False)))
    x, past, t = parts["x"][:n], parts["x"][n:], given["t"]
    acting, kept = acting_inputs(late, past, parts["u"])
    if interval is None:
        first = machine.rates(t, x, acting)
    else:
        then = acting_inputs(late, kept, parts["u_next"])[0] if straight else acting
        first = [*machine.next_sample(t, interval, steps, x, acting, then), *kept]
    results = [casadi.vertcat(*first), casadi.vertcat(*machine.outputs(t, x, acting))]
    called = ["rate" if interval is None else "x_next", "y"]
    return casadi.Function("model", [*given.values()], results, [*given], called)


def _check_dry(model, friction_width) -> None:
    dry = [state for state, is_dry in zip(model.states, dry_states(model), strict=True) if is_dry]
    if dry and friction_width is None:
        raise ModelError(
            f"to_casadi: {dry[0]!r} has dry friction, whose jump an optimiser cannot "
            f"differentiate. Remedy: friction_width=0.01, the speed over which it is rounded off."
        )
    if friction_width is not None and not friction_width > 0:
        raise OptionError(f"friction_width: expected a speed above 0, got {friction_width!r}.")


def _late(model, interval) -> list:
    if interval is not None and not interval > 0:
        raise OptionError(f"interval: expected a time in seconds above 0, got {interval!r}.")
    if model.delays and interval is None:
        raise ModelError(
            f"to_casadi: {next(iter(model.delays))!r} acts late, which a rate cannot express. "
            f"Remedy: to_casadi(model, interval=0.01), with its past samples as states."
        )
    return [] if interval is None else late_inputs(model, interval)


def _substeps(model, substeps) -> int:
    count = model.simulation.get("substeps", 1) if substeps is None else substeps
    if not isinstance(count, int) or count < 1:
        raise OptionError(f"substeps: expected an integer >= 1, got {substeps!r}.")
    return count


class _Machine:
    """A model's rates and outputs over symbols of CasADi."""

    def __init__(self, casadi, model, friction_width, free):
        self.casadi, self.model, self.width = casadi, model, friction_width
        self.p = [free.get(name, p.value) for name, p in model.parameters.items()]
        self.codes = rates_of(model), outputs_of(model)

    def rates(self, t, x, u) -> list:
        return self._evaluate(self.codes[0], t, x, u)

    def outputs(self, t, x, u) -> list:
        return self._evaluate(self.codes[1], t, x, u)

    def next_sample(self, t, interval, substeps, x, u, u_next) -> list:
        """Step by the simulation's scheme; inputs run straight from u to u_next."""
        h = interval / substeps
        for k in range(substeps):
            ends = [
                [a + (b - a) * (k + i) / substeps for a, b in zip(u, u_next, strict=True)]
                for i in (0, 1)
            ]
            x = self._step(t + k * h, h, x, *ends)
        return x

    def _step(self, t, h, x, u, u_next) -> list:
        rate, moved = [0.0] * len(x), list(x)
        for node, weight in zip(*(part.tolist() for part in METHODS["rk4"]), strict=True):
            at = [a + h * node * b for a, b in zip(x, rate, strict=True)]
            acting = [a + node * (b - a) for a, b in zip(u, u_next, strict=True)]
            rate = self.rates(t + h * node, at, acting)
            moved = [a + h * weight * b for a, b in zip(moved, rate, strict=True)]
        return moved

    def _evaluate(self, code: Assignments, t, x, u) -> list:
        sides = [] if self.width is None else [self.casadi.tanh(v / self.width) for v in x]
        arrays = {"x": x, "u": u, "p": self.p, "s": sides}
        names = {name: arrays[array][i] for name, (array, i) in code.places.items()} | {"t": t}
        for name, expression in code.shared.items():
            names[name] = self._value(expression, names)
        return [self._value(result, names) for result in code.results]

    def _value(self, node, names: dict[str, Any]):
        """Evaluate a node of a straight-line expression."""
        casadi = self.casadi
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
                return casadi.if_else(*parts)
            case ast.Call():
                values = [self._value(argument, names) for argument in node.args]
                return self._called(node.func, values)
        raise ModelError(f"to_casadi: {ast.unparse(node)!r} has no form in CasADi.")

    def _called(self, function, values):
        casadi = self.casadi
        name = getattr(function, "attr", getattr(function, "id", ""))
        extremes = {"min": casadi.fmin, "max": casadi.fmax}
        if name in extremes:
            return reduce(extremes[name], values)
        return getattr(casadi, {"abs": "fabs"}.get(name, name))(*values)
