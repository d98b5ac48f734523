"""States, inputs and valid names of a table without a model."""

import keyword
import re

import numpy as np
import pandas as pd

from sklearn_pgnn.estimators.made_up_names import apart_from
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.expressions import RESERVED
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY
from sklearn_pgnn.trajectories.tables import as_table, is_named, time_name


def is_timed(X, model, time_column) -> bool:
    """Return whether the rows of X are samples in time, not independent rows."""
    named = TIME in getattr(as_table(X), "columns", ())
    return named or model is not None or time_column is not None


def blank_model(X, y, time_column) -> PhysicsModel:
    """Return a model of names alone, without equations: its states are the columns of y.

    They are constant. X has time and inputs, and in a DataFrame also the states; only states may
    have gaps.
    """
    columns = list(X.columns) if is_named(X) else []
    states = target_names(y, columns=columns)
    if columns:
        aside = {time_name(columns, time_column) or TIME, TRAJECTORY, *states}
        inputs = [name for name in columns if name not in aside]
        _refuse_gaps(X, inputs, states)
    else:
        inputs = [f"u{i}" for i in range(X.shape[1] - 1)]
    called = [*states, *inputs]
    names = identifiers(called, columns)
    return PhysicsModel(
        states=dict.fromkeys(names[: len(states)], ""),
        equations=dict.fromkeys(names[: len(states)], "0"),
        inputs=dict.fromkeys(names[len(states) :], ""),
        columns={
            name: column for name, column in zip(names, called, strict=True) if name != column
        },
    )


def target_names(y, letter: str = "x", columns=()) -> list[str]:
    """Name the columns of y; without names ``x0``, ``x1`` ..., unlike any column of X."""
    if isinstance(y, pd.DataFrame):
        return [str(name) for name in y.columns]
    if isinstance(getattr(y, "name", None), str):
        return [y.name]
    shape = np.asarray(y).shape
    n_targets = shape[1] if len(shape) == 2 else 1
    return apart_from([f"{letter}{i}" for i in range(n_targets)], columns)


def identifiers(called, columns=()) -> list[str]:
    """Turn column names into distinct names that are valid in an equation.

    They consist of letters, digits and underscores, and do not begin with a digit; a changed name
    never equals one of all `columns` of the table.

    Examples
    --------
    >>> identifiers(["phi", "torque [N m]", "2nd", "sin", "phi"])
    ['phi', 'torque_N_m', 'x2nd', 'sin_', 'phi_']
    """
    names: list[str] = []
    for column in called:
        name = re.sub(r"\W+", "_", str(column)).strip("_") or "x"
        name = f"x{name}" if name[0].isdigit() else name
        others = {*names, *RESERVED, *(set(columns) - {column})}
        while name in others or keyword.iskeyword(name):
            name += "_"
        names.append(name)
    return names


def _refuse_gaps(X: pd.DataFrame, inputs, states) -> None:
    gaps = [name for name in inputs if X[name].isna().any()]
    if gaps:
        raise RecordError(
            f"X: column {gaps[0]!r} has gaps, as only states may, and y has no column of that "
            f"name (it has {', '.join(states)}). Remedy: give y as a DataFrame that names the "
            f"states, fill the gaps, or leave the column out."
        )
