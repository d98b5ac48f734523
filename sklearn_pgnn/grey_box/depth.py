"""A depth of the recipe, fitted to what is visible of the records."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.base import clone

from sklearn_pgnn.estimators import PhysicsModelRegressor
from sklearn_pgnn.grey_box.initial_state import find_initial_state
from sklearn_pgnn.grey_box.tables import PlainTable, starts_for, usual_starts
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.free_run import simulate_record
from sklearn_pgnn.trajectories import read_records

#: states of the training that are kept at most, about
ENOUGH = 2000


@dataclass(frozen=True)
class FittedDepth:
    """A depth, fitted.

    Parameters
    ----------
    estimator : estimator
        What predicts.
    physics : PhysicsModelRegressor
        The fitted physical model in it.
    starts : ndarray of shape (n_trajectories, n_states)
        Initial states of the model, NaN of a trajectory of which the fit saw nothing.
    """

    estimator: Any
    physics: PhysicsModelRegressor
    starts: np.ndarray

    @property
    def model(self) -> PhysicsModel:
        """The fitted physical model, which starts where the first trajectory of its fit did."""
        model = self.physics.model_
        first = self.starts[np.isfinite(self.starts).all(axis=1)][0]
        return model.replace(initial_state=dict(zip(model.states, first.tolist(), strict=True)))

    def predict(self, table: PlainTable, starts: np.ndarray) -> np.ndarray:
        """Simulate in free run from given initial states."""
        predicted = self.estimator.predict(table.starting(self.physics.model_, starts))
        return np.asarray(predicted).reshape(len(table.X), -1)


def fit_physics(
    model: PhysicsModel, table: PlainTable, visible: np.ndarray, n_jobs=None, *, free=None
) -> FittedDepth:
    """Fit a model to the visible samples, in free run over whole trajectories.

    Parameters
    ----------
    model : PhysicsModel
        The model; its values are the start.
    table : PlainTable
        The records.
    visible : ndarray of bool, shape (n_samples,)
        What the fit may see; inputs are always seen.
    n_jobs : int, optional
        Threads to simulate on.
    free : sequence of str, optional
        Parameters to fit; by default all that are not fixed.

    Returns
    -------
    FittedDepth
        The fitted model, and where every trajectory starts that it has seen.
    """
    regressor = PhysicsModelRegressor(
        model, free=free, search="local", window_length="trajectory", n_jobs=n_jobs
    )
    seen = _seen(table, visible)
    starts = starts_for(model, table)
    rows = np.repeat(seen, table.lengths)
    y = np.where(visible[:, None], table.y, np.nan)[rows]
    regressor.fit(table.starting(model, starts, rows), y)
    starts[seen] = regressor.initial_states_
    return FittedDepth(regressor, regressor, starts)


def fit_network(
    network, physics: FittedDepth, table: PlainTable, visible: np.ndarray, *, sees_inputs=True
) -> FittedDepth:
    """Train a network, or another regressor with a model, on what a fitted model leaves.

    What follows a trajectory's last visible measurement is left out: it teaches nothing, and a
    network that holds out the end of its records to know when to stop would find nothing there.

    Parameters
    ----------
    network : estimator
        It has a parameter ``model``.
    physics : FittedDepth
        The model under it, fitted to the same samples.
    table : PlainTable
        The records.
    visible : ndarray of bool, shape (n_samples,)
        What the fit may see.
    sees_inputs : bool, default=True
        Whether the network sees the inputs besides the states.

    Returns
    -------
    FittedDepth
        The trained network.
    """
    rows = _until_last_seen(table, visible)
    y = np.where(visible[:, None], table.y, np.nan)[rows]
    sight = {} if sees_inputs else {"sees": list(physics.model.states)}
    trained = clone(network).set_params(model=physics.model, **sight)
    trained.fit(table.starting(physics.model, physics.starts, rows), y)
    return FittedDepth(trained, physics.physics, physics.starts)


def states_met(fitted: FittedDepth, table: PlainTable) -> np.ndarray:
    """Return the states of a free run of the trajectories of a fit, some of very many."""
    rows = np.repeat(np.isfinite(fitted.starts).all(axis=1), table.lengths)
    records = read_records(fitted.model, table.starting(fitted.model, fitted.starts, rows))
    states = np.concatenate([simulate_record(fitted.model, record).x for record in records])
    return states[:: max(1, len(states) // ENOUGH)]


def find_unknown_starts(
    model: PhysicsModel, table: PlainTable, met: np.ndarray, window: int, noise: np.ndarray
) -> np.ndarray:
    """Return initial states, unknown ones from the first measured samples of a trajectory.

    Parameters
    ----------
    model : PhysicsModel
        The fitted model.
    table : PlainTable
        The trajectories, their first samples measured.
    met : ndarray of shape (n_samples, n_states)
        States met in training.
    window : int
        How many samples may be looked at; without any a state starts as the model says.
    noise : ndarray of shape (n_outputs,)
        Error of the outputs in training.

    Returns
    -------
    ndarray of shape (n_trajectories, n_states)
        Initial states.
    """
    known = starts_for(model, table)
    if np.isfinite(known).all():
        return known
    if not window:
        return usual_starts(model, table)
    first = table.place < window
    records = read_records(model, table.starting(model, known)[first], table.y[first])
    return np.array([find_initial_state(model, record, met, noise) for record in records])


def _seen(table: PlainTable, visible) -> np.ndarray:
    """Return which trajectories have a visible measurement."""
    return _last_seen(table, visible) >= 0


def _until_last_seen(table: PlainTable, visible) -> np.ndarray:
    """Return the rows up to the last visible measurement of every trajectory."""
    return table.place <= _last_seen(table, visible)[table.X["trajectory"]]


def _last_seen(table: PlainTable, visible) -> np.ndarray:
    """Return the place of the last visible measurement of every trajectory, -1 without any."""
    some = visible & np.isfinite(table.y).any(axis=1)
    last = np.full(len(table.lengths), -1)
    np.maximum.at(last, table.X["trajectory"][some], table.place[some])
    return last
