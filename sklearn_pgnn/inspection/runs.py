"""Simulations in free run on records, and how well they fit."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.diagnosis.free_run import free_runs
from sklearn_pgnn.inspection.style import LABELS
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.finite_run import simulate_record, steps_for
from sklearn_pgnn.simulation.free_starts import fit_starts
from sklearn_pgnn.simulation.record_windows import WindowedRecords, window_records
from sklearn_pgnn.simulation.simulate import Simulation
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.trajectories import read_records


def run_records(model: PhysicsModel, records, **options) -> list[Simulation]:
    """Simulate every record in free run from given, followed, or the model's states."""
    if all(record.y is not None for record in records):
        return run_from_starts(model, window_records(model, records, **options))
    steps = steps_for(model, records, **options)._asdict()
    return [simulate_record(model, record, **steps) for record in records]


def run_from_starts(model: PhysicsModel, windowed: WindowedRecords) -> list[Simulation]:
    """Simulate windowed records in free run, each from a start fitted to its beginning."""
    windows = windowed.windows
    starts = fit_starts(model, windows, windowed.states)
    return [
        free_run(model, windows, a, b, start)
        for (a, b), start in zip(pairwise(windows.bounds), starts, strict=True)
    ]


def fit_percentage(measured: ArrayLike, simulated: ArrayLike) -> np.ndarray:
    r"""Return the fit of a simulation to measured outputs, in percent.

    .. math:: 100 \left(1 - \frac{\| y - \hat y \|}{\| y - \bar y \|}\right)

    This is the normalised root mean square error as reported by MATLAB's ``compare``: 100 is
    perfect, 0 is no better than the mean of the record, and below 0 is worse than it.

    Parameters
    ----------
    measured : array-like of shape (n_samples, n_outputs) or (n_samples,)
        Measured outputs [unit of the output]; NaN where nothing was measured.
    simulated : array-like of the same shape
        Simulated outputs [unit of the output].

    Returns
    -------
    ndarray of shape (n_outputs,)
        The fit of every output [%]; minus infinity where a simulation becomes non-finite,
        NaN where an output never changes.

    Raises
    ------
    ValueError
        If the shapes differ.

    Examples
    --------
    >>> t = np.linspace(0, 10, 101)
    >>> fit_percentage(np.sin(t), 0.9 * np.sin(t)).round(1).tolist()
    [89.6]
    """
    y, yhat = (np.asarray(values, dtype=float) for values in (measured, simulated))
    if y.shape != yhat.shape:
        raise ValueError(
            f"simulated: expected the shape of what was measured, {y.shape}, got {yhat.shape}."
        )
    y, yhat = (values.reshape(len(values), -1) for values in (y, yhat))
    seen = np.isfinite(y)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = np.where(seen, y, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
        error = np.sqrt((np.where(seen, y - yhat, 0.0) ** 2).sum(axis=0))
        spread = np.sqrt((np.where(seen, y - mean, 0.0) ** 2).sum(axis=0))
    error = np.where(np.isfinite(error), error, np.inf)
    return 100.0 * (1.0 - error / np.where(spread > 0, spread, np.nan))


@dataclass(frozen=True)
class Runs:
    """Records, each with times [s], inputs and outputs, and their simulations by several models."""

    model: PhysicsModel
    names: tuple[str, ...]
    t: tuple[np.ndarray, ...]
    u: tuple[np.ndarray, ...]
    measured: tuple[np.ndarray, ...]
    simulated: dict[str, tuple[np.ndarray, ...]]


def run_estimators(estimator, X=None, y=None) -> Runs:
    """Simulate or predict records in free run; a diagnosis has by default its own records."""
    if X is None:
        return _of_fit(estimator)
    if y is None:
        raise ValueError("y: expected what was measured, got None.")
    several = dict(estimator) if isinstance(estimator, Mapping) else {"": estimator}
    model = _model_of(next(iter(several.values())))
    records = read_records(model, X, y)
    simulated = {}
    for name, each in several.items():
        called = each.name if isinstance(each, PhysicsModel) else type(each).__name__
        simulated[name or called] = _run(each, X, records)
    return Runs(
        model,
        tuple(record.name for record in records),
        tuple(record.t for record in records),
        tuple(record.u for record in records),
        tuple(np.asarray(record.y) for record in records),
        simulated,
    )


def _of_fit(diagnosis) -> Runs:
    """Return the free runs of a diagnosis' three models over its own records."""
    if not hasattr(diagnosis, "records_"):
        raise ValueError(
            "X: expected the records; only a fitted ModelDiagnosis brings its own. Remedy: pass X "
            "and y."
        )
    records = diagnosis.records_
    windows, cuts = records.windows, records.windows.bounds[1:-1]
    curves = {LABELS[w]: tuple(run.y for run in free_runs(records, w)) for w in records.fits}
    return Runs(
        records.problem.prior,  # with the marks of groups
        records.names,
        tuple(np.split(windows.t, cuts)),
        tuple(np.split(windows.u, cuts)),
        tuple(np.split(windows.y, cuts)),
        curves,
    )


def _run(estimator, X, records) -> tuple[np.ndarray, ...]:
    if isinstance(estimator, PhysicsModel):
        return tuple(run.y for run in run_records(estimator, records))
    check_is_fitted(estimator)
    whole = np.asarray(estimator.predict(X), dtype=float).reshape(len(X), -1)
    return tuple(whole[record.rows] for record in records)


def _model_of(estimator) -> PhysicsModel:
    """Return the model of an estimator, a pipeline step, or the best estimator of a search."""
    found = getattr(estimator, "best_estimator_", estimator)
    for part in (found, *getattr(found, "named_steps", {}).values()):
        model = part if isinstance(part, PhysicsModel) else getattr(part, "model", None)
        if isinstance(model, PhysicsModel):
            return model
    raise ValueError(
        f"estimator: expected a PhysicsModel, or an estimator or pipeline with one as its model, "
        f"got {type(estimator).__name__}."
    )
