"""The simulation of a physical model, as further columns of a table of samples."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils import Tags
from sklearn.utils.validation import _check_feature_names_in, check_is_fitted

from sklearn_pgnn.annotations import ArrayLike, Column, Table
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.finite_run import FreeRuns, limits_of, quantities_of, steps_for
from sklearn_pgnn.simulation.simulate import hold_of
from sklearn_pgnn.simulation.substeps import usual_step, without_long_steps
from sklearn_pgnn.trajectories.lost_units import refuse_standardised
from sklearn_pgnn.trajectories.reader import (
    TIME,
    TRAJECTORY,
    read_outputs,
    read_records,
    refuse_other_order,
    rows_in_order,
    split_rows,
)
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.trajectories.tables import SIMULATED, column_of, time_name
from sklearn_pgnn.trajectories.validation import check_model, validate_table
from sklearn_pgnn.user_line import warn_user


class PhysicsModelTransformer(TransformerMixin, BaseEstimator):
    """Append the simulated states and outputs of a physical model to X.

    Every trajectory is simulated in free run from its first row: of the measured states only that
    row is read, and only it is passed on, held along the trajectory, so that later measurements
    cannot leak into a model that is to predict them. ``trajectory``, or its name in the model's
    `columns`, is no feature and not passed on; a `UserWarning` says so where the time alone does
    not distinguish the trajectories.

    If the X of `fit` has column names, the result is a DataFrame with column names.

    If the simulation of a trajectory diverges, it carries no information: a `SimulationWarning`
    says where, when and which remedy, and all its rows get the values of its first row. It has
    diverged if it becomes non-finite, or if an output exceeds 1000 times the largest one in the y
    of `fit`, in the unit of y and in the model's (without y, in the simulation of `fit`). The
    result never contains a simulated NaN.

    A step longer than those of `fit`, in a slower table or across a gap, takes as many integration
    steps more.

    Parameters
    ----------
    model : PhysicsModel, optional
        The model; without one X is passed on as it is.
    outputs : sequence of str, optional
        States and outputs to append; by default all, the states first.
    append : bool or "all", default=True
        Whether to append them to the columns of X, in which the states hold each trajectory's
        initial value and the time counts from its first sample; ``"all"`` keeps every column,
        including ``trajectory`` and the states as measured; False returns the simulation alone.
    method : {"rk4", "euler"}, default="rk4"
        Runge-Kutta scheme of order four, or explicit Euler.
    substeps : int, optional
        Integration steps from sample to sample; by default as the model's `simulation` says, else
        as many as needed until, on the records of `fit`, no quantity changes by more than a
        thousandth of its range.
    hold : {"zoh", "foh"}, optional
        Whether an input is held between two samples or interpolated linearly; by default as the
        model's `simulation` says, else held.
    time_column : int or str, optional
        Index or name of the column of X that holds the time; by default the first, or ``"t"``.

    Attributes
    ----------
    hold_ : {"zoh", "foh"}
        How the inputs were assumed to vary between samples, where there is a model.
    method_ : {"rk4", "euler", "rosenbrock"}
        Scheme of a step, where there is a model.
    substeps_ : int
        Integration steps for the sample interval of `fit`, where there is a model.
    n_features_in_ : int
        Number of columns of X.
    feature_names_in_ : ndarray of str
        Names of the columns of X, if it has any.

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
        model: PhysicsModel | None = None,
        *,
        outputs: Sequence[str] | None = None,
        append: bool | str = True,
        method: str | None = None,
        substeps: int | None = None,
        hold: str | None = None,
        time_column: Column | None = None,
    ):
        self.model: Any = model
        self.outputs = outputs
        self.append = append
        self.method = method
        self.substeps = substeps
        self.hold = hold
        self.time_column = time_column

    def fit(self, X: Table, y: Table = None) -> Self:
        """Check that X can be read, and find the substeps it needs.

        Parameters
        ----------
        X : DataFrame or array of shape (n_samples, n_columns)
            Time [s], inputs and, where known, the states in each trajectory's first row.
        y : array-like of shape (n_samples, n_outputs) or (n_samples,), optional
            Measured outputs, by which simulations that diverge are told; anything else does not
            count.

        Returns
        -------
        self : PhysicsModelTransformer
            The fitted transformer.

        Raises
        ------
        ValueError
            If X cannot be read as records of the model, a name in `outputs` is unknown, or X has a
            column of the name of one that is appended.
        """
        check_model(self.model, optional=True)
        refuse_other_order(X, y)
        X = validate_table(self, X, reset=True)
        if self.model is None:
            return self
        records = read_records(self.model, X, time_column=self.time_column)
        refuse_standardised(self.model, records)
        self._quantities()
        if self.append not in (True, False, "all"):
            raise ValueError(f"append: expected True, False or 'all', got {self.append!r}.")
        self._refuse_taken_names()
        self.hold_ = hold_of(self.model, self.hold)
        even = without_long_steps(records)
        steps = steps_for(self.model, even, self.substeps, self.method, self.hold_)
        self.method_, self.substeps_ = steps
        self._interval, self._limits = usual_step(records), np.full(len(self.model.outputs), np.inf)
        runs = [self._runs.run(self.model, record).y for record in records]
        simulated = rows_in_order(records, np.concatenate(runs))
        self._limits = limits_by_targets(self.model, simulated, y)
        return self

    def transform(self, X: Table) -> Any:
        """Simulate every trajectory and append the simulated quantities.

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
        records = read_records(self.model, X, time_column=self.time_column)
        refuse_standardised(self.model, records)
        simulated = self._runs.simulate(self.model, records, self._quantities())
        if not hasattr(self, "feature_names_in_"):
            return np.column_stack([self._kept_table(pd.DataFrame(X), records), simulated])
        new = pd.DataFrame(simulated, X.index, [name + SIMULATED for name in self._quantities()])
        return pd.concat([self._kept_table(X, records), new], axis=1)

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> np.ndarray:
        """Return the names of the columns that `transform` returns.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the columns of X, where `fit` saw none; by default the model's.

        Returns
        -------
        ndarray of str
            The columns of X that are kept, then the simulated quantities with ``_phy`` added.
        """
        check_is_fitted(self)
        if self.model is not None and input_features is None:
            input_features = self._column_names()
        names = _check_feature_names_in(self, input_features)
        if self.model is None:
            return names
        new = [name + SIMULATED for name in self._quantities()]
        return np.asarray([*names[self._kept()], *new], dtype=object)

    @property
    def _runs(self) -> FreeRuns:
        """How the fitted transformer simulates."""
        return FreeRuns(self._interval, self.substeps_, self._limits, self.hold_, self.method_)

    def _quantities(self) -> list[str]:
        """Return the names of the states and outputs that are appended."""
        known = quantities_of(self.model)
        names = known if self.outputs is None else list(self.outputs)
        unknown = [name for name in names if name not in known]
        if unknown or not names:
            raise ValueError(
                f"outputs: expected states or outputs among {', '.join(known)}, got "
                f"{unknown[0] if unknown else self.outputs!r}."
            )
        return names

    def _refuse_taken_names(self) -> None:
        """Refuse to append a column of a name that X has already."""
        kept = {self._column_names()[i] for i in self._kept()}
        taken = [name + SIMULATED for name in self._quantities() if name + SIMULATED in kept]
        if taken:
            raise OptionError(
                f"X: expected no columns with the names of those that are appended, got "
                f"{', '.join(taken)}. Remedy: rename them or leave them out of X; or append others "
                f"(outputs=...), or nothing else (append=False)."
            )

    def _kept_table(self, X: pd.DataFrame, records: tuple[Record, ...]) -> pd.DataFrame:
        """Return the columns of X that are passed on, states as they are in the first rows."""
        kept = self._on_own_clocks(X, records).iloc[:, self._kept()]
        if isinstance(self.append, str) or not self.append:
            return kept
        named = column_of(self.model, TRAJECTORY, self._column_names())
        if named is not None:
            _warn_of_merging(records, named)
        first = np.empty((len(X), len(self.model.states)))
        for record in records:
            first[record.rows] = record.x0
        held = kept.copy()
        for i, column in self._state_columns().items():
            held[X.columns[column]] = first[:, i]
        return held

    def _on_own_clocks(self, X: pd.DataFrame, records: tuple[Record, ...]) -> pd.DataFrame:
        """Return X with the time of the records: seconds that distinguish the trajectories."""
        names = self._column_names()
        called = time_name(names, self.time_column) or column_of(self.model, TIME, names) or TIME
        table = X.copy(deep=False)
        seconds = np.concatenate([record.t for record in records])
        table.isetitem(names.index(called), rows_in_order(records, seconds))
        return table

    def _column_names(self) -> list[str]:
        """Return the names of the columns of X; those of an array are the model's."""
        if hasattr(self, "feature_names_in_"):
            return list(self.feature_names_in_)
        names = [*self.model.inputs, *self.model.states][: self.n_features_in_ - 1]
        names.insert((self.time_column or 0) % self.n_features_in_, TIME)
        return [self.model.columns.get(name, name) for name in names]

    def _state_columns(self) -> dict[int, int]:
        """Return the column of X of every state that X holds, by the state's index."""
        names, found = self._column_names(), {}
        for i, state in enumerate(self.model.states):
            called = column_of(self.model, state, names)
            if called is not None:
                found[i] = names.index(called)
        return found

    def _kept(self) -> list[int]:
        """Return the columns of X that are passed on."""
        if not self.append:
            return []
        left_out = set() if self.append == "all" else self._trajectory_columns()
        return [i for i, name in enumerate(self._column_names()) if name not in left_out]

    def _trajectory_columns(self) -> set[str]:
        """Return the columns of X that may be read as the trajectory."""
        called = {TRAJECTORY, self.model.columns.get(TRAJECTORY, TRAJECTORY)}
        return called.intersection(self._column_names())

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True  # in states, which are read in a trajectory's first row
        return tags


