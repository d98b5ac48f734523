"""Tables of any library as pandas ones: their clocks, their numbers, and which column is which."""

from collections.abc import Collection

import narwhals.stable.v1 as nw
import numpy as np
import pandas as pd

from sklearn_pgnn.annotations import ArrayLike, Column, Table
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel

TIME = "t"


def as_table(X: Table, time_column: Column | None = None) -> Table:
    """Return a DataFrame of any library as pandas', an index of times as its column ``t``."""
    table = as_pandas(X)
    if not isinstance(table, pd.DataFrame) or time_column is not None or TIME in table.columns:
        return table
    if not isinstance(table.index, pd.DatetimeIndex | pd.TimedeltaIndex):
        return table
    table = table.copy(deep=False)
    table.insert(0, TIME, table.index)
    return table


def as_pandas(X: Table) -> Table:
    """Return a DataFrame or Series of any library as pandas', anything else unchanged."""
    if isinstance(X, pd.DataFrame | pd.Series | np.ndarray):
        return _in_native_order(X)
    native = nw.from_native(X, pass_through=True, allow_series=True)  # polars, pyarrow and others
    if isinstance(native, nw.LazyFrame):
        native = native.collect()
    if isinstance(native, nw.DataFrame):
        return pd.DataFrame({name: native[name].to_numpy() for name in native.columns})
    if isinstance(native, nw.Series):
        return pd.Series(native.to_numpy(), name=native.name)
    return X


def _in_native_order(
    X: pd.DataFrame | pd.Series | np.ndarray,
) -> pd.DataFrame | pd.Series | np.ndarray:
    """Return numbers in native byte order; a table that has only such numbers unchanged."""
    if isinstance(X, pd.DataFrame):
        other = {i: _native(X.iloc[:, i]) for i, d in enumerate(X.dtypes) if _is_foreign(d)}
        X = X.copy(deep=False) if other else X
        for i, column in other.items():
            X.isetitem(i, column)
        return X
    return _native(X) if _is_foreign(X.dtype) else X


def _is_foreign(dtype: object) -> bool:
    return isinstance(dtype, np.dtype) and not dtype.isnative


def _native(values: pd.Series | np.ndarray) -> pd.Series | np.ndarray:
    return values.astype(values.dtype.newbyteorder("="))


def as_columns(values: ArrayLike) -> np.ndarray:
    """Return numbers in double precision with one column per output, also of a plain sequence."""
    values = np.asarray(values, dtype=float)
    return values.reshape(len(values), -1)


def take_rows(table: Table, rows: np.ndarray) -> Table:
    """Return some rows of a table as one of the same type."""
    if hasattr(table, "iloc"):
        return table.iloc[rows]
    native = nw.from_native(table, pass_through=True, allow_series=True, eager_only=True)
    if isinstance(native, nw.DataFrame | nw.Series):
        return native[np.asarray(rows).tolist()].to_native()
    return np.asarray(table)[rows]


def read_clock(column: pd.Series, what: str) -> tuple[np.ndarray, float] | None:
    """Read dates or time differences without loss."""
    if column.dtype.kind not in "mM":
        return None
    empty = np.flatnonzero(column.isna())
    if empty.size:
        raise RecordError(
            f"{what} is NaT in row {empty[0]}; expected a time. "
            f"Remedy: fill the gap or cut the record there."
        )
    index = (pd.DatetimeIndex if column.dtype.kind == "M" else pd.TimedeltaIndex)(column)
    return index.asi8, float(np.timedelta64(1, index.unit) / np.timedelta64(1, "s"))


# -- numbers ---------------------------------------------------------------------------------------


def read_numbers(column: pd.Series, what: str) -> np.ndarray:
    """Read a column as real numbers, NaN where there is no value.

    >>> read_numbers(pd.Series([1, None, 3], dtype="Int64"), "X: input 'u'").tolist()
    [1.0, nan, 3.0]
    """
    if column.dtype.kind in "mMc":
        raise RecordError(f"{what}: expected real numbers, got {column.dtype}.")
    try:
        return column.to_numpy(dtype=float, na_value=np.nan)
    except (TypeError, ValueError):
        strange = pd.to_numeric(column, errors="coerce").isna() & column.notna()
        row = int(np.argmax(strange.to_numpy()))
        raise RecordError(
            f"{what}: expected a number, got {column.iloc[row]!r} in row {row}."
        ) from None


# -- columns of quantities: by the name in the model's `columns`, else by their own ----------------

#: suffix to the name of a simulated quantity
SIMULATED = "_phy"


def column_of(model: PhysicsModel, name: str, columns: Collection[str]) -> str | None:
    """Return the column of a quantity, ``t`` or ``trajectory``, or None if there is none."""
    called = model.columns.get(name, name)
    return next((each for each in (called, name) if each in columns), None)


def time_name(columns: Collection[str], time_column: Column | None) -> str | None:
    """Return the name of the column that `time_column` refers to, by name or position."""
    if time_column is None or isinstance(time_column, str):
        return time_column
    return list(columns)[place_of(time_column, len(columns))]


def place_of(time_column: Column, width: int) -> int:
    """Return the position of the time among the columns; a negative number counts from the last."""
    if not isinstance(time_column, int | np.integer) or not -width <= time_column < width:
        raise RecordError(
            f"time_column: expected a column number from 0 to {width - 1}, got {time_column!r}."
        )
    return int(time_column) % width


def is_named(table: Table) -> bool:
    """Return whether a table has columns with names: no array, no DataFrame of numbered columns."""
    return isinstance(table, pd.DataFrame) and all(isinstance(name, str) for name in table.columns)


def once(table: pd.DataFrame, name: str, what: str) -> pd.Series:
    """Return the column with a name that must be unique."""
    column = table[name]
    if isinstance(column, pd.DataFrame):
        raise RecordError(f"{what} {name!r} is there {column.shape[1]} times; expected it once.")
    return column
