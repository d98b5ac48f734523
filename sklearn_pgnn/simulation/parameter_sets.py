"""Simulate a model at many values of its parameters, on all cores."""

from collections.abc import Mapping

import numpy as np
from joblib import Parallel, delayed

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.exceptions import OptionError, SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.callbacks import report_calls
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.inputs import delayed_inputs
from sklearn_pgnn.simulation.model_function import IMPLICIT
from sklearn_pgnn.simulation.simulate import (
    check_arrays,
    hold_of,
    parameter_values,
    told_steps,
)
from sklearn_pgnn.simulation.stepping import run_trajectory, usual_interval
from sklearn_pgnn.simulation.substeps import Steps
from sklearn_pgnn.threads import local_threads
from sklearn_pgnn.user_line import warn_user

#: parts of the work that every thread takes in turn
PARTS = 4


def simulate_sets(
    model: PhysicsModel,
    t: ArrayLike,
    u: ArrayLike | None = None,
    x0: ArrayLike | None = None,
    *,
    parameters: Mapping[str, np.ndarray],
    method: str | None = None,
    substeps: int | None = None,
    hold: str | None = None,
    n_jobs: int | None = None,
) -> np.ndarray:
    r"""Simulate the outputs of a model at many sets of parameters.

    .. math:: y_s = g(x_s, u, p_s), \quad \dot x_s = f(x_s, u, p_s), \quad s = 1 \dots n

    Parameters
    ----------
    model : PhysicsModel
        The model.
    t : array-like of shape (n_samples,)
        Time [s], increasing.
    u : array-like of shape (n_samples, n_inputs) or (n_samples,), optional
        Inputs.
    x0 : array-like of shape (n_states,), optional
        Initial state; by default the model's, see `simulate`.
    parameters : mapping of str to array-like of shape (n_sets,)
        The values of each parameter that differs [its unit]; the others keep the model's.
    method : {"rk4", "euler", "rosenbrock"}, optional
        Scheme of a step, see `simulate`; by default as the model says, else "rk4".
    substeps : int, optional
        Steps from one sample to the next; by default as the model says, else 1.
    hold : {"zoh", "foh"}, optional
        How inputs vary between samples, see `simulate`.
    n_jobs : int, optional
        Threads, as joblib counts them: None means 1 unless a `joblib.parallel_config` says
        otherwise, -1 all cores.

    Returns
    -------
    ndarray of shape (n_sets, n_samples, n_outputs)
        The outputs, identical to the last bit to single simulations in the same steps; NaN from
        where a simulation became non-finite, which a `SimulationWarning` reports.

    Raises
    ------
    ValueError
        If a parameter is unknown, the numbers of values differ, or time, inputs or initial state
        are not as `simulate` requires.

    Examples
    --------
    How much a time constant that is known to 10 % leaves open:

    >>> from sklearn_pgnn import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> T = np.random.default_rng(0).normal(2.0, 0.2, 1000)
    >>> y = simulate_sets(lag, np.linspace(0, 2, 21), np.ones(21), parameters={"T": T})
    >>> y.shape, y[:, -1, 0].std().round(2).item()
    ((1000, 21, 1), 0.04)
    """
    t, u, x0 = check_arrays(model, t, u, x0)
    hold = hold_of(model, hold)
    method, substeps = told_steps(model, substeps, method) or Steps()
    names, values = _read(model, parameters)
    function, source = compile_model(model, () if method == IMPLICIT else None, method)
    outputs = np.full((len(values), t.size, len(model.outputs)), np.nan)
    fixed = parameter_values(model), [list(model.parameters).index(name) for name in names]
    is_late = any(delay in names for delay in model.delays.values())
    acting, usual = delayed_inputs(model, t, u, hold == "foh"), usual_interval(t)

    def run(part) -> None:
        states = np.empty((t.size, len(x0)))
        nq = source.n_sensitivities  # of which the values do not matter
        nothing, no_slopes = np.zeros((len(x0), nq)), np.empty((t.size, len(model.outputs), nq))
        p, at = fixed[0].copy(), fixed[1]
        for s in part:
            p[at], felt = values[s], acting
            if is_late:
                here = model.with_parameters(**dict(zip(names, values[s].tolist(), strict=True)))
                felt = delayed_inputs(here, t, u, hold == "foh")
            run_trajectory(
                function.argument, t, felt, hold == "foh", p, x0.copy(), nothing,
                source.dry, substeps, source.size, usual, states, outputs[s], no_slopes,
            )  # fmt: skip

    count = local_threads(n_jobs)
    parts = np.array_split(np.arange(len(values)), max(1, min(PARTS * count, len(values))))
    Parallel(count, require="sharedmem")(delayed(run)(part) for part in parts)
    report_calls()
    _warn_of_lost(model, outputs)
    return outputs


def _read(model: PhysicsModel, parameters) -> tuple[list[str], np.ndarray]:
    """Return the names of the parameters that differ, and their values, one set per row."""
    columns = {name: np.asarray(values, dtype=float) for name, values in parameters.items()}
    for name, column in columns.items():
        if name not in model.parameters:
            raise OptionError(
                f"parameters: unknown parameter {name!r}; expected some of "
                f"{', '.join(model.parameters) or 'none'}."
            )
        if column.ndim != 1 or not np.isfinite(column).all():
            raise OptionError(
                f"parameters: expected finite values of {name!r} of shape (n_sets,), got shape "
                f"{column.shape}."
            )
    sizes = {column.size for column in columns.values()}
    if len(sizes) != 1:
        found = ", ".join(f"{column.size} of {name}" for name, column in columns.items())
        raise OptionError(
            f"parameters: expected the same number of values for every parameter, got "
            f"{found or 'none'}."
        )
    return list(columns), np.column_stack(list(columns.values()))


def _warn_of_lost(model: PhysicsModel, outputs: np.ndarray) -> None:
    """Warn of sets whose simulation became non-finite."""
    lost = np.flatnonzero(~np.isfinite(outputs[:, -1]).all(axis=-1))
    if lost.size:
        warn_user(
            f"the simulation of {model.name!r} became non-finite at {lost.size} of {len(outputs)} "
            f"parameter sets, first at set {lost[0]}. Remedy: raise substeps, or check the "
            f"parameter values of these sets.",
            SimulationWarning,
        )
