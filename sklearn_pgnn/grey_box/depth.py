"""A depth of the recipe, fitted to the visible samples of the records."""

import warnings
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from sklearn_pgnn.estimators import PhysicsModelRegressor
from sklearn_pgnn.exceptions import RecordWarning, SimulationWarning, TrainingError
from sklearn_pgnn.grey_box.initial_state import find_initial_state
from sklearn_pgnn.grey_box.options import NETWORKS, network_or_default, warn_of_training
from sklearn_pgnn.grey_box.tables import PlainTable, starts_for, usual
from sklearn_pgnn.model_selection.outer_estimator import parameters_named
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.uncertainty import Estimate
from sklearn_pgnn.trajectories.contradicted_states import UNKNOWN
from sklearn_pgnn.trajectories.measured import where_measured

#: approximate maximum number of training states that are kept
ENOUGH = 2000


@dataclass(frozen=True)
class FittedDepth:
    """An estimator that predicts, the fitted physical model in it, and its initial states.

    These have the shape (n_trajectories, n_states), NaN where the fit saw nothing.
    """

    estimator: Any
    physics: PhysicsModelRegressor
    starts: np.ndarray

    @property
    def model(self) -> PhysicsModel:
        """The fitted model in the estimator; it starts where the trajectories seen usually did."""
        fitted = self.physics.model_
        if self._tuned is None:
            return fitted
        return self._tuned.replace(initial_state=fitted.initial_state)

    @property
    def parameters(self) -> dict[str, Estimate]:
        """The model's fitted parameters, those of the network where it tunes them."""
        found = dict(self.physics.parameters_)
        if self._tuned is None:
            return found
        found |= getattr(self.estimator, "parameters_", {})
        return {name: each for name, each in found.items() if name in self._tuned.parameters}

    @property
    def _tuned(self) -> PhysicsModel | None:
        """The model as the estimator has it after its fit; None where it keeps none."""
        model = getattr(self.estimator, "model_", None)
        if not isinstance(model, PhysicsModel):
            return None
        return model if [*model.states] == [*self.physics.model_.states] else None

    def predict(self, table: PlainTable, starts: np.ndarray) -> np.ndarray:
        """Simulate in free run from given initial states."""
        predicted = self.estimator.predict(table.starting(self.physics.model_, starts))
        return np.asarray(predicted).reshape(len(table.X), -1)

    def predict_from_each(self, X: pd.DataFrame, starts: np.ndarray) -> np.ndarray:
        """Simulate one trajectory from every one of several initial states."""
        n = len(starts)
        copies = X.iloc[np.tile(np.arange(len(X)), n)].reset_index(drop=True)
        copies["trajectory"] = np.repeat(np.arange(n), len(X))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SimulationWarning)
            runs = self.predict(PlainTable(copies, np.empty((len(copies), 0)), starts), starts)
        return runs.reshape(n, len(X), -1)


def fit_physics(
    depth: str, model: PhysicsModel, table: PlainTable, visible: np.ndarray, n_jobs=None
) -> FittedDepth:
    """Fit a physical depth to the visible samples, in free run over whole trajectories.

    Of the prior, only the initial states of the trajectories are fitted; inputs are always seen.
    """
    free = () if depth == "prior" else None
    regressor = PhysicsModelRegressor(
        model, free=free, search="local", window_length="trajectory", n_jobs=n_jobs
    )
    seen = _last_seen(table, visible) >= 0
    starts = starts_for(model, table)
    rows = np.repeat(seen, table.lengths)
    y = np.where(visible[:, None], table.y, np.nan)[rows]
    with warnings.catch_warnings():  # the recipe tells of unknown starts itself, once
        warnings.filterwarnings("ignore", message=UNKNOWN, category=RecordWarning)
        regressor.fit(table.starting(model, starts, rows), y)
    starts[seen] = regressor.initial_states_
    return FittedDepth(regressor, regressor, starts)


def fit_network(
    network, depth: str, physics: FittedDepth, table: PlainTable, visible: np.ndarray
) -> FittedDepth:
    """Train a network, or another regressor with a model, on the error of a fitted model.

    Samples after a trajectory's last visible measurement are left out: they carry no information,
    and a network that holds out the end of its records for early stopping would find nothing there.
    """
    rows = table.place <= _last_seen(table, visible)[table.X["trajectory"]]
    y = np.where(visible[:, None], table.y, np.nan)[rows]
    # a plain table calls the time "t"
    settings: dict[str, Any] = {"model": physics.model, "time_column": None}
    if depth == "state_network":
        settings["sees"] = list(physics.model.states)
    trained = clone(network)
    for name, value in settings.items():
        trained.set_params(**dict.fromkeys(parameters_named(trained, name), value))
    trained.fit(table.starting(physics.model, physics.starts, rows), y)
    return FittedDepth(trained, physics.physics, physics.starts)


def fit_chosen(
    depth: str,
    base: str,
    candidates: dict[str, PhysicsModel],
    network,
    table: PlainTable,
    n_jobs: int | None = None,
) -> tuple[str, FittedDepth]:
    """Fit a depth to all samples; the base below a network whose training fails, instead of it."""
    everything = np.ones(len(table.X), dtype=bool)
    physical = base if depth in NETWORKS else depth
    fitted = fit_physics(physical, candidates[physical], table, everything, n_jobs)
    if depth not in NETWORKS:
        return depth, fitted
    try:
        return depth, fit_network(network_or_default(network), depth, fitted, table, everything)
    except TrainingError as error:
        warn_of_training(error, depth, base)
        return base, fitted


def states_met(fitted: FittedDepth, table: PlainTable) -> np.ndarray:
    """Return the states of free runs of a fit's trajectories, a subset if there are very many.

    They are those of the predicting estimator or, if it gives none, of the physical model in it.
    """
    rows = np.repeat(np.isfinite(fitted.starts).all(axis=1), table.lengths)
    tells = hasattr(fitted.estimator, "predict_states")
    source = fitted.estimator if tells else fitted.physics
    states = source.predict_states(table.starting(fitted.model, fitted.starts, rows))
    return states[:: max(1, len(states) // ENOUGH)]


def find_unknown_starts(
    fitted: FittedDepth,
    table: PlainTable,
    known: np.ndarray,
    met: np.ndarray,
    window: int,
    noise: np.ndarray,
) -> np.ndarray:
    """Return initial states, unknown ones estimated from first samples by what predicts."""
    if not window:
        return usual(fitted.model, known)
    found = []
    for i, told in enumerate(known):
        rows = (table.X["trajectory"].to_numpy() == i) & (table.place < window)
        run = partial(fitted.predict_from_each, table.X[rows])
        found.append(find_initial_state(run, told, table.y[rows], met, noise))
    return np.array(found)


def _last_seen(table: PlainTable, visible) -> np.ndarray:
    """Return the place of the last visible measurement of every trajectory, -1 without any."""
    some = visible & where_measured(table.y)
    last = np.full(len(table.lengths), -1)
    np.maximum.at(last, table.X["trajectory"][some], table.place[some])
    return last
