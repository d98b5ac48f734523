"""A python-control system as a model."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.python_function import from_function


def from_control(
    system: Any,
    *,
    states: Mapping[str, str] | None = None,
    inputs: Mapping[str, str] | None = None,
    outputs: Sequence[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    **more: Any,
) -> PhysicsModel:
    r"""Return a python-control system as a model.

    Its functions are called once with symbols, as in `from_function`; a linear system has the
    entries of its matrices as constants.

    Parameters
    ----------
    system : control.NonlinearIOSystem or control.StateSpace
        A system in continuous time.
    states, inputs : mapping of str to str, optional
        Names and units, in the system's order; by default its labels, without units.
    outputs : sequence of str, optional
        Names of the outputs in the system's order; by default its labels.
    parameters : mapping, optional
        The constants, as `PhysicsModel` takes them; by default the system's ``params``.
    **more
        Further parameters of `PhysicsModel`.

    Returns
    -------
    PhysicsModel
        The model.

    Raises
    ------
    ModelError
        If the system is in discrete time, has no states, or its functions cannot be traced.

    Examples
    --------
    >>> import control
    >>> def rates(t, x, u, params):
    ...     return [x[1], (u[0] - params["d"] * x[1]) / params["m"]]
    >>> cart = control.nlsys(rates, lambda t, x, u, params: x[:1], states=["x", "v"],
    ...     inputs=["F"], outputs=["place"], params={"m": 2.0, "d": 0.5})
    >>> print(from_control(cart).to_text())
    x' = v
    v' = (F - d*v)/m
    """
    with needed_by("from_control"):
        import control
    if not isinstance(system, control.NonlinearIOSystem):
        raise ModelError(
            f"from_control: expected an nlsys or a StateSpace, got {type(system).__name__}. "
            f"Remedy: control.ss(system) of a transfer function."
        )
    if system.dt not in (None, 0) or not system.nstates:
        raise ModelError(
            f"from_control: expected a system with states in continuous time, got {system.nstates} "
            f"states and dt={system.dt}."
        )
    states = dict(states or dict.fromkeys(map(_name, system.state_labels), ""))
    inputs = dict(inputs or dict.fromkeys(map(_name, system.input_labels), ""))
    outputs = list(outputs or map(_name, system.output_labels))
    _check_count("states", states, system.nstates)
    _check_count("inputs", inputs, system.ninputs)
    _check_count("outputs", outputs, system.noutputs)
    if isinstance(system, control.StateSpace):
        update, output = _linear(system)
    else:
        update, output = system.updfcn, system.outfcn or (lambda t, x, u, params: x)

    def rates(t, x, u, p):
        return update(t, x, u, dict(zip(p.names, p, strict=True)))

    def seen(t, x, u, p):
        found = np.ravel(output(t, x, u, dict(zip(p.names, p, strict=True))))
        return dict(zip(outputs, found, strict=True))

    given = dict(system.params or {}) if parameters is None else parameters
    return from_function(
        rates,
        states,
        inputs=inputs,
        parameters=given,
        outputs=seen,
        **{"name": str(system.name), **more},
    )


def _linear(system):
    A, B, C, D = (np.asarray(matrix) for matrix in (system.A, system.B, system.C, system.D))
    return lambda t, x, u, p: A @ x + B @ u, lambda t, x, u, p: C @ x + D @ u


def _name(label: str) -> str:
    """Return a label as a name: ``x[0]`` becomes x0."""
    return label.replace("[", "").replace("]", "")


def _check_count(part: str, names: Collection[str], count: int) -> None:
    if len(names) != count:
        raise ModelError(f"{part}: expected {count} names, got {', '.join(names) or 'none'}.")
