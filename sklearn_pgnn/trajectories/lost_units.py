"""Records that a scaler has stripped of their units, and how they are recognised.

A number does not reveal its unit. A scaler shows in the time, which it standardises too: to mean 0
and standard deviation 1. In a part of such a table, such as a fold, time and inputs have nearly
this mean and deviation; its trajectories begin below zero, and neither its even steps nor their
rate are a round number: clocks are set by hand, standard deviations are not. The levels of an input
are also set by hand: a column that runs between round numbers, such as a square wave of 1 N or a
clock from -1 s to 1 s, has its mean and deviation by chance, unless the other columns have them
too. The output of a ``MinMaxScaler``, inputs that were scaled without the time, and a part of a
standardised clock with uneven steps cannot be distinguished from ordinary records.
"""

from collections.abc import Sequence

import numpy as np

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.record import Record
from sklearn_pgnn.user_line import warn_user

#: tolerance of mean 0 and deviation 1 for a whole standardised column
EXACT = 1e-6
#: tolerances for a part of one: two thirds of a column cannot have a larger mean than this, since
#: the rest has the opposite one; a deviation differs from 1 by less than this factor
PART_MEAN, PART_FACTOR = 0.5**0.5, 2.0
#: significant digits of a sample interval, rate or level set by hand
DIGITS = 6
#: fewest samples for a decision
FEWEST = 10
REMEDY = (
    "Remedy: let time, inputs, states and outputs bypass the scaler (ColumnTransformer(..., "
    "remainder='passthrough')), or use make_pgnn_pipeline"
)


def refuse_standardised(
    model: PhysicsModel, records: Sequence[Record], *, energies: bool = False
) -> None:
    """Refuse standardised times, with inputs also parts of such, and for energies any column."""
    t = np.concatenate([record.origin + record.t for record in records])
    if t.size < FEWEST:
        return
    u = np.concatenate([record.u for record in records])
    below_zero = sum(record.origin + record.t[0] < 0 for record in records)
    part = below_zero > len(records) / 2 and not _has_set_clock(records)
    part = part and u.shape[1] and all(map(_is_nearly, [t, *u.T]))
    if part or _is_standardised(t) or _are_standardised_together(t, u):
        raise RecordError(
            f"X: the time is standardised, so that its unit is lost: it begins at {t[0]:.3g} s, "
            f"its mean is {t.mean():.2g} s, its deviation {t.std():.2g} s, but a simulation needs "
            f"seconds and physical units. {REMEDY}. If the clock is right, let it begin at 0."
        )
    if energies:
        _refuse_each(model, records, u)


def warn_of_standardised_outputs(model: PhysicsModel, records: Sequence[Record]) -> None:
    """Warn of outputs that a scaler has stripped of their units, to which a model is fitted."""
    y = np.concatenate([record.y for record in records])
    lost = [
        name
        for name, values in zip(model.outputs, y.T, strict=True)
        if _is_standardised(values[np.isfinite(values)])
    ]
    if lost:
        warn_user(
            f"y: expected {', '.join(lost)} in physical units, got mean 0 and deviation 1, as a "
            f"scaler leaves them: no parameters of the model can follow numbers without a unit. "
            f"Remedy: fit y as measured; TransformedTargetRegressor(regressor, func=..., "
            f"inverse_func=...) converts units, and StandardScaler is for what has none.",
            RecordWarning,
        )


def _refuse_each(model: PhysicsModel, records: Sequence[Record], u: np.ndarray) -> None:
    """Refuse an input or an output that is exactly standardised over all records."""
    columns = {f"input {name!r}": u[:, i] for i, name in enumerate(model.inputs)}
    if records[0].y is not None:
        y = np.concatenate([record.y for record in records])
        columns |= {f"output {name!r}": y[:, i] for i, name in enumerate(model.outputs)}
    for what, values in columns.items():
        if _is_standardised(values[np.isfinite(values)]):
            raise RecordError(
                f"X, y: the {what} is standardised, so that its unit is lost, but energies need "
                f"physical units. {REMEDY}; or set lambda_phy=0."
            )


def _are_standardised_together(t: np.ndarray, u: np.ndarray) -> bool:
    """Whether one scaler changed the time and all inputs, at least one of them not constant."""
    common = _scalers(t)
    for column in u.T:
        common = common and common & _scalers(column)
    return bool(common) and bool(u.any())


def _is_standardised(values: np.ndarray) -> bool:
    """Whether a whole column is standardised and does not run between levels set by hand."""
    if values.size < FEWEST or not _scalers(values):
        return False
    return not (_is_round(values.min()) and _is_round(values.max()))


def _scalers(values: np.ndarray) -> set[str]:
    """Name the scalers that yield such a column; all of them map a constant to 0."""
    found, is_zero = set(), not values.any()
    if abs(values.mean()) < EXACT and (is_zero or abs(values.std() - 1) < EXACT):
        found.add("StandardScaler")
    low, high = np.percentile(values, [25, 75])
    if abs(np.median(values)) < EXACT and (is_zero or abs(high - low - 1) < EXACT):
        found.add("RobustScaler")
    return found


def _has_set_clock(records: Sequence[Record]) -> bool:
    """Whether the steps or their rate are a round number, or the steps are uneven."""
    steps = np.concatenate([np.diff(record.t) for record in records])
    if not steps.size:
        return True
    step = np.median(steps)
    even = np.mean(np.abs(steps / step - 1) < EXACT) > 0.5
    return not even or _is_round(step) or _is_round(1 / step)


def _is_round(value: float) -> bool:
    """Whether a number has few digits, like one set by hand."""
    return bool(abs(float(f"{value:.{DIGITS}g}") - value) < 1e-9 * abs(value)) or value == 0


def _is_nearly(values: np.ndarray) -> bool:
    """Whether a column may be a part of a standardised one."""
    spread = values.std()
    return bool(abs(values.mean()) < PART_MEAN and 1 / PART_FACTOR < spread < PART_FACTOR)
