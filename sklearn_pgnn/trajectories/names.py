"""The column of a quantity in a table: by its name in the model's `columns`, else its own."""

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel

#: suffix to the name of a simulated quantity
SIMULATED = "_phy"


def column_of(model: PhysicsModel, name: str, columns) -> str | None:
    """Return the name of the column that holds a quantity, or None if there is none.

    The name may be ``t`` or ``trajectory``, too; the model's `columns` give the names in the table.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y"}, columns={"y": "level"})
    >>> column_of(lag, "y", ["t", "level"]), column_of(lag, "y", ["t", "y"])
    ('level', 'y')
    """
    called = model.columns.get(name, name)
    return next((each for each in (called, name) if each in columns), None)


def time_name(columns, time_column):
    """Return the name of the column that `time_column` refers to; a number is its position.

    None is returned unchanged.

    Examples
    --------
    >>> time_name(["u", "clock"], -1), time_name(["u", "clock"], "clock")
    ('clock', 'clock')
    """
    if time_column is None or isinstance(time_column, str):
        return time_column
    return list(columns)[place_of(time_column, len(columns))]


def place_of(time_column, width: int) -> int:
    """Return the position of the time among the columns.

    A negative number counts from the last column.

    Examples
    --------
    >>> place_of(-1, 3)
    2
    """
    if not isinstance(time_column, int | np.integer) or not -width <= time_column < width:
        raise RecordError(
            f"time_column: expected a column number from 0 to {width - 1}, got {time_column!r}."
        )
    return int(time_column) % width


def is_named(table) -> bool:
    """Return whether a table has columns with names.

    An array has none, nor has a DataFrame whose columns are numbered.

    Examples
    --------
    >>> is_named(pd.DataFrame({"t": [0.0]})), is_named(pd.DataFrame([[0.0]]))
    (True, False)
    """
    return isinstance(table, pd.DataFrame) and all(isinstance(name, str) for name in table.columns)


def once(table: pd.DataFrame, name: str, what: str) -> pd.Series:
    """Return the column with a name that must be unique.

    Examples
    --------
    >>> once(pd.DataFrame({"u": [1.0]}), "u", "X: column").tolist()
    [1.0]
    """
    column = table[name]
    if isinstance(column, pd.DataFrame):
        raise RecordError(f"{what} {name!r} is there {column.shape[1]} times; expected it once.")
    return column
