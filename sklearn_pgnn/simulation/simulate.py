"""Simulate a model along a trajectory; a failure is part of the result, with its remedy."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Integral
from types import MappingProxyType

import numpy as np

from sklearn_pgnn.exceptions import OptionError, SimulationError, SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_parts import HOLDS
from sklearn_pgnn.simulation.callbacks import report_calls
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.fastest import fastest
from sklearn_pgnn.simulation.inputs import delayed_inputs
from sklearn_pgnn.simulation.model_function import IMPLICIT, SCHEMES
from sklearn_pgnn.simulation.stepping import run_trajectory, usual_interval
from sklearn_pgnn.simulation.substeps import EXPLICIT, STABLE, Steps, enough_steps
from sklearn_pgnn.user_line import warn_user

#: change of a quantity, as a share of its range, that is small
SMALL = 1e-3
#: eigenvalue times step up to which one step is as accurate as that without a trial
SLOW = 0.5


@dataclass(frozen=True)
class Simulation:
    """A simulated trajectory.

    Parameters
    ----------
    t : ndarray of shape (n_samples,)
        Time [s].
    x : ndarray of shape (n_samples, n_states)
        States; NaN from where the simulation became non-finite.
    y : ndarray of shape (n_samples, n_outputs)
        Outputs.
    wrt : tuple of str
        What `sensitivities` are taken by: parameters, then initial states as ``"x(0)"``.
    sensitivities : ndarray of shape (n_samples, n_outputs, n_wrt) or None
        Derivatives of the outputs.
    message : str
        Empty, or where and when the simulation failed and what to do.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModel
    >>> run = PhysicsModel({"y": "V"}, {"y": "-y"}).simulate([0.0, 0.5, 1.0], x0=[1.0])
    >>> run.y[:, 0].round(3)
    array([1.   , 0.607, 0.368])
    """

    t: np.ndarray
    x: np.ndarray
    y: np.ndarray
    wrt: tuple[str, ...] = ()
    sensitivities: np.ndarray | None = None
    message: str = ""

    @property
    def success(self) -> bool:
        """Whether every sample is finite."""
        return not self.message

    def check(self) -> "Simulation":
        """Return the simulation itself if every sample is finite.

        Returns
        -------
        Simulation
            This simulation.

        Raises
        ------
        SimulationError
            If it became non-finite, with the remedy.
        """
        if self.message:
            raise SimulationError(self.message)
        return self


def simulate(
    model: PhysicsModel,
    t,
    u=None,
    x0=None,
    *,
    method: str | None = None,
    substeps: int | None = None,
    hold: str | None = None,
    wrt: tuple[str, ...] | None = None,
) -> Simulation:
    """Simulate a model on the record's own clock.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    t : array-like of shape (n_samples,)
        Time [s], increasing; the steps may be uneven.
    u : array-like of shape (n_samples, n_inputs) or (n_samples,), optional
        Inputs; ``u[k]`` acts from ``t[k]`` on.
    x0 : array-like of shape (n_states,), optional
        Initial state; by default the model's `initial_state`, and for its `settled` states the
        first value of their inputs.
    method : {"rk4", "euler", "rosenbrock"}, optional
        Runge-Kutta scheme of order four, explicit Euler, or linearly implicit steps of order three
        for stiff models; by default as the model's `simulation` says, else the first, or the last
        where `substeps` is not given either and the first would need more than 32.
    substeps : int, optional
        Steps from one sample to the next, of which a long interval takes more; by default as the
        model's `simulation` says, else 1 by a given `method`, else as many as accuracy needs.
    hold : {"zoh", "foh"}, optional
        Whether an input is held between two samples or interpolated linearly; by default as the
        model's `simulation` says, else held.
    wrt : tuple of str, optional
        Parameters to differentiate the outputs by; the initial state is added.

    Returns
    -------
    Simulation
        States and outputs. If the simulation becomes non-finite, the rest is NaN, `message` says
        where, when and which remedy, and a `SimulationWarning` is given.

    Raises
    ------
    ValueError
        If the time does not increase, a shape does not fit or an input is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 10, 101)
    >>> bool(abs(simulate(lag, t, np.ones(101)).y[-1, 0] - (1 - np.exp(-5))) < 1e-6)
    True
    """
    t, u, x0 = check_arrays(model, t, u, x0)
    hold, told = hold_of(model, hold), told_steps(model, substeps, method)
    unknown = [name for name in wrt or () if name not in model.parameters]
    if unknown:
        raise ValueError(f"wrt: unknown parameter {unknown[0]!r}.")
    acting = delayed_inputs(model, t, u, hold == "foh")
    if told is not None:
        return simulate_acting(model, t, acting, x0, *told, hold, wrt)
    tried = _tried(model, t, acting, x0, hold, Steps())
    is_slow = tried.success and speed_of(model, [tried], [acting], SLOW) <= SLOW
    if is_slow and wrt is None:
        return tried

    def run(steps: Steps) -> list[Simulation]:
        return [_tried(model, t, acting, x0, hold, steps)]

    steps = Steps() if is_slow else steps_of_runs(model, run, [acting])
    return simulate_acting(model, t, acting, x0, *steps, hold, wrt)


def _tried(model, t, acting, x0, hold, steps: Steps) -> Simulation:
    with warnings.catch_warnings():  # what a function raises is told: it is told only once
        warnings.filterwarnings("ignore", "the simulation of", SimulationWarning)
        return simulate_acting(model, t, acting, x0, *steps, hold)


def speed_of(model: PhysicsModel, runs, actings, enough: float = 0.0) -> float:
    """Return the largest eigenvalue times step along runs, see `fastest`."""
    pairs = zip(runs, actings, strict=True)
    return max(
        (fastest(model, r.t, u, r.x, usual_interval(r.t), enough) for r, u in pairs), default=0.0
    )


def steps_of_runs(model: PhysicsModel, run, actings, method=None) -> Steps:
    """Return as many steps as runs need to change by a small share of every quantity's range."""

    def values(runs) -> np.ndarray:
        return np.concatenate([np.array([*each.x.T, *each.y.T]) for each in runs], axis=1)

    def change(coarse, finer):
        coarse, finer, least = values(coarse), values(finer), np.finfo(float).tiny
        with np.errstate(invalid="ignore", over="ignore"):  # of simulations that diverge
            changed = np.max(np.abs(finer - coarse), axis=1)
            return float(np.max(changed / (SMALL * np.ptp(finer, axis=1) + least)))

    runs = run(Steps())
    fast = speed_of(model, runs, actings)
    if not all(each.success for each in runs) or fast > STABLE:
        fast = max(fast, speed_of(model, run(Steps(IMPLICIT)), actings))
    return enough_steps(run, change, fast, method=method)


