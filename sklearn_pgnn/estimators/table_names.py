"""A table without a model: its states, inputs and outputs, as a model that only names them."""

import keyword
import re

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics.expressions import RESERVED
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY
from sklearn_pgnn.trajectories.tables import as_table, is_named, time_name


def apart_from(names, columns) -> list[str]:
    """Return names that no column has: an underscore is appended to those that one has."""
    found: list[str] = []
    for name in names:
        while name in columns or name in found:
            name += "_"
        found.append(name)
    return found


def is_timed(X, model, time_column) -> bool:
    """Return whether the rows of X are samples in time, not independent rows."""
    named = TIME in getattr(as_table(X), "columns", ())
    return named or model is not None or time_column is not None


def blank_model(X, y, time_column) -> PhysicsModel:
    """Return a model of names alone, without equations, whose states are the columns of y."""
    columns = list(X.columns) if is_named(X) else []
    states = target_names(y, columns=columns)
    if columns:
        aside = {time_name(columns, time_column) or TIME, TRAJECTORY, *states}
        inputs = [name for name in columns if name not in aside]
        gaps = [name for name in inputs if X[name].isna().any()]
        if gaps:
            raise RecordError(
                f"X: column {gaps[0]!r} has gaps, as only states may, and y has no column of that "
                f"name (it has {', '.join(states)}). Remedy: give y as a DataFrame that names the "
                f"states, fill the gaps, or leave the column out."
            )
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
    """Turn column names into distinct ones that are valid in an equation and no column's.

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


def plain_model(X: pd.DataFrame, y, time_column: str, states) -> PhysicsModel:
    """Return chains of integrators that only name the quantities of a machine without a model.

    The state is every output and, for a machine that has inertia, its rate.

    Columns of X besides the time, ``trajectory`` and the states are inputs. The columns `states`
    hold the initial state: the outputs, or the outputs and then their rates; by default these, at
    rest at the first output.
    """
    n_outputs = 1 if np.ndim(y) == 1 else np.shape(y)[1]
    named = [] if states is None else list(states)
    if named and len(named) not in (n_outputs, 2 * n_outputs):
        raise ValueError(
            f"states: expected {n_outputs} outputs, or {2 * n_outputs} outputs and rates, "
            f"got {len(named)} names."
        )
    if time_column not in X.columns:
        raise ValueError(
            f"time_column: X has no {time_column!r}; it has {', '.join(map(str, X.columns))}."
        )
    missing = [name for name in named if name not in X.columns]
    if missing:
        raise ValueError(
            f"states: X has no column {missing[0]!r}; it has {', '.join(X.columns)}. Remedy: leave "
            f"'states' out where only the outputs in y were measured, which with their rates are "
            f"then the state; or add the column: each trajectory's first row is read."
        )
    positions = apart_from([f"x{i}" for i in range(n_outputs)], X.columns)
    velocities = apart_from([f"v{i}" for i in range(n_outputs)], X.columns)
    velocities = [] if len(named) == n_outputs else velocities
    equations = dict.fromkeys(positions, "0") | dict.fromkeys(velocities, "0")
    equations |= dict(zip(positions, velocities, strict=False))
    taken = {time_column, TRAJECTORY, *named}
    given = [c for c in X.columns if c not in taken]
    own = apart_from([f"u{i}" for i in range(len(given))], X.columns)
    inputs = dict(zip(own, given, strict=True))
    outputs = apart_from([f"y{i}" for i in range(n_outputs)], X.columns)
    first = np.nan_to_num(np.asarray(y, dtype=float).reshape(len(X), n_outputs)[0])
    return PhysicsModel(
        name="plain network",
        states=dict.fromkeys(equations, ""),
        equations=equations,
        inputs=dict.fromkeys(inputs, ""),
        outputs=dict(zip(outputs, positions, strict=True)),
        initial_state=dict(zip(positions, first.tolist(), strict=True)),
        columns=inputs | dict(zip(equations, named, strict=False)),
    )
