"""The columns of a table that a network uses besides the model's own quantities."""

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY
from sklearn_pgnn.trajectories.tables import SIMULATED, once, read_numbers, time_name


def with_names(model: PhysicsModel, X, time_column=None):
    """Name the columns of an array that `PhysicsModelTransformer` gave.

    They are time, inputs, states or none, and the simulated states and outputs.
    """
    if isinstance(X, pd.DataFrame) or isinstance(time_column, str):
        return X
    known = dict.fromkeys([*model.states, *model.outputs])
    simulated = [name + SIMULATED for name in known]
    for given in ([*model.inputs], [*model.inputs, *model.states]):
        names = [*given, *simulated]
        width = 1 + len(names)
        if X.shape[1] == width != 1 + len(model.inputs) + len(model.states):
            names.insert((time_column or 0) % (1 + len(given)), TIME)
            return pd.DataFrame(X, columns=names)
    return X


def simulated_states(model: PhysicsModel, X) -> np.ndarray | None:
    """Return the columns of the simulated states, or None where a table lacks one."""
    names = [state + SIMULATED for state in model.states]
    if not isinstance(X, pd.DataFrame) or not set(names) <= set(X.columns):
        return None
    return _numbers(X, names)


def further_columns(model: PhysicsModel, X, time_column) -> list[str]:
    """Name the columns that are neither time, trajectory, quantity of the model nor simulation.

    A column with the name of an output is never one: it would reveal what is to be predicted.
    """
    if not isinstance(X, pd.DataFrame):
        return []
    own = [TIME, TRAJECTORY, *model.inputs, *model.states, *model.outputs]
    taken = {
        time_name(X.columns, time_column),
        *own,
        *(model.columns.get(name, name) for name in own),
    }
    taken |= {name + SIMULATED for name in (*model.states, *model.outputs)}
    return [name for name in X.columns if name not in taken]


def feature_values(X, names: list[str]) -> np.ndarray:
    """Read the further columns that `further_columns` named in `fit`."""
    return _numbers(X, names) if names else np.zeros((len(X), 0))


def _numbers(X: pd.DataFrame, names) -> np.ndarray:
    """Read columns as finite numbers."""
    values = np.column_stack([_column(X, name) for name in names])
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise RecordError(
            f"X: column {names[column]!r} is {values[row, column]} in row {row}; expected a finite "
            f"number. Remedy: if it is an initial state, name it in the model's 'columns' or in "
            f"'states'; else fill the gap or leave the column out."
        )
    return values


def _column(X: pd.DataFrame, name: str) -> np.ndarray:
    column = once(X, name, "X: column")
    try:
        return read_numbers(column, f"X: column {name!r}")
    except RecordError as error:
        raise RecordError(
            f"X: column {name!r} is not numeric. Remedy: encode it, or leave it out."
        ) from error