def simulate_acting(
    model: PhysicsModel,
    t,
    acting,
    x0,
    method=EXPLICIT,
    substeps=1,
    hold=HOLDS[0],
    wrt=None,
    usual=None,
) -> Simulation:
    """Simulate a model on inputs as they act, its delays applied already."""
    by = () if wrt is None and method == IMPLICIT else wrt
    function, source = compile_model(model, by, method)
    nx, ny, n, nq = len(model.states), len(model.outputs), t.size, source.n_sensitivities
    X, Y, SY = np.empty((n, nx)), np.empty((n, ny)), np.empty((n, ny, nq))
    S = np.zeros((nx, nq))
    if by is not None:
        S[:, len(by) :] = np.eye(nx)
    failed = run_trajectory(
        function.argument,
        t,
        acting,
        hold == "foh",
        parameter_values(model),
        x0.copy(),
        S,
        source.dry,
        substeps,
        source.size,
        usual_interval(t) if usual is None else usual,
        X,
        Y,
        SY,
    )
    report_calls()
    for values in (X, Y, SY) if failed >= 0 else ():
        values[failed:] = np.nan
    message = "" if failed < 0 else _remedy(model, t, X, failed, substeps)
    if message:
        warn_user(message, SimulationWarning)
    names = () if wrt is None else (*wrt, *(f"{state}(0)" for state in model.states))
    return Simulation(t, X, Y, names, None if wrt is None else SY, message)


def hold_of(model: PhysicsModel, hold: str | None = None) -> str:
    """Return how inputs run between samples: as given, else as in the model, else held.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> hold_of(lag), hold_of(lag.replace(simulation={"hold": "foh"})), hold_of(lag, "foh")
    ('zoh', 'foh', 'foh')
    """
    hold = model.simulation.get("hold", HOLDS[0]) if hold is None else hold
    if hold not in HOLDS:
        raise ValueError(f"hold: expected one of {', '.join(HOLDS)}, got {hold!r}.")
    return hold


def told_steps(
    model: PhysicsModel, substeps: int | None = None, method: str | None = None
) -> Steps | None:
    """Return the steps that the arguments give, or the model; None where neither says a thing."""
    if substeps is None and method is None and not {"substeps", "method"} & {*model.simulation}:
        return None
    method = str(model.simulation.get("method", EXPLICIT)) if method is None else method
    check_method(method)
    return Steps(method, substeps_of(model, substeps))


