"""Residual modelling: a physical model, and a regressor of its error."""

from dataclasses import replace
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, MultiOutputMixin, clone
from sklearn.linear_model import LinearRegression
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import check_array, check_consistent_length, get_tags
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import Column, Table
from sklearn_pgnn.estimators.simulated_predictions import (
    SimulatingMixin,
    one_simulation_warning,
    predict_records_ahead,
)
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.finite_run import limits_of, quantities_of, steps_for
from sklearn_pgnn.simulation.record_windows import output_noise
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.substeps import usual_step, without_long_steps
from sklearn_pgnn.trajectories.contradicted_states import (
    warn_of_contradicted_states,
    warn_of_unknown_starts,
)
from sklearn_pgnn.trajectories.lost_units import refuse_standardised
from sklearn_pgnn.trajectories.measured import warn_of_constant_outputs
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY, read_records, rows_in_order
from sklearn_pgnn.trajectories.tables import SIMULATED, is_named, place_of, time_name
from sklearn_pgnn.trajectories.validation import (
    GapScoreMixin,
    check_model,
    refuse_fit_params,
    require_target,
    validate_table,
)


class ResidualRegressor(SimulatingMixin, MultiOutputMixin, GapScoreMixin, BaseEstimator):
    r"""Simulate a model and add a regression of its error: residual modelling.

    .. math:: \hat y_k = y^{phy}_k + g(u_k, x^{phy}_k, y^{phy}_k)

    :math:`x^{phy}, y^{phy}` are the model's simulation in free run from each trajectory's first
    row, and any regressor of scikit-learn is fitted as :math:`g` to :math:`y - y^{phy}`. The
    regressor treats every row separately; it sees neither time nor trajectory nor measured states.
    Rows in which an output is not measured (NaN) are left out of its fit.

    A simulation that diverges, to more than 1000 times what was measured or to no number at all, is
    reported by a `SimulationWarning`; its rows get the values of the trajectory's first row, as in
    `PhysicsModelTransformer`. A step longer than those of `fit`, in a slower table or across a gap,
    is divided into as many integration steps more.

    Parameters
    ----------
    model : PhysicsModel, optional
        The model. Without one, :math:`y = g(X)` on all columns of X except time and trajectory.
    regressor : regressor, optional
        Regressor of the error; by default least squares on standardised features. It is cloned,
        and its own `random_state` controls its random numbers. One that predicts a single output is
        fitted once per output, in a `sklearn.multioutput.MultiOutputRegressor`.
    time_column : int or str, optional
        Column of X that holds the time; by default ``"t"``, of an array the first, or without a
        model none.
    hold : {"zoh", "foh"}, optional
        Whether an input is held between two samples or interpolated linearly; by default as the
        model's `simulation` says, else held.
    substeps : int, optional
        Integration steps from sample to sample; by default as the model's `simulation` says, else
        as many as needed until, on the records of `fit`, no quantity changes by more than a
        thousandth of its range.

    Attributes
    ----------
    regressor_ : regressor
        The fitted :math:`g`; its features are the inputs, then the simulated states and outputs
        with ``_phy`` added to their names.
    noise_ : ndarray of shape (n_outputs,)
        Standard deviation of the training records' noise, by which `predict_ahead` weighs outputs;
        where there is a model.
    hold_ : {"zoh", "foh"}
        How the inputs were assumed to vary between samples, where there is a model.
    substeps_ : int
        Integration steps for the sample interval of `fit`, where there is a model.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

    See Also
    --------
    sklearn_pgnn.PhysicsModelTransformer : Appends the simulation to X.

    Notes
    -----
    The extended form, :math:`\hat y_k = g(t_k, u_k, x^{phy}_k, y^{phy}_k)`, needs no class of its
    own: it is any regressor behind `PhysicsModelTransformer`, as in the second example.

    References
    ----------
    .. [1] J. Willard, X. Jia, S. Xu, M. Steinbach, V. Kumar, "Integrating Physics-Based Modeling
       with Machine Learning: A Survey", 2020, arXiv:2003.04919.
    .. [2] R.-S. Goette, J. Timmermann, "Composed Physics- and Data-driven System Identification
       for Non-autonomous Systems in Control Engineering", 2021, arXiv:2112.08148.

    Examples
    --------
    A lag whose sensor has an offset that the model lacks:

    >>> from sklearn_pgnn import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 20, 201)
    >>> X = pd.DataFrame({"t": t, "u": np.sin(t)})
    >>> y = lag.simulate(t, np.sin(t)).y + 0.5
    >>> residual = ResidualRegressor(lag).fit(X, y)
    >>> print(round(residual.score(X, y), 6), list(residual.regressor_.feature_names_in_))
    1.0 ['u', 'y_phy']

    The extended form:

    >>> from sklearn_pgnn import PhysicsModelTransformer
    >>> extended = make_pipeline(PhysicsModelTransformer(lag), LinearRegression()).fit(X, y)
    >>> print(round(extended.score(X, y), 6))
    1.0
    """

    def __init__(
        self,
        model: PhysicsModel | None = None,
        regressor: Any = None,
        *,
        time_column: Column | None = None,
        hold: str | None = None,
        substeps: int | None = None,
    ):
        self.model: Any = model
        self.regressor = regressor
        self.time_column = time_column
        self.hold = hold
        self.substeps = substeps

    def fit(self, X: Table, y: Table, **fit_params: Any) -> Self:
        """Simulate the model, and fit the regressor to its error.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and, where known, the states in each trajectory's first row.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,)
            Measured outputs; NaN where there is none.
        **fit_params
            Nothing else: weights of samples are refused.

        Returns
        -------
        self : ResidualRegressor
            The fitted regressor.

        Raises
        ------
        ValueError
            If X and y cannot be read as records of the model, or no row has all outputs.
        """
        refuse_fit_params(self, fit_params)
        check_model(self.model, optional=True)
        require_target(self, X, y)
        X = validate_table(self, X, reset=True)
        self._single_output = np.asarray(y).ndim == 1
        if self.model is None:
            features, allowed = (
                self._plain(X),
                {"ensure_2d": False, "ensure_all_finite": "allow-nan"},
            )
            y = check_array(y, dtype=float, input_name="y", **allowed)
            check_consistent_length(X, y)
            error = y.reshape(len(y), -1)
        else:
            features, error = self._simulate_and_compare(X, y)
        rows = np.isfinite(error).all(axis=1)
        if not rows.any():
            raise ValueError(
                "y: no row has all outputs measured. Remedy: regress one output at a time, with "
                "a model of that output alone (model.replace(outputs=...))."
            )
        target = error[rows, 0] if error.shape[1] == 1 else error[rows]
        regressor = clone(self._regressor())
        if target.ndim > 1 and not get_tags(regressor).target_tags.multi_output:
            regressor = MultiOutputRegressor(regressor)
        self.regressor_ = regressor.fit(features[rows], target)
        return self

    def predict(self, X: Table) -> Any:
        """Simulate every trajectory in free run, and add the expected error.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`; of the states only the first row of a trajectory is read.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs) or (n_samples,)
            Predicted outputs.
        """
        check_is_fitted(self)
        X = validate_table(self, X, reset=False)
        if self.model is None:
            outputs = np.asarray(self.regressor_.predict(self._plain(X)))
        else:
            features, simulated = self._simulate(self._records(X))
            outputs = simulated + self.regressor_.predict(features).reshape(simulated.shape)
        return outputs.ravel() if self._single_output else outputs.reshape(len(outputs), -1)

    def _check_has_states(self, method: str) -> None:
        check_is_fitted(self)
        if self.model is None:
            raise ValueError(f"{method}: expected a regressor with a model, got none.")

    def _read(self, X, y=None):
        return self._records(validate_table(self, X, reset=False), y, to_fit=y is None)

    def _records(self, X, y=None, to_fit=True):
        """Read a table with the model."""
        records = read_records(self.model, X, y, time_column=self.time_column, to_fit=to_fit)
        refuse_standardised(self.model, records)
        return records

    def _states_of(self, X) -> np.ndarray:
        """Simulate the model's states; the regressor corrects its outputs only."""
        return self._runs.simulate(self.model, self._read(X), list(self.model.states))

    def _outputs_ahead(self, X, y, steps: int) -> np.ndarray:
        """Estimate the model's state from the outputs less the error predicted in free run."""
        records = self._read(X, y)
        with one_simulation_warning():
            features, simulated = self._simulate(records)
            expected = self.regressor_.predict(features).reshape(simulated.shape)
            left = [replace(record, y=record.y - expected[record.rows]) for record in records]
            states, ahead = predict_records_ahead(self._runs, self.model, left, steps, self.noise_)
        features = self._features(records, np.column_stack([states, ahead]))
        return ahead + self.regressor_.predict(features).reshape(ahead.shape)

    def _simulate_and_compare(self, X, y) -> tuple[pd.DataFrame, np.ndarray]:
        """Return the features and the model's error."""
        records = self._records(X, y)
        warn_of_contradicted_states(self.model, records)
        warn_of_unknown_starts(self.model, records)
        warn_of_constant_outputs(self.model, records)
        self.hold_ = hold_of(self.model, self.hold)
        even = without_long_steps(records)
        steps = steps_for(self.model, even, self.substeps, hold=self.hold_)
        self.substeps_ = steps.substeps
        self.noise_ = output_noise(records)
        measured = rows_in_order(records, np.concatenate([record.y for record in records]))
        limits, interval = limits_of(measured), usual_step(records)
        self._simulated = (interval, steps.substeps, limits, self.hold_, steps.method)
        features, simulated = self._simulate(records)
        return features, measured - simulated

    def _simulate(self, records) -> tuple[pd.DataFrame, np.ndarray]:
        """Return the features (inputs, simulated states and outputs) and the simulated outputs."""
        names = [*self.model.states, *self.model.outputs]
        values = self._runs.simulate(self.model, records, names)
        return self._features(records, values), values[:, len(self.model.states) :]

    def _features(self, records, values) -> pd.DataFrame:
        """Return the inputs, and every state and output once."""
        names = quantities_of(self.model)
        place = {x: i for i, x in enumerate([*self.model.states, *self.model.outputs])}
        inputs = rows_in_order(records, np.concatenate([record.u for record in records]))
        columns = [*self.model.inputs, *(name + SIMULATED for name in names)]
        once = values[:, [place[name] for name in names]]
        return pd.DataFrame(np.column_stack([inputs, once]), columns=columns)

    def _plain(self, X):
        """Return all columns of X except time and trajectory."""
        if is_named(X):
            time = time_name(X.columns, self.time_column) or TIME
            return X.drop(columns=[time, TRAJECTORY], errors="ignore")
        if self.time_column is None:
            return X
        return np.delete(np.asarray(X), place_of(self.time_column, X.shape[1]), axis=1)

    def _regressor(self):
        if self.regressor is None:
            return make_pipeline(StandardScaler(), LinearRegression())
        return self.regressor

    def __sklearn_tags__(self):
        tags, inner = super().__sklearn_tags__(), get_tags(self._regressor())
        physical = self.model is not None
        tags.input_tags.allow_nan = physical or inner.input_tags.allow_nan  # in states
        tags.regressor_tags.poor_score = physical or inner.regressor_tags.poor_score
        return tags
