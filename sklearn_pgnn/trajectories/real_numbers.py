"""A column of a table as real numbers."""

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError


def read_numbers(column: pd.Series, what: str) -> np.ndarray:
    """Read a column as real numbers, NaN where there is no value.

    Examples
    --------
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
