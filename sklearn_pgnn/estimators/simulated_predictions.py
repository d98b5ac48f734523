"""What estimators of trajectories share: states, predictions ahead, and one warning of a call."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import Table
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.ahead import Machine, model_machine, predict_ahead
from sklearn_pgnn.simulation.finite_run import FreeRuns
from sklearn_pgnn.user_line import warn_user


class SimulatingMixin:
    """Predictions of an estimator that simulates its ``model_`` as ``_simulated`` says."""

    model_: Any
    noise_: np.ndarray
    _simulated: tuple
    _single_output: bool

    def predict_states(self, X: Table) -> np.ndarray:
        """Simulate the states of every trajectory in free run from its initial state.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.

        Returns
        -------
        ndarray of shape (n_samples, n_states)
            States of the model.

        Raises
        ------
        ValueError
            If there are no states: it was fitted to independent rows, or without a model.
        """
        self._check_has_states("predict_states")
        return self._states_of(X)

    def predict_ahead(self, X: Table, y: Table, steps: int = 1) -> np.ndarray:
        """Predict every sample from the outputs up to `steps` samples before it.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `predict`.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs, NaN where there is none; the state is estimated from them by a
            Kalman filter.
        steps : int, default=1
            Prediction horizon in samples. The first `steps` rows of a trajectory are those of the
            free run.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.

        Raises
        ------
        OptionError
            If `steps` is not an integer of at least 1.
        ValueError
            If there are no states, or they cannot be estimated from the outputs.

        Examples
        --------
        >>> from sklearn_pgnn import PhysicsModelRegressor
        >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
        >>> t = np.linspace(0, 20, 401)
        >>> X = np.column_stack([t, np.sin(t)])
        >>> y = lag.with_parameters(T=3.0).simulate(t, X[:, 1]).y
        >>> ahead = PhysicsModelRegressor(lag).fit(X, y).predict_ahead(X, y + 1.0, steps=20)
        >>> print(np.round((ahead - y)[[0, 400], 0], 2))  # of the offset exp(-1 s/T) is left
        [0.   0.72]
        """
        self._check_has_states("predict_ahead")
        return self._shaped(self._outputs_ahead(X, y, steps))

    def _check_has_states(self, method: str) -> None:
        check_is_fitted(self)
        if self.model_ is None:
            raise ValueError(
                f"{method}: expected an estimator that was fitted to trajectories; independent "
                f"rows have no states."
            )

    def _read(self, X, y=None) -> tuple:
        """Read the records of a table; y need not be enough for a fit."""
        raise NotImplementedError

    def _states_of(self, X) -> np.ndarray:
        return self._runs.simulate(self.model_, self._read(X), list(self.model_.states))

    def _outputs_ahead(self, X, y, steps: int) -> np.ndarray:
        records = self._read(X, y)
        return predict_records_ahead(self._runs, self.model_, records, steps, self.noise_)[1]

    @property
    def _runs(self) -> FreeRuns:
        """How the fitted estimator simulates."""
        return FreeRuns(*self._simulated)

    def _shaped(self, outputs) -> np.ndarray:
        return outputs.ravel() if self._single_output else outputs


def predict_records_ahead(
    runs: FreeRuns, model: PhysicsModel, records, steps: int, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Predict states and outputs ahead; where that diverges they are those of the free run."""
    machines = [model_machine(model, each, **runs.options(each)) for each in records]
    with one_simulation_warning() as failed:
        machines = [replace(each, run=partial(_noted, each, failed)) for each in machines]
        found = np.hstack(predict_ahead(machines, steps, noise))
        n_states = len(model.states)
        with np.errstate(invalid="ignore"):
            within = (np.abs(found[:, n_states:]) <= runs.limits).all(axis=1)
        lost = ~(within & np.isfinite(found).all(axis=1))
        if lost.any():
            found[lost] = runs.simulate(model, records, [*model.states, *model.outputs])[lost]
    return found[:, :n_states], found[:, n_states:]


def _noted(machine: Machine, failed: list[str], a: int, b: int, x):
    """Run a machine, and note the name of the trajectory if the run fails."""
    states, outputs = machine.run(a, b, x)
    if not np.isfinite(states[-1]).all():
        failed.append(machine.record.name)
    return states, outputs


@contextmanager
def one_simulation_warning() -> Iterator[list[str]]:
    """Issue the first `SimulationWarning` of a block at its end, with the number of the others."""
    names: list[str] = []
    caught: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", SimulationWarning)
            yield names
    finally:  # an error may be the consequence of what was warned of
        _issue(caught, f"trajectory {names[0]!r}: " if names else "")


def _issue(caught: list[warnings.WarningMessage], where: str) -> None:
    """Issue recorded warnings again, those of simulations as one."""
    failed = []
    for each in caught:
        if issubclass(each.category, SimulationWarning):
            failed.append(each.message)
        else:
            warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
    if failed:
        warn_user(_counted(failed, where))


def _counted(messages, where: str) -> SimulationWarning:
    """Return the first of several warnings with their number; those may be counted ones, too."""
    first = where + getattr(messages[0], "first", str(messages[0]))
    count = sum(getattr(each, "count", 1) for each in messages)
    simulations = "simulation" if count == 2 else "simulations"
    more = f" {count - 1} more {simulations} failed in the same call." if count > 1 else ""
    found = SimulationWarning(f"{first}{more}")
    vars(found).update(first=first, count=count)
    return found
