"""Free runs without NaN: a trajectory that diverges causes a warning, and stays finite."""

import warnings

import numpy as np

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.free_run import simulate_record
from sklearn_pgnn.simulation.simulate import Simulation
from sklearn_pgnn.trajectories import rows_in_order

#: trees and most networks hold numbers in single precision, whose largest is 3.4e38
LARGEST = float(np.finfo(np.float32).max)


def quantities_of(model: PhysicsModel) -> list[str]:
    """Name a model's states, then its outputs, each once.

    Parameters
    ----------
    model : PhysicsModel
        The model.

    Returns
    -------
    list of str
        The names; an output with the name of a state takes its place.
    """
    return list(dict.fromkeys([*model.states, *model.outputs]))


def simulate_quantities(model: PhysicsModel, records, names, **options) -> np.ndarray:
    """Simulate every record in free run; if one diverges, repeat its first row.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    records : tuple of Record
        Time, inputs and initial states.
    names : sequence of str
        States and outputs to return.
    **options
        See `simulate`.

    Returns
    -------
    ndarray of shape (n_samples, n_names)
        Finite numbers in the order of the table's rows. A trajectory whose simulation becomes
        non-finite is reported by a `SimulationWarning`.

    Examples
    --------
    >>> from sklearn_pgnn.trajectories import read_records
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> records = read_records(lag, [[0.0, 1.0], [1.0, 1.0]])
    >>> simulate_quantities(lag, records, ["y"], substeps=4).round(4).ravel().tolist()
    [0.0, 0.3935]
    """
    runs = [_finite_run(model, record, names, options) for record in records]
    return rows_in_order(records, np.concatenate(runs))


def what_is_wrong(run: Simulation, values: np.ndarray, names) -> str:
    """Return why a free run cannot be used for training; empty if it can.

    Parameters
    ----------
    run : Simulation
        The run.
    values : ndarray of shape (n_samples, n_names)
        The quantities taken from it.
    names : sequence of str
        Its names.

    Returns
    -------
    str
        What happened and the remedy.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": -0.01}, {"u": "V"})
    >>> run = lag.simulate([0.0, 1.0, 2.0], [1.0, 1.0, 1.0], [1e-9], substeps=100)
    >>> print(what_is_wrong(run, run.y, ["y"]).split(",")[0])
    'y' diverges: it is -1.86e+43 at t = 1 s
    """
    if run.message:
        return run.message
    bad = np.argwhere(~(np.abs(values) <= LARGEST))
    if not bad.size:
        return ""
    k, column = bad[0]
    if not np.isfinite(values[k, column]):
        return "an output is not finite. Remedy: check the output's expression."
    return (
        f"{names[column]!r} diverges: it is {values[k, column]:.3g} at t = {run.t[k]:g} s, beyond "
        f"single precision. Remedy: check the parameters' values and units; simulate an unstable "
        f"machine over shorter trajectories, or with its controller in the model."
    )


def _finite_run(model, record, names, options) -> np.ndarray:
    run = simulate_record(model, record, **options)
    columns = dict(zip(model.states, run.x.T, strict=True))
    columns |= dict(zip(model.outputs, run.y.T, strict=True))
    values = np.column_stack([columns[name] for name in names])
    what = what_is_wrong(run, values, names)
    if not what:
        return values
    warnings.warn(
        f"trajectory {record.name!r}: {what} Its rows get the values of its first row.",
        SimulationWarning,
        stacklevel=5,
    )
    return np.nan_to_num(np.repeat(values[:1], len(values), axis=0), posinf=0.0, neginf=0.0)
