"""Simulations of estimators and models on records, for comparison with the measured outputs."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.diagnosis.free_run import free_runs
from sklearn_pgnn.inspection.start_runs import run_records
from sklearn_pgnn.inspection.style import LABELS
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories import read_records


@dataclass(frozen=True)
class Runs:
    """Records, and their simulations by several models.

    Times [s], inputs and outputs are by record; what is simulated, by the name of each model and by
    record.
    """

    model: PhysicsModel
    names: tuple[str, ...]
    t: tuple[np.ndarray, ...]
    u: tuple[np.ndarray, ...]
    measured: tuple[np.ndarray, ...]
    simulated: dict[str, tuple[np.ndarray, ...]]


def run_estimators(estimator, X=None, y=None) -> Runs:
    """Simulate or predict records in free run.

    The estimator may be a mapping of names to several; a diagnosis has by default the records that
    it was fitted on.
    """
    if X is None:
        return _of_fit(estimator)
    if y is None:
        raise ValueError("y: expected what was measured, got None.")
    several = dict(estimator) if isinstance(estimator, Mapping) else {"": estimator}
    model = _model_of(next(iter(several.values())))
    records = read_records(model, X, y)
    simulated = {}
    for name, each in several.items():
        simulated[name or _name_of(each)] = _run(each, X, records)
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
        diagnosis.model,
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
    for part in _parts(estimator):
        model = part if isinstance(part, PhysicsModel) else getattr(part, "model", None)
        if isinstance(model, PhysicsModel):
            return model
    raise ValueError(
        f"estimator: expected a PhysicsModel, or an estimator or pipeline with one as its model, "
        f"got {type(estimator).__name__}."
    )


def _parts(estimator) -> list:
    found = getattr(estimator, "best_estimator_", estimator)
    return [found, *getattr(found, "named_steps", {}).values()]


def _name_of(estimator) -> str:
    return estimator.name if isinstance(estimator, PhysicsModel) else type(estimator).__name__
