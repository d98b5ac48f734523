"""A depth of the recipe, fitted to what is visible of the records."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from sklearn_pgnn.estimators import PhysicsModelRegressor
from sklearn_pgnn.grey_box.initial_state import find_initial_state
from sklearn_pgnn.grey_box.tables import PlainTable, starts_for, usual_starts
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.free_run import simulate_record
from sklearn_pgnn.trajectories import read_records


@dataclass(frozen=True)
class FittedDepth:
    """A depth, fitted.

    Parameters
    ----------
    estimator : estimator
        What predicts.
    physics : PhysicsModelRegressor
        The fitted physical model in it.
    starts : DataFrame
        Initial states of the model by trajectory, NaN where the fit saw nothing of it.
    """

    estimator: Any
    physics: PhysicsModelRegressor
    starts: pd.DataFrame

    @property
    def model(self) -> PhysicsModel:
        """The fitted physical model, which starts where the first trajectory of its fit did."""
        model = self.physics.model_
        first = self.starts.dropna(how="all").iloc[0].to_dict()
        return model.replace(initial_state={**model.initial_state, **first})

    def predict(self, table: PlainTable, starts: pd.DataFrame) -> np.ndarray:
        """Simulate in free run from given initial states."""
        predicted = self.estimator.predict(table.starting(starts))
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
    regressor.fit(table.starting(starts, rows), y)
    starts.loc[seen] = regressor.initial_states_
    return FittedDepth(regressor, regressor, starts)


def fit_network(
    network, physics: FittedDepth, table: PlainTable, visible: np.ndarray
) -> FittedDepth:
    """Train a network, or another regressor with a model, on what a fitted model leaves.

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

    Returns
    -------
    FittedDepth
        The trained network.
    """
    rows = np.repeat(_seen(table, visible), table.lengths)
    y = np.where(visible[:, None], table.y, np.nan)[rows]
    trained = clone(network).set_params(model=physics.model)
    trained.fit(table.starting(physics.starts, rows), y)
    return FittedDepth(trained, physics.physics, physics.starts)


def find_unknown_starts(
    fitted: FittedDepth, table: PlainTable, seen: PlainTable, window: int, noise: np.ndarray
) -> pd.DataFrame:
    """Return initial states, unknown ones from the first measured samples of a trajectory.

    Parameters
    ----------
    fitted : FittedDepth
        The model.
    table : PlainTable
        The trajectories, their first samples measured.
    seen : PlainTable
        The records of the fit.
    window : int
        How many samples may be looked at; without any a state starts as the model says.
    noise : ndarray of shape (n_outputs,)
        Error of the outputs in training.

    Returns
    -------
    DataFrame
        Initial states by trajectory.
    """
    model = fitted.model
    known = starts_for(model, table)
    if not known.isna().to_numpy().any():
        return known
    if not window:
        return usual_starts(model, table)
    runs = read_records(model, seen.starting(fitted.starts.dropna(how="all")), None)
    met = np.concatenate([simulate_record(model, record).x for record in runs])
    first = table.place < window
    records = read_records(model, table.starting(known)[first], table.y[first])
    found = [find_initial_state(model, record, met, noise) for record in records]
    return pd.DataFrame(found, columns=known.columns, index=known.index)


def _seen(table: PlainTable, visible) -> np.ndarray:
    """Return which trajectories have a visible measurement."""
    some = visible & np.isfinite(table.y).any(axis=1)
    return np.bincount(table.X["trajectory"], weights=some) > 0