def _warn_of_merging(records: tuple[Record, ...], named: str) -> None:
    """Warn where trajectories that have names are not distinguished by the time."""
    t = rows_in_order(records, np.concatenate([record.t for record in records]))
    by_time = [rows for _, rows in split_rows(t)]
    apart = len(by_time) == len(records)
    if apart and all(map(np.array_equal, by_time, [record.rows for record in records])):
        return
    warn_user(
        f"X: the column {named!r} is left out, and the time alone does not separate the "
        f"trajectories: they would be read differently from this table. Remedy: append='all', or "
        f"restart the time in every trajectory."
    )


# -- where a simulation has diverged, as targets tell, perhaps in another unit than the outputs ----


def limits_by_targets(model: PhysicsModel, simulated: np.ndarray, y: Table) -> np.ndarray:
    """Return the magnitudes of the outputs beyond which a simulation has diverged.

    y are measured outputs, perhaps in another unit, or something else. The limits are those of the
    measured outputs, in the larger one of two units; of the simulated ones where y are no outputs
    of the model.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> volt = np.array([[1.0], [2.0], [1e9]])  # one of three rows has diverged
    >>> y = np.array([1.0, 2.0, 3.0])
    >>> [limits_by_targets(lag, volt, each)[0].item() for each in (y, y / 1000, None)]
    [3000.0, 3000.0, 1000000000000.0]
    """
    measured = _as_outputs(model, y, len(simulated))
    if measured is None:
        return limits_of(simulated)
    ours, theirs = _median(simulated), _median(measured)
    unit = np.divide(ours, theirs, out=np.ones_like(ours), where=theirs > 0)
    return limits_of(measured) * np.maximum(unit, 1.0)


def _as_outputs(model: PhysicsModel, y: Table, n_samples: int) -> np.ndarray | None:
    """Return the targets of a fit if they can be the model's outputs, else None."""
    try:
        return None if y is None else read_outputs(model, y, n_samples)
    except (TypeError, ValueError):
        return None


def _median(values: np.ndarray) -> np.ndarray:
    """Return the median magnitudes; 0 where there is none."""
    columns = (np.abs(column[np.isfinite(column)]) for column in values.T)
    return np.array([np.median(column) if column.size else 0.0 for column in columns])
