"""The measured outputs: the columns of y follow the model's order, whether named or not.

scikit-learn compares predictions with y by position, in its scores, searches and transformed
targets. If y were read by name, all of these could compare one output with another.
"""

import numpy as np
import pandas as pd

from sklearn_pgnn.annotations import Table
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.tables import as_pandas, column_of, once, read_numbers


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
