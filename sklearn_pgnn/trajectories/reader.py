"""The single reader of X and y, which turns a table of samples into records.

A row is a sample. In a DataFrame (pandas, polars or another library) the columns of X are found by
name: the time ``t``, the inputs, and the states, of which only each trajectory's first row is read.
In an array they follow this order: time, inputs, then states if there are as many more columns. The
columns of y follow the model's order, whether named or not. A new trajectory begins
wherever the time does not increase; a column ``trajectory`` overrides this.

The time is in seconds, or dates or time differences: these count from a trajectory's first sample.

A record's time counts from its first sample, whatever its clock showed. If the model's own
equations contain the time, it is used as given.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from sklearn_pgnn.annotations import ArrayLike, Column, Table
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.effects.differences import is_mark, values_of
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.record import MIN_SAMPLES, Record
from sklearn_pgnn.trajectories.tables import (
    TIME,
    as_pandas,
    as_table,
    column_of,
    is_named,
    once,
    place_of,
    read_clock,
    read_numbers,
    time_name,
)
from sklearn_pgnn.trajectories.torn_rows import INSTEAD, refuse_torn_rows

TRAJECTORY = "trajectory"
#: attribute of an X that was read from files: the rows of every trajectory
SAMPLES = "samples"


def of_files(X: pd.DataFrame) -> pd.DataFrame:
    """Return an X of files, which knows its rows: a whole record lacks what its logger lost."""
    X.attrs[SAMPLES] = {str(name): int(n) for name, n in X[TRAJECTORY].value_counts().items()}
    return X


def read_records(
    model: PhysicsModel,
    X: Table,
    y: Table = None,
    *,
    time_column: Column | None = None,
    allow_unmeasured: bool = False,
    to_fit: bool = True,
) -> tuple[Record, ...]:
    """Read a table of samples as records of a model.

    Parameters
    ----------
    model : PhysicsModel
        Defines the inputs, states and outputs; its `columns` give their names in the table.
    X : DataFrame or array-like of shape (n_samples, n_columns)
        Time [s], inputs and, where known, the states in each trajectory's first row. The time may
        also be dates or time differences, and may be the index of a pandas DataFrame.
    y : DataFrame or array-like of shape (n_samples, n_outputs) or (n_samples,), optional
        Measured outputs in the model's order; NaN where there is no value.
    time_column : int or str, optional
        Name or position of the time column; by default ``"t"``, for an array the first.
    allow_unmeasured : bool, default=False
        Whether some trajectories, but not all, may have no measured output at all.
    to_fit : bool, default=True
        Whether y must suffice for a fit; if False, any trajectory may be short or have no
        measured output.

    Returns
    -------
    tuple of Record
        One per trajectory, in the order of their first rows.

    Raises
    ------
    RecordError
        If a column is missing, a time or an input is not finite, time runs backward inside a
        named trajectory, single rows were drawn from trajectories, y has the index of X in another
        order, or a trajectory has too few samples.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> X = [[0, 1], [0.1, 1], [0.2, 1], [0, 0], [0.1, 0]]
    >>> [record.t.size for record in read_records(lag, X)]
    [3, 2]
    """
    refuse_other_order(X, y)
    table = _as_table(model, X, time_column)
    outputs = None if y is None else read_outputs(model, y, len(table))
    if not len(table):
        raise RecordError("X: expected samples, got none.")
    t, tick = _clock(table)
    u = _inputs(model, table)
    _refuse_not_finite(u, list(model.inputs), table)
    pieces = split_rows(t, _trajectories(table))
    whole = getattr(X, "attrs", {}).get(SAMPLES, {})
    refuse_torn_rows([t[rows] for name, rows in pieces if whole.get(name) != rows.size])
    states = _states(model, table, [rows[0] for _, rows in pieces])
    records = []
    for (name, rows), x0 in zip(pieces, states, strict=True):
        _check_clock(name, t[rows], rows, needs_outputs=to_fit and y is not None)
        measured = None if outputs is None else outputs[rows]
        own = (t[rows] - t[rows[0]]) * (tick or 1.0)
        origin = 0.0 if tick else float(t[rows[0]])
        if not (tick or model.is_autonomous):
            own, origin = t[rows], 0.0
        records.append(Record(own, u[rows], measured, x0, name, rows, origin))
    if to_fit:
        _check_outputs(records, allow_unmeasured)
    return tuple(records)


def split_rows(t: np.ndarray, names: ArrayLike | None = None) -> list[tuple[str, np.ndarray]]:
    """Return name and rows of every trajectory: by default one begins where time does not increase.

    >>> [rows.tolist() for _, rows in split_rows(np.array([0.0, 1.0, 0.0, 1.0]))]
    [[0, 1], [2, 3]]
    """
    if names is None:
        starts = np.flatnonzero(np.diff(t) <= 0) + 1
        pieces = np.split(np.arange(t.size), starts)
        return [(str(i), rows) for i, rows in enumerate(pieces)]
    codes, found = pd.factorize(np.asarray(names), use_na_sentinel=False)
    order = np.argsort(codes, kind="stable")
    edges = np.flatnonzero(np.diff(codes[order])) + 1
    return [(str(found[codes[rows[0]]]), rows) for rows in np.split(order, edges)]


def rows_in_order(records: tuple[Record, ...], values: np.ndarray) -> np.ndarray:
    """Put values that were computed record by record back into the order of the table."""
    ordered = np.empty_like(values)
    ordered[np.concatenate([record.rows for record in records])] = values
    return ordered


# -- columns ---------------------------------------------------------------------------------------


def _as_table(model: PhysicsModel, X: Table, time_column: Column | None) -> pd.DataFrame:
    """Return the relevant columns under the model's own names; X is not modified."""
    X = as_table(X, time_column)
    if is_named(X):
        return _from_names(model, X, time_column)
    array = np.asarray(X)
    if array.ndim != 2:
        raise RecordError(f"X: expected shape (n_samples, n_columns), got {array.shape}.")
    return _from_array(model, array, 0 if time_column is None else time_column)


