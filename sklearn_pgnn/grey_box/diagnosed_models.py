"""The diagnosis of a recipe's prior, and the models of the depths that follow from it."""

import warnings
from collections.abc import Callable
from typing import Any

from joblib import Memory
from sklearn.base import clone

from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.exceptions import DiagnosisWarning
from sklearn_pgnn.grey_box.options import diagnosis_or_default
from sklearn_pgnn.grey_box.tables import PlainTable
from sklearn_pgnn.grey_box.time_limit import TimeLimit
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.physics.expressions import TIME
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.user_line import warn_user

#: is told of a stage, the number of steps done and of all
Show = Callable[..., None]


def prepare_diagnosis(diagnosis, model: PhysicsModel, time: TimeLimit, *, judges_new_records: bool):
    """Return an unfitted diagnosis, without functions of time that no fold can judge."""
    own: dict[str, Any] = {"model": model, "time_column": None, "n_jobs": None}
    if diagnosis is None and not judges_new_records:
        own["catalogue"] = time_invariant_causes(model)
    own["compare_records"] = False  # nobody says of a new record to which group it belongs
    prepared = clone(diagnosis_or_default(diagnosis, model))
    return prepared.set_params(**own, time_limit=time.of_diagnosis(prepared.time_limit))


def diagnose(
    diagnosis: ModelDiagnosis,
    table: PlainTable,
    memory: Memory,
    n_jobs: int | None,
    show: Show | None = None,
) -> ModelDiagnosis:
    """Diagnose the prior, in place unless its result is kept, as none with a failed stage is."""
    X = table.starting(diagnosis.model, table.told)
    kept = memory.cache(_diagnosed, ignore=["n_jobs", "show"])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DiagnosisWarning)  # raised once there is the result
            return kept(diagnosis, X, table.y, n_jobs=n_jobs, show=show)
    except DiagnosisWarning as lacking:
        warn_user(lacking, DiagnosisWarning)
        return diagnosis


def _diagnosed(diagnosis, X, y, n_jobs, show) -> ModelDiagnosis:
    """Fit a diagnosis, in place."""
    own = diagnosis.progress
    try:
        return diagnosis.set_params(n_jobs=n_jobs, progress=own or show).fit(X, y)
    finally:
        diagnosis.set_params(progress=own)  # a display is not kept


def diagnosed_models(
    diagnosis: ModelDiagnosis, model: PhysicsModel, *, judges_new_records: bool
) -> dict[str, PhysicsModel]:
    """Return the models of the depths that follow from a diagnosis.

    They take no function of the time from one record, unless folds judge it on others.
    """
    extended, part = diagnosis.extended_model_, diagnosis.discrepancy_
    models = {
        "prior": model.replace(simulation=dict(extended.simulation)),
        "fitted": diagnosis.refitted_model_,
    }
    if diagnosis.causes_:
        models["extended"] = extended
    may_be_timed = judges_new_records or depends_on_time(extended)
    if part is not None and (may_be_timed or not depends_on_time(part.model)):
        models["formula"] = part.model
    return models


# -- functions of the time alone: they describe how one record went, not the machine ---------------


def depends_on_time(model: PhysicsModel) -> bool:
    """Return whether the time itself stands in a model's equations or outputs.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> depends_on_time(lag), depends_on_time(lag.replace(equations={"y": "(u - y)/T + t"}))
    (False, True)
    """
    return any(TIME in e.free_symbols for e in (*model.equations.values(), *model.outputs.values()))


def time_invariant_causes(model: PhysicsModel) -> tuple[type[Effect], ...]:
    """Return the effects of the catalogue that make no model depend on the time that did not."""
    if depends_on_time(model):
        return tuple(CATALOGUE)
    return tuple(
        kind
        for kind in CATALOGUE
        if not any(depends_on_time(kind(target).apply(model)) for target in kind.targets(model))
    )
