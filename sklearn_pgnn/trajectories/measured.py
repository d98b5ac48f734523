"""Measured samples of every output, which may be none, or all the same.

Statistics are taken column by column: over the rows of a narrow table NumPy takes nine times as
long.
"""

from collections.abc import Callable, Sequence

import numpy as np

from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user


def of_measured(statistic: Callable, y: np.ndarray) -> np.ndarray:
    """Return a statistic of every column, NaN where nothing was measured.

    >>> of_measured(np.nanmean, np.array([[1.0, np.nan], [2.0, np.nan]])).tolist()
    [1.5, nan]
    """
    return np.array([np.nan if np.isnan(column).all() else statistic(column) for column in y.T])


def where_measured(y: np.ndarray) -> np.ndarray:
    """Return at which samples some output was measured.

    >>> where_measured(np.array([[1.0, np.nan], [np.nan, np.nan]])).tolist()
    [True, False]
    """
    measured = np.zeros(len(y), dtype=bool)
    for column in y.T:
        measured |= np.isfinite(column)
    return measured


def spans_of(y: np.ndarray) -> np.ndarray:
    """Return the largest less the smallest value of every column, NaN where nothing was measured.

    >>> spans_of(np.array([[1.0, np.nan], [3.0, np.nan], [np.nan, np.nan]])).tolist()
    [2.0, nan]
    """
    return np.array([np.fmax.reduce(column) - np.fmin.reduce(column) for column in y.T])


# -- outputs that never change in a record: a dead sensor, or a machine at rest --------------------

#: fewer equal values of an output tell nothing of its sensor: a single one is always the same
SEVERAL = 8


def constant_outputs(records: Sequence[Record]) -> np.ndarray:
    """Return, (n_records, n_outputs), which outputs have no two different values, if any."""
    return ~(np.array([spans_of(np.asarray(record.y)) for record in records]) > 0)


def remarks_on_dead_outputs(model: PhysicsModel, records: Sequence[Record]) -> list[str]:
    """Return remarks on outputs that change in some records only though inputs do in all."""
    still = constant_outputs(records)
    if not still.any():
        return []
    driven = np.array([not model.inputs or bool(np.ptp(r.u, axis=0).any()) for r in records])
    measured = np.array([np.isfinite(np.asarray(r.y)).sum(axis=0) >= SEVERAL for r in records])
    said = []
    for i, name in enumerate(model.outputs):
        dead = np.flatnonzero(still[:, i] & measured[:, i] & driven)
        if dead.size and not still[:, i].all():
            where = ", ".join(_place(model, name, records[r], i) for r in dead.tolist())
            said.append(
                f"output {name!r} has one value only throughout {where}: it changes in other "
                f"trajectories, and there inputs change. Remedy: if its sensor was dead, leave the "
                f"output empty (NaN) there, or leave these trajectories out; if the machine stood "
                f"still, none is needed."
            )
    return said


def _place(model: PhysicsModel, name: str, record: Record, i: int) -> str:
    value = float(np.nanmax(np.asarray(record.y)[:, i]))
    return f"trajectory {record.name!r} ({value:.4g} {model.unit(name)}".rstrip() + ")"


def warn_of_constant_outputs(
    model: PhysicsModel, records: Sequence[Record], *, noise_is_told: bool = False
) -> None:
    """Warn of outputs that never change: in some records, or in all, where no noise is known.

    `noise_is_told` is whether the noise of the outputs need not be estimated.
    """
    for remark in remarks_on_dead_outputs(model, records):
        warn_user(f"y: {remark}", RecordWarning)
    if noise_is_told:
        return
    still = np.flatnonzero(constant_outputs(records).all(axis=0)).tolist()
    for name in (list(model.outputs)[i] for i in still):
        one = f"1 {model.unit(name)}".rstrip()
        warn_user(
            f"y: output {name!r} has one value only in every trajectory in which it was measured: "
            f"its noise cannot be estimated, and counts as {one}. Remedy: a trajectory in which it "
            f"changes, or a model without this output if its sensor is dead; "
            f"PhysicsModelRegressor and ModelDiagnosis take the noise as noise_std.",
            RecordWarning,
        )
