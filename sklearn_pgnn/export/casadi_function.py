"""Models as CasADi functions for optimal control."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export.sample_steps import acting_inputs, explicit_substeps, late_inputs
from sklearn_pgnn.export.symbolic_machine import SymbolicMachine
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.trajectories.clock import check_sample_interval


def to_casadi(
    model: PhysicsModel,
    interval: float | None = None,
    *,
    friction_width: float | None = None,
    free: Sequence[str] = (),
    substeps: int | None = None,
) -> Any:
    r"""Return a model as a CasADi function, with derivatives, for optimal control.

    Without an `interval` the function gives the rates, :math:`(x, u, p, t) \mapsto (f, g)`; with
    one it gives the next sample, :math:`(x_k, u_k, p, t_k) \mapsto (x_{k+1}, g)`, by the
    simulation's Runge-Kutta steps. If inputs are linearly interpolated, it also takes ``u_next``.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    interval : float, optional
        Sample interval [s].
    friction_width : float, optional
        Speed over which the jump of dry friction is smoothed, :math:`\tanh(v/w)` instead of
        :math:`\mathrm{sign}(v)`, in the unit of the state; required for a state with dry friction,
        because an optimiser needs derivatives.
    free : sequence of str, default=()
        Parameters that form the argument ``p`` of the function, in this order; the others are
        constants.
    substeps : int, optional
        Integration steps per sample interval; by default as given by the model's `simulation`,
        else enough for explicit steps to be stable at its initial state.

    Returns
    -------
    casadi.Function
        Its arguments and results are named ``x``, ``u``, ``u_next``, ``p``, ``t`` and ``rate`` or
        ``x_next``, ``y``. The past samples of a delayed input follow the states in ``x``, the
        latest first.

    Raises
    ------
    ModelError
        If a state has dry friction and `friction_width` is not given, or an input is delayed and
        `interval` is not given.
    OptionError
        If `model` is not a model, or an option has an invalid value.

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
    late, steps = _late(model, interval), explicit_substeps(model, substeps, interval)
    straight = interval is not None and bool(model.inputs) and hold_of(model) == "foh"
    n = len(model.states)
    sizes = {"x": n + sum(each.samples + 1 for each in late), "u": len(model.inputs)}
    sizes |= {"u_next": len(model.inputs)} if straight else {}
    sizes |= {"p": len(free), "t": 1}
    given = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
    parts = {name: casadi.vertsplit(symbols) for name, symbols in given.items()}
    values = dict(zip(free, parts["p"], strict=False))
    machine = SymbolicMachine(model, partial(getattr, casadi), values, friction_width)
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
    dry = [*map(str, dry_friction(model).flows)]
    if dry and friction_width is None:
        raise ModelError(
            f"to_casadi: {dry[0]!r} has dry friction, whose jump an optimiser cannot "
            f"differentiate. Remedy: friction_width=0.01, the speed over which it is rounded off."
        )
    if friction_width is not None and not friction_width > 0:
        raise OptionError(f"friction_width: expected a speed above 0, got {friction_width!r}.")


def _late(model, interval) -> list:
    if interval is not None:
        check_sample_interval(interval)
    if model.delays and interval is None:
        raise ModelError(
            f"to_casadi: {next(iter(model.delays))!r} is delayed, which a rate cannot express. "
            f"Remedy: to_casadi(model, interval=0.01), with its past samples as states."
        )
    return [] if interval is None else late_inputs(model, interval)
