"""The diagnosis of a recipe's prior, and the models of the depths that follow from it."""

from typing import Any

from joblib import Memory
from sklearn.base import clone

from sklearn_pgnn.diagnosis import ModelDiagnosis
from sklearn_pgnn.grey_box.default_parts import diagnosis_or_default
from sklearn_pgnn.grey_box.tables import PlainTable
from sklearn_pgnn.grey_box.time_functions import depends_on_time, time_invariant_causes
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.user_line import warn_user


def prepare_diagnosis(diagnosis, model: PhysicsModel, *, judges_new_records: bool):
    """Return the diagnosis to be made of the prior.

    Parameters
    ----------
    diagnosis : ModelDiagnosis or None
        The settings that the user gives.
    model : PhysicsModel
        The prior.
    judges_new_records : bool
        Whether folds hide whole trajectories; if not, the default settings leave out functions of
        the time.

    Returns
    -------
    ModelDiagnosis
        A copy, not fitted.
    """
    own: dict[str, Any] = {"model": model, "time_column": None, "n_jobs": None}
    if diagnosis is None and not judges_new_records:
        own["catalogue"] = time_invariant_causes(model)
    return clone(diagnosis_or_default(diagnosis, model)).set_params(**own)


def threads_of(diagnosis: ModelDiagnosis | None, n_jobs: int | None) -> int | None:
    """Return the ``n_jobs`` of a recipe, or that of a given diagnosis if it has its own."""
    own = None if diagnosis is None else diagnosis.n_jobs
    return n_jobs if own is None else own


def diagnose(diagnosis: ModelDiagnosis, table: PlainTable, memory: Memory, n_jobs):
    """Diagnose the prior; if the diagnosis fails, return its best result until then.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        The diagnosis, see `prepare_diagnosis`; fitted in place unless its result is kept.
    table : PlainTable
        The records.
    memory : joblib.Memory
        Where the result is kept.
    n_jobs : int or None
        Number of processes, on which the result does not depend.

    Returns
    -------
    ModelDiagnosis
        The fitted diagnosis.
    """
    try:
        X = table.starting(diagnosis.model, table.told)
        kept = memory.cache(_diagnosed, ignore=["n_jobs"])
        return kept(diagnosis, X, table.y, n_jobs=n_jobs)
    except Exception as error:
        if not hasattr(diagnosis, "verdict_"):
            raise
        warn_user(
            f"the diagnosis stopped with an error ({diagnosis.stopped_}; "
            f"{type(error).__name__}: {error}); its best result so far is used. Remedy: a "
            f"smaller catalogue in diagnosis=ModelDiagnosis(...)."
        )
        return diagnosis


def _diagnosed(diagnosis, X, y, n_jobs) -> ModelDiagnosis:
    """Fit a diagnosis, in place; if it fails, it holds its best result until then."""
    return diagnosis.set_params(n_jobs=n_jobs).fit(X, y)


def diagnosed_models(
    diagnosis: ModelDiagnosis, model: PhysicsModel, *, judges_new_records: bool
) -> dict[str, PhysicsModel]:
    """Return the models of the depths that follow from a diagnosis.

    They take no function of the time from one record, unless folds judge it on others.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        The fitted diagnosis.
    model : PhysicsModel
        The prior.
    judges_new_records : bool
        Whether folds hide whole trajectories.

    Returns
    -------
    dict of str to PhysicsModel
        By the name of the depth.
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
