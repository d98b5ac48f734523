"""What a physical model makes of a table of samples, as further columns."""

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import _check_feature_names_in, check_is_fitted

from sklearn_pgnn.simulation.finite_run import quantities_of, simulate_quantities
from sklearn_pgnn.simulation.free_run import enough_substeps
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.validation import check_model, validate_table

SUFFIX, TRAJECTORY = "_phy", "trajectory"


class PhysicsModelTransformer(TransformerMixin, BaseEstimator):
    """Append the simulated states and outputs of a physical model to X.

    Every trajectory is simulated in free run from its first row: of the measured states only that
    row is read, and their columns are not passed on (nor is ``trajectory``), for what is measured
    later may not leak into a model that shall predict it.

    A trajectory whose simulation leaves the finite numbers tells nothing: a `SimulationWarning`
    says where, when and which remedy, and all its rows get the values of its first row. The
    result never holds a simulated NaN.

    Parameters
    ----------
    model : PhysicsModel, optional
        The model; without one X is passed on as it is.
    outputs : sequence of str, optional
        States and outputs to append; by default all, the states first.
    append : bool or "all", default=True
        Whether to put them behind the time, the inputs and whatever else X holds besides states;
        ``"all"`` keeps every column of X, measured states included; False gives the simulation
        alone.
    method : {"rk4", "euler"}, default="rk4"
        Runge-Kutta scheme of order four, or explicit Euler.
    substeps : int, optional
        Integration steps from sample to sample; by default as many as the records of `fit` need
        until nothing changes by more than a thousandth of its range.
    hold : {"zoh", "foh"}, default="zoh"
        Whether an input is held between two samples or runs straight from one to the next.
    time : int or str, optional
        Column of X that holds the time; by default the first, or ``"t"``.

    Attributes
    ----------
    substeps_ : int
        Integration steps from sample to sample, where there is a model.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Their names, if X has any.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> X = pd.DataFrame({"t": [0.0, 1.0, 2.0], "u": 1.0})
    >>> PhysicsModelTransformer(lag).set_output(transform="pandas").fit_transform(X).round(3)
         t    u  y_phy
    0  0.0  1.0  0.000
    1  1.0  1.0  0.393
    2  2.0  1.0  0.632
    """

    def __init__(
        self,
        model=None,
        *,
        outputs=None,
        append=True,
        method="rk4",
        substeps=None,
        hold="zoh",
        time=None,
    ):
        self.model = model
        self.outputs = outputs
        self.append = append
        self.method = method
        self.substeps = substeps
        self.hold = hold
        self.time = time

    def fit(self, X, y=None):
        """Check that X can be read, and find the substeps it needs.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and, where known, the states in each trajectory's first row.
        y : None
            Not used.

        Returns
        -------
        self : PhysicsModelTransformer
            The fitted transformer.

        Raises
        ------
        ValueError
            If X cannot be read as records of the model, or a name in `outputs` is unknown.
        """
        check_model(self.model, optional=True)
        X = validate_table(self, X, reset=True)
        if self.model is None:
            return self
        records = read_records(self.model, X, time=self.time)
        self._quantities()
        if self.append not in (True, False, "all"):
            raise ValueError(f"append: expected True, False or 'all', got {self.append!r}.")
        self.substeps_ = self.substeps
        if self.substeps is None:
            self.substeps_ = enough_substeps(
                self.model, records, method=self.method, hold=self.hold
            )
        return self

    def transform(self, X):
        """Simulate every trajectory and append what came out.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            As in `fit`.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features_out)
            X and the simulation.
        """
        check_is_fitted(self)
        X = validate_table(self, X, reset=False)
        if self.model is None:
            return X
        simulated = simulate_quantities(
            self.model,
            read_records(self.model, X, time=self.time),
            self._quantities(),
            method=self.method,
            hold=self.hold,
            substeps=self.substeps_,
        )
        kept = X.iloc[:, self._kept()] if isinstance(X, pd.DataFrame) else X[:, self._kept()]
        return np.column_stack([kept, simulated])

    def get_feature_names_out(self, input_features=None):
        """Name the columns that `transform` gives.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the columns of X, where `fit` saw none.

        Returns
        -------
        ndarray of str
            The columns of X that are kept, then the simulated quantities with ``_phy`` added.
        """
        check_is_fitted(self)
        names = _check_feature_names_in(self, input_features)
        if self.model is None:
            return names
        new = [name + SUFFIX for name in self._quantities()]
        return np.asarray([*names[self._kept()], *new], dtype=object)

    def _quantities(self) -> list[str]:
        """Name the states and outputs that are appended."""
        known = quantities_of(self.model)
        names = known if self.outputs is None else list(self.outputs)
        unknown = [name for name in names if name not in known]
        if unknown:
            raise ValueError(
                f"outputs: expected states or outputs among {', '.join(known)}, got {unknown[0]!r}."
            )
        return names

    def _kept(self) -> list[int]:
        """Give the columns of X that are passed on."""
        everything = list(range(self.n_features_in_))
        if self.append in (False, "all"):
            return everything if self.append else []
        if hasattr(self, "feature_names_in_"):
            states = {self.model.columns.get(name, name) for name in self.model.states}
            dropped = {*states, TRAJECTORY}
            return [i for i in everything if self.feature_names_in_[i] not in dropped]
        time = everything.pop(self.time or 0)
        return sorted([time, *everything[: len(self.model.inputs)]])

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True  # in states, which are read in a trajectory's first row
        return tags
