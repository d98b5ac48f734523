"""Free run of whole records: only the first sample of a record is read."""

import warnings

import numpy as np

from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.simulate import Simulation, simulate, start_of
from sklearn_pgnn.simulation.substeps import double_substeps
from sklearn_pgnn.trajectories.record import Record

#: change of a quantity, as a share of its range, that is small
SMALL = 1e-3


def simulate_record(model: PhysicsModel, record: Record, **options) -> Simulation:
    """Simulate a record from its initial state, without a warning where it diverges.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    record : Record
        Time, inputs and initial state.
    **options
        See `simulate`.

    Returns
    -------
    Simulation
        States and outputs; no warning is given.

    Examples
    --------
    >>> from sklearn_pgnn.trajectories import read_records
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> (record,) = read_records(lag, [[0.0, 1.0], [1.0, 1.0]])
    >>> simulate_record(lag, record, substeps=4).y.round(4).ravel().tolist()
    [0.0, 0.3935]
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SimulationWarning)
        return simulate(model, record.t, record.u, start_of(model, record), **options)


def substeps_for(model: PhysicsModel, records, substeps: int | None = None, **options) -> int:
    """Return the integration steps: as given, else as in the model, else as accuracy needs.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    records : sequence of Record
        Records to simulate.
    substeps : int, optional
        The given value, if any.
    **options
        See `simulate`.

    Returns
    -------
    int
        Steps from sample to sample.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> substeps_for(lag.replace(simulation={"substeps": 3}), ())
    3
    """
    said = model.simulation.get("substeps") if substeps is None else substeps
    return enough_substeps(model, records, **options) if said is None else said


def enough_substeps(model: PhysicsModel, records, **options) -> int:
    """Double the substeps until states and outputs hardly change.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    records : sequence of Record
        Records to simulate.
    **options
        See `simulate`.

    Returns
    -------
    int
        Steps from sample to sample, see `double_substeps`.

    Examples
    --------
    >>> from sklearn_pgnn.trajectories import read_records
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> enough_substeps(lag, read_records(lag, [[0.0, 1.0], [4.0, 1.0], [8.0, 1.0]]))
    4
    """

    def run(substeps):
        runs = [simulate_record(model, record, substeps=substeps, **options) for record in records]
        return np.concatenate([np.array([*each.x.T, *each.y.T]) for each in runs], axis=1)

    def change(coarse, finer):
        least = np.finfo(float).tiny  # what does not move
        with np.errstate(invalid="ignore"):  # of simulations that diverge
            changed = np.max(np.abs(finer - coarse), axis=1)
            return float(np.max(changed / (SMALL * np.ptp(finer, axis=1) + least)))

    return double_substeps(run, change)
