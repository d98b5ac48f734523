"""Conversion of tables of any library to pandas, and their clocks."""

import narwhals.stable.v1 as nw
import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError

TIME = "t"


def as_table(X, time_column=None):
    """Return a DataFrame of any library as a pandas one, with its clock as a column.

    An index of dates or of time differences becomes the column ``t``, if X has no such column and
    `time_column` is not given. Anything but a DataFrame is returned unchanged.

    Examples
    --------
    >>> index = pd.to_datetime(["2026-01-31 12:00:00", "2026-01-31 12:00:01"])
    >>> as_table(pd.DataFrame({"u": [1.0, 2.0]}, index)).columns.tolist()
    ['t', 'u']
    """
    table = as_pandas(X)
    if not isinstance(table, pd.DataFrame) or time_column is not None or TIME in table.columns:
        return table
    if not isinstance(table.index, pd.DatetimeIndex | pd.TimedeltaIndex):
        return table
    table = table.copy(deep=False)
    table.insert(0, TIME, table.index)
    return table


def as_pandas(X):
    """Return a DataFrame or Series of any library as a pandas one, anything else unchanged.

    Its numbers get native byte order, the only one that pandas reads.

    Examples
    --------
    >>> as_pandas(np.array([1.0], dtype=">f8")).dtype
    dtype('float64')
    """
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


def _in_native_order(X):
    """Return numbers in native byte order; a table that has only such numbers unchanged."""
    if isinstance(X, pd.DataFrame):
        other = {i: _native(X.iloc[:, i]) for i, d in enumerate(X.dtypes) if _is_foreign(d)}
        X = X.copy(deep=False) if other else X
        for i, column in other.items():
            X.isetitem(i, column)
        return X
    return _native(X) if _is_foreign(X.dtype) else X


def _is_foreign(dtype) -> bool:
    return isinstance(dtype, np.dtype) and not dtype.isnative


def _native(values):
    return values.astype(values.dtype.newbyteorder("="))


def as_columns(values) -> np.ndarray:
    """Return numbers with one column per output; a plain sequence becomes one column.

    The numbers are in double precision.

    Examples
    --------
    >>> as_columns([1, 2]).tolist()
    [[1.0], [2.0]]
    """
    values = np.asarray(values, dtype=float)
    return values.reshape(len(values), -1)


def take_rows(table, rows):
    """Return some rows of a table.

    They are a table of the same type.
    """
    if hasattr(table, "iloc"):
        return table.iloc[rows]
    native = nw.from_native(table, pass_through=True, allow_series=True, eager_only=True)
    if isinstance(native, nw.DataFrame | nw.Series):
        return native[np.asarray(rows).tolist()].to_native()
    return np.asarray(table)[rows]


def read_clock(column: pd.Series, what: str) -> tuple[np.ndarray, float] | None:
    """Read dates or time differences without loss.

    Examples
    --------
    >>> ticks, tick = read_clock(pd.Series(pd.to_timedelta([0, 5], unit="ms")), "t")
    >>> ((ticks - ticks[0]) * tick).tolist()
    [0.0, 0.005]
    """
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
