"""Models as python-control systems, for controller design and frequency responses."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export.sample_steps import (
    acting_inputs,
    explicit_substeps,
    late_inputs,
    past_names,
)
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.pointwise import numpy_function
from sklearn_pgnn.simulation.simulate import hold_of, simulate
from sklearn_pgnn.trajectories.clock import check_sample_interval


def to_control(
    model: PhysicsModel,
    interval: float | None = None,
    *,
    name: str | None = None,
    method: str = "rk4",
    substeps: int | None = None,
) -> Any:
    r"""Return a model as a nonlinear python-control system.

    In continuous time the system is :math:`\dot x = f(t, x, u, p)`, :math:`y = g(t, x, u, p)`; with
    an `interval` it is in discrete time, :math:`x_{k+1} = \Phi(t_k, x_k, u_k, p)`, with the
    simulation's own step as :math:`\Phi`, including friction that sticks and delayed inputs.
    States, inputs and outputs have the model's names, ``params`` its parameters, and
    ``system.linearize(x, u)`` gives a ``StateSpace``.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    interval : float, optional
        Sample interval [s] of a system in discrete time, whose inputs are held between samples; by
        default the system is in continuous time.
    name : str, optional
        Name of the system; by default that of the model, with underscores.
    method : {"rk4", "euler"}, default="rk4"
        Runge-Kutta scheme of a step in discrete time.
    substeps : int, optional
        Integration steps per sample interval; by default as given by the model's `simulation`,
        else enough for explicit steps to be stable at its initial state.

    Returns
    -------
    control.NonlinearIOSystem
        The system. A delayed input in discrete time has its past samples as further states,
        ``force_1_ago`` and so on; a delay is not a parameter of the system.

    Raises
    ------
    ModelError
        If the model has dry friction or delayed inputs and `interval` is not given, or its inputs
        are linearly interpolated and `interval` is given.
    OptionError
        If `model` is not a model or `interval` is not a valid time.

    Examples
    --------
    >>> from sklearn_pgnn.systems import cart_on_spring
    >>> to_control(cart_on_spring()).linearize([0, 0], 0).A
    array([[  0.  ,   1.  ],
           [-20.  ,  -0.75]])
    """
    if not isinstance(model, PhysicsModel):
        raise OptionError(f"to_control: expected a PhysicsModel, got {type(model).__name__}.")
    with needed_by("to_control"):
        from control import nlsys
    if interval is None:
        _refuse_what_is_not_smooth(model)
        states, update, output = list(model.states), _rates(model), _outputs(model, [])
    else:
        check_sample_interval(interval)
        if model.inputs and hold_of(model) == "foh":
            raise ModelError(
                "to_control: linearly interpolated inputs (hold 'foh') cannot be expressed in "
                "discrete time: the next sample is not known. Remedy: "
                "model.replace(simulation={'hold': 'zoh'}), or no interval."
            )
        late = late_inputs(model, interval)
        states = [*model.states, *past_names(late)]
        options = {"method": method, "substeps": explicit_substeps(model, substeps, interval)}
        update, output = _step(model, interval, late, options), _outputs(model, late)
    values = {key: parameter.value for key, parameter in model.parameters.items()}
    return nlsys(
        update,
        output,
        states=states,
        inputs=list(model.inputs),
        outputs=list(model.outputs),
        params={key: value for key, value in values.items() if key not in model.delays.values()},
        dt=0 if interval is None else float(interval),
        name="_".join(model.name.split()) if name is None else name,
    )


def _refuse_what_is_not_smooth(model) -> None:
    """Refuse models that a solver of ordinary differential equations cannot integrate."""
    remedy = "Remedy: to_control(model, interval=0.01), a system in discrete time, can."
    dry = [*map(str, dry_friction(model).flows)]
    if dry:
        raise ModelError(
            f"to_control: {dry[0]!r} sticks in dry friction, which a system in continuous time "
            f"cannot express. {remedy}"
        )
    if model.delays:
        raise ModelError(
            f"to_control: {next(iter(model.delays))!r} is delayed, which a system in continuous "
            f"time cannot express. {remedy}"
        )


def _rates(model) -> Callable:
    """Return the rates in the signature of python-control."""
    rates = _function(model, list(model.equations.values()))

    def update(t, x, u, params):
        return np.array(rates(t, *x, *u, *_values(model, params)), dtype=float)

    return update


def _outputs(model, late) -> Callable:
    """Return the outputs in the signature of python-control."""
    outputs = _function(model, list(model.outputs.values()))
    n = len(model.states)

    def output(t, x, u, params):
        acting, _ = acting_inputs(late, x[n:], u)
        return np.array(outputs(t, *x[:n], *acting, *_values(model, params)), dtype=float)

    return output


def _step(model, interval, late, options) -> Callable:
    """Return the simulation's step per sample in the signature of python-control."""
    at_once = model.replace(delays={})
    own = {name: parameter.value for name, parameter in model.parameters.items()}
    n = len(model.states)

    def update(t, x, u, params):
        acting, past = acting_inputs(late, x[n:], u)
        changed = {name: value for name, value in params.items() if own.get(name) != value}
        run = simulate(
            at_once.with_parameters(**changed) if changed else at_once,
            [0.0, interval] if model.is_autonomous else [t, t + interval],
            np.tile(acting, (2, 1)),
            x[:n],
            **options,
        )
        return np.concatenate([run.x[1], past])

    return update


def _function(model, expressions) -> Callable:
    """Return expressions as a function of time, states, inputs and parameters."""
    return numpy_function(["t", *model.states, *model.inputs, *model.parameters], expressions)


def _values(model, params: Mapping) -> list[float]:
    """Return the parameters' values, those of the model if python-control gives none."""
    return [params.get(name, p.value) for name, p in model.parameters.items()]