def _from_names(model: PhysicsModel, X: pd.DataFrame, time_column: Column | None) -> pd.DataFrame:
    """Find every quantity by its column name in the table, else by its own name."""
    found = {}
    told = time_name(X.columns, time_column)
    for name in (TRAJECTORY, TIME, *model.inputs, *model.states):
        given = name == TIME and told is not None
        called = told if given else column_of(model, name, X.columns)
        if called is not None and called in X.columns:
            found[name] = once(X, called, "X: column")
        elif name == TIME or name in model.inputs:
            what = f"time {told or TIME!r}" if name == TIME else f"input {name!r}"
            remedy = "name the column in the model's 'columns'"
            if is_mark(model, name):
                remedy = f"add the column, {values_of(name)}"
            raise RecordError(
                f"X: {what} is missing; the columns are {', '.join(X.columns)}. Remedy: {remedy}."
            )
    return pd.DataFrame(found, index=X.index, copy=False)  # which is only read


def _from_array(model: PhysicsModel, array: np.ndarray, time_column: Column) -> pd.DataFrame:
    names = [*model.inputs]
    width = array.shape[1] - 1
    if width == len(names) + len(model.states):
        names += list(model.states)
    if width != len(names):
        raise RecordError(
            f"X: expected the columns time, {', '.join([*model.inputs, *model.states])} (the "
            f"states may be left out), got {array.shape[1]} columns. Remedy: a DataFrame, which "
            f"may have others; tools that hand over arrays (BaggingRegressor) or leave columns out "
            f"(SequentialFeatureSelector, RFE) need EnsembleRegressor, or fits with a model "
            f"without the input, in their place."
        )
    names.insert(place_of(time_column, array.shape[1]), TIME)
    return pd.DataFrame(array, columns=names)


def _clock(table: pd.DataFrame) -> tuple[np.ndarray, float | None]:
    """Read the time: in seconds or, for dates, in ticks, with the length of a tick [s]."""
    clock = read_clock(table[TIME], "X: time 't'")
    if clock is not None:
        return clock
    t = read_numbers(table[TIME], "X: time 't'")
    _refuse_not_finite(t[:, None], [TIME], table)
    return t, None


def _inputs(model: PhysicsModel, table: pd.DataFrame) -> np.ndarray:
    columns = [read_numbers(table[name], f"X: input {name!r}") for name in model.inputs]
    return np.column_stack(columns) if columns else np.zeros((len(table), 0))


def _states(model: PhysicsModel, table: pd.DataFrame, firsts: Sequence[int]) -> np.ndarray:
    """Read the states in the first row of every trajectory, NaN where there is no value."""
    states = np.full((len(firsts), len(model.states)), np.nan)
    first = table.iloc[firsts]
    for i, name in enumerate(model.states):
        if name in table.columns:
            states[:, i] = read_numbers(first[name], f"X: state {name!r}")
    states[~np.isfinite(states)] = np.nan
    return states


def _trajectories(table: pd.DataFrame) -> np.ndarray | None:
    """Return the trajectory of every row, or None if the table has no such column."""
    if TRAJECTORY not in table:
        return None
    empty = np.flatnonzero(table[TRAJECTORY].isna())
    if empty.size:
        raise RecordError(
            f"X: column 'trajectory' is empty in row {empty[0]}; expected a name in every row."
        )
    return table[TRAJECTORY].to_numpy()


# -- checks ----------------------------------------------------------------------------------------