def substeps_of(model: PhysicsModel, substeps: int | None = None) -> int:
    """Return the integration steps from sample to sample: as given, else as in the model, else 1.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> substeps_of(lag), substeps_of(lag.replace(simulation={"substeps": 4})), substeps_of(lag, 2)
    (1, 4, 2)
    """
    substeps = model.simulation.get("substeps", 1) if substeps is None else substeps
    if not isinstance(substeps, Integral) or isinstance(substeps, bool) or substeps < 1:
        raise OptionError(f"substeps: expected an integer >= 1, got {substeps!r}.")
    return int(substeps)


def simulate_records(model: PhysicsModel, records, **options) -> np.ndarray:
    """Simulate the outputs of every record in free run, concatenated."""
    return np.concatenate(
        [simulate(model, r.t, r.u, start_of(model, r), **options).y for r in records]
    )


def start_of(model: PhysicsModel, record) -> list[float]:
    """Return a record's initial state: its own values, settled ones, the model's for the rest."""
    x0 = () if record.x0 is None else zip(model.states, record.x0, strict=False)
    told = {name: float(value) for name, value in x0 if np.isfinite(value)}
    start = settled_start(model, record.u[0], told)
    return [start[name] for name in model.states]


def settled_start(
    model: PhysicsModel, u, told: Mapping[str, float] = MappingProxyType({})
) -> dict[str, float]:
    """Return the initial state: as told, else settled where others start, else the model's."""
    first = dict(zip(model.inputs, map(float, u), strict=True)) | {**model.initial_state, **told}
    followed = {state: first[name] for state, name in model.settled.items()}
    return {**model.initial_state, **followed, **told}


def parameter_values(model: PhysicsModel) -> np.ndarray:
    """Return the parameters' values in the model's order."""
    return np.array([parameter.value for parameter in model.parameters.values()], dtype=float)


def check_arrays(model: PhysicsModel, t, u, x0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, inputs and initial state as arrays; raise `ValueError` where they do not fit."""
    t = np.array(t, dtype=float)
    if t.ndim != 1 or t.size < 1:
        raise ValueError(f"t: expected finite times of shape (n_samples,), got shape {t.shape}.")
    forward = t[1:] > t[:-1]
    if not (np.isfinite(t[[0, -1]]).all() if forward.all() else np.isfinite(t).all()):
        k = int(np.argmin(np.isfinite(t)))
        raise ValueError(
            f"t: expected finite times, got {t[k]} at sample {k}. Remedy: leave out samples whose "
            f"time is not known."
        )
    if not forward.all():
        k = int(np.argmin(forward))
        raise ValueError(
            f"t: expected increasing times, got {t[k]:g} s then {t[k + 1]:g} s at sample {k + 1}."
        )
    n_inputs = len(model.inputs)
    u = np.zeros((t.size, 0)) if u is None and not n_inputs else np.asarray(u, dtype=float)
    u = u[:, None] if u.ndim == 1 else u
    if u.shape != (t.size, n_inputs):
        raise ValueError(f"u: expected shape {(t.size, n_inputs)}, got {u.shape}.")
    if not np.all(np.isfinite(u)):
        row, column = np.argwhere(~np.isfinite(u))[0]
        raise ValueError(f"u: {list(model.inputs)[column]!r} is not finite at sample {row}.")
    start = list(settled_start(model, u[0]).values()) if x0 is None else x0
    x0 = np.asarray(start, dtype=float).ravel()
    if x0.shape != (len(model.states),) or not np.all(np.isfinite(x0)):
        raise ValueError(f"x0: expected {len(model.states)} finite numbers, got {x0}.")
    return t, np.require(u, requirements=["C", "A", "W"]), x0  # as the loops take it


def check_method(method) -> None:
    """Raise `ValueError` if the scheme of a step is none."""
    if method not in SCHEMES:
        raise ValueError(f"method: expected one of {', '.join(SCHEMES)}, got {method!r}.")


def _remedy(model, t, X, failed, substeps) -> str:
    """Return where and when a simulation failed, and the remedy."""
    last = X[failed - 1] if failed else X[0]
    at = ", ".join(f"{name} = {value:.3g}" for name, value in zip(model.states, last, strict=True))
    return (
        f"the simulation of {model.name!r} became non-finite at t = {t[failed]:g} s (sample "
        f"{failed}; before: {at}). Remedy: raise substeps (now {substeps}), or check the initial "
        f"state, the parameters' values and that no square root or logarithm gets a negative "
        f"number."
    )
