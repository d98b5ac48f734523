"""Free runs for whoever cannot use NaN: a trajectory that diverges says so, and stays finite."""

import warnings

import numpy as np

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.free_run import simulate_record
from sklearn_pgnn.trajectories import rows_in_order


def quantities_of(model: PhysicsModel) -> list[str]:
    """Name a model's states, then its outputs, each once.

    Parameters
    ----------
    model : PhysicsModel
        The model.

    Returns
    -------
    list of str
        The names; an output that is called as a state stands in that one's place.
    """
    return list(dict.fromkeys([*model.states, *model.outputs]))


def simulate_quantities(model: PhysicsModel, records, names, **options) -> np.ndarray:
    """Simulate every record in free run; where one diverges repeat its first row.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    records : tuple of Record
        Time, inputs and initial states.
    names : sequence of str
        States and outputs to give.
    **options
        See `simulate`.

    Returns
    -------
    ndarray of shape (n_samples, n_names)
        Finite numbers in the order of the table's rows. A trajectory whose simulation leaves them
        is named in a `SimulationWarning`.

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


def _finite_run(model, record, names, options) -> np.ndarray:
    run = simulate_record(model, record, **options)
    columns = dict(zip(model.states, run.x.T, strict=True))
    columns |= dict(zip(model.outputs, run.y.T, strict=True))
    values = np.column_stack([columns[name] for name in names])
    if not run.message and np.isfinite(values).all():
        return values
    what = run.message or "an output is not finite. Remedy: check the output's expression."
    warnings.warn(
        f"trajectory {record.name!r}: {what} Its rows get the values of its first row.",
        SimulationWarning,
        stacklevel=5,
    )
    return np.nan_to_num(np.repeat(values[:1], len(values), axis=0), posinf=0.0, neginf=0.0)