def _refuse_not_finite(values: np.ndarray, names: list[str], table: pd.DataFrame) -> None:
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        row, column = bad[0]
        place = f" (trajectory {str(table[TRAJECTORY].iloc[row])!r})" if TRAJECTORY in table else ""
        raise RecordError(
            f"X: column {names[column]!r} is {values[row, column]} in row {row}{place}; expected "
            f"a finite number. Remedy: fill the gap or cut the record there."
        )


def _check_clock(name: str, t: np.ndarray, rows: np.ndarray, needs_outputs: bool) -> None:
    backward = np.flatnonzero(np.diff(t) <= 0)
    if backward.size:
        k = int(backward[0])
        raise RecordError(
            f"X: time does not increase inside trajectory {name!r}: {t[k]:.12g} s in row "
            f"{rows[k]}, then {t[k + 1]:.12g} s in row {rows[k + 1]}. {INSTEAD}, if single rows "
            f"were drawn or permuted; else sort the rows, or name every trajectory differently."
        )
    if needs_outputs and t.size < MIN_SAMPLES:
        raise RecordError(
            f"X: trajectory {name!r} has {t.size} samples; expected at least {MIN_SAMPLES}. "
            f"Remedy: leave it out, or check that time increases along the rows."
        )


def _check_outputs(records: list[Record], allow_unmeasured: bool) -> None:
    blind = [record.name for record in records if not record.is_measured]
    if records[0].y is None or not blind or (allow_unmeasured and len(blind) < len(records)):
        return
    if allow_unmeasured:
        raise RecordError("y: no trajectory has a measured output at all.")
    raise RecordError(f"y: trajectory {blind[0]!r} has no measured output at all.")


# -- y is read by place: by name, scores of scikit-learn could compare one output with another -----


def read_outputs(model: PhysicsModel | None, y: Table, n_samples: int) -> np.ndarray:
    """Read the measured outputs, NaN where there is no value.

    The outputs are in the model's order, and its `columns` give their names in the table; without a
    model, y may have any columns. The names of a DataFrame are checked; a Series may have any, for
    what is computed from a column keeps its name. Return them in the shape (n_samples, n_outputs).
    """
    y = as_pandas(y)
    table = y if isinstance(y, pd.DataFrame) else pd.DataFrame(np.asarray(y))
    names = [str(i) for i in range(table.shape[1])] if model is None else list(model.outputs)
    if model is not None:
        _refuse_other_names(model, table)
    if table.shape != (n_samples, len(names)):
        raise RecordError(
            f"y: expected shape {(n_samples, len(names))} (the outputs {', '.join(names)}), "
            f"got {table.shape}."
        )
    columns = [read_numbers(table.iloc[:, i], f"y: output {n!r}") for i, n in enumerate(names)]
    values = np.column_stack(columns)
    infinite = np.argwhere(np.isinf(values))
    if infinite.size:
        row, column = infinite[0]
        raise RecordError(f"y: output {names[column]!r} is infinite in row {row}.")
    return values


def refuse_other_order(X: Table, y: Table) -> None:
    """Raise `RecordError` where y has the index of X in another order: rows are read by place.

    >>> X = pd.DataFrame({"t": [0.0, 0.1]})
    >>> refuse_other_order(X, pd.Series([1.0, 2.0], index=[1, 0]))
    Traceback (most recent call last):
        ...
    sklearn_pgnn.exceptions.RecordError: y: expected the rows of X in their order, got the same \
index in another one, first 1 in place of 0. Remedy: y.loc[X.index].
    """
    if not (isinstance(X, pd.DataFrame) and isinstance(y, pd.DataFrame | pd.Series)):
        return
    own, given = X.index, y.index
    if len(own) != len(given) or own.equals(given) or set(own) != set(given):
        return
    k = next(k for k, (a, b) in enumerate(zip(own, given, strict=True)) if a != b)
    raise RecordError(
        f"y: expected the rows of X in their order, got the same index in another one, first "
        f"{given[k]} in place of {own[k]}. Remedy: y.loc[X.index]."
    )


def _refuse_other_names(model: PhysicsModel, y: pd.DataFrame) -> None:
    """Refuse names that are not those of the outputs in their order."""
    if not any(isinstance(name, str) for name in y.columns):
        return
    given = [_named_column(model, name, y) for name in model.outputs]
    if given != list(y.columns):
        raise RecordError(
            f"y: expected the outputs in the model's order, {', '.join(given)}; got the columns "
            f"{', '.join(map(str, y.columns))}. Predictions are compared with y by place. "
            f"Remedy: y[{given!r}]."
        )


def _named_column(model: PhysicsModel, name: str, y: pd.DataFrame) -> str:
    """Return the name of the column that holds an output."""
    called = column_of(model, name, y.columns)
    if called is None:
        raise RecordError(
            f"y: output {name!r} is missing; the columns are {', '.join(map(str, y.columns))}. "
            f"Remedy: name the column in the model's 'columns', or y.to_numpy() if only the name "
            f"is wrong."
        )
    once(y, called, "y: column")
    return called
