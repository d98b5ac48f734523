"""Where a table holds a quantity: by the name that the model's table gives it, else its own."""

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel

#: what a simulated quantity has behind its name
SIMULATED = "_phy"


def column_of(model: PhysicsModel, name: str, columns) -> str | None:
    """Return the name of the column that holds a quantity, or None where there is none.

    Parameters
    ----------
    model : PhysicsModel
        Its `columns` say what the table calls the quantities.
    name : str
        The quantity: an input, state, output, ``t`` or ``trajectory``.
    columns : sequence of str
        The columns of the table.

    Returns
    -------
    str or None
        The column.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y"}, columns={"y": "level"})
    >>> column_of(lag, "y", ["t", "level"]), column_of(lag, "y", ["t", "y"])
    ('level', 'y')
    """
    called = model.columns.get(name, name)
    return next((each for each in (called, name) if each in columns), None)


def time_name(columns, time_column):
    """Return the name of the column that `time_column` means: a number is its place.

    Parameters
    ----------
    columns : sequence of str
        The columns of the table.
    time_column : int, str or None
        The parameter.

    Returns
    -------
    str or None
        The name; None as it came.

    Raises
    ------
    RecordError
        If there is no column in that place.

    Examples
    --------
    >>> time_name(["u", "clock"], -1), time_name(["u", "clock"], "clock")
    ('clock', 'clock')
    """
    if time_column is None or isinstance(time_column, str):
        return time_column
    return list(columns)[place_of(time_column, len(columns))]


def place_of(time_column, width: int) -> int:
    """Return the place of the time among so many columns.

    Parameters
    ----------
    time_column : int
        The parameter; below zero it counts from the last column.
    width : int
        Number of columns.

    Returns
    -------
    int
        The place.

    Raises
    ------
    RecordError
        If there is no column in that place.

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

    Parameters
    ----------
    table : DataFrame or ndarray
        The table.

    Returns
    -------
    bool
        False for an array, and for a DataFrame whose columns are numbered.

    Examples
    --------
    >>> is_named(pd.DataFrame({"t": [0.0]})), is_named(pd.DataFrame([[0.0]]))
    (True, False)
    """
    return isinstance(table, pd.DataFrame) and all(isinstance(name, str) for name in table.columns)


def once(table: pd.DataFrame, name: str, what: str) -> pd.Series:
    """Return the column of a name that no other column has.

    Parameters
    ----------
    table : DataFrame
        The table.
    name : str
        The column.
    what : str
        What it is called, for the error's text.

    Returns
    -------
    Series
        The column.

    Raises
    ------
    RecordError
        If several columns have the name.

    Examples
    --------
    >>> once(pd.DataFrame({"u": [1.0]}), "u", "X: column").tolist()
    [1.0]
    """
    column = table[name]
    if isinstance(column, pd.DataFrame):
        raise RecordError(f"{what} {name!r} is there {column.shape[1]} times; expected it once.")
    return column
