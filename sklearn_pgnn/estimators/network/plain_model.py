"""A chain of integrators, in place of a physical model, that only names the quantities."""

import numpy as np
import pandas as pd

from sklearn_pgnn.estimators.made_up_names import apart_from
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.reader import TRAJECTORY


def plain_model(X: pd.DataFrame, y, time_column: str, states) -> PhysicsModel:
    """Name the states, inputs and outputs of records of a machine without a model.

    The state is every output and, for a machine that has inertia, its rate.

    Columns of X besides the time, ``trajectory`` and the states are inputs. The columns `states`
    hold the initial state: the outputs, or the outputs and then their rates; by default these, at
    rest at the first output. The model is chains of integrators.

    Examples
    --------
    >>> X = pd.DataFrame({"t": [0.0, 1.0], "voltage": [1.0, 1.0]})
    >>> print(plain_model(X, np.zeros((2, 1)), "t", None).to_text())
    x0' = v0
    v0' = 0
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
