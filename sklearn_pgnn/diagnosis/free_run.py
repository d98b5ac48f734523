"""Free-run simulation of the records: the models simulated without restarts."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords
from sklearn_pgnn.simulation.simulate import Simulation
from sklearn_pgnn.simulation.state_estimate import free_run


@dataclass(frozen=True)
class FreeRunError:
    """The free-run error of an output over whole records, without restarts.

    Parameters
    ----------
    prior, refitted, extended : float
        Root mean square error of the prior, the re-tuned prior and the extended model; infinite
        where a simulation becomes non-finite.
    tells : bool, default=True
        Whether the re-tuned prior or the extended model is nearer to the records than their mean
        is. Where neither is, as for a chaotic or unstable motion, the free run is not informative.

    Examples
    --------
    >>> error = FreeRunError(prior=2.4, refitted=1.9, extended=0.2)
    >>> error.tells and error.extended < error.refitted
    True
    """

    prior: float
    refitted: float
    extended: float
    tells: bool = True


def free_runs(records: DiagnosisRecords, which: str) -> list[Simulation]:
    """Simulate every record in free run, from the initial state found with the extended model.

    Parameters
    ----------
    records : DiagnosisRecords
        The records.
    which : {"prior", "refitted", "extended"}
        The model.

    Returns
    -------
    list of Simulation
        States and outputs of every record.
    """
    windows, model = records.windows, records.fits[which].model
    states = list(records.fits["extended"].model.states)
    own = [states.index(state) for state in model.states]
    return [
        free_run(model, windows, a, b, start[own])
        for (a, b), start in zip(pairwise(windows.bounds), records.starts, strict=True)
    ]


def free_run_errors(records: DiagnosisRecords, tells: np.ndarray) -> dict[str, FreeRunError]:
    """Return the free-run errors of all models over all records.

    Parameters
    ----------
    records : DiagnosisRecords
        The records.
    tells : ndarray of shape (n_outputs,)
        Whether the free run of an output is informative.

    Returns
    -------
    dict of str to FreeRunError
        Errors by output.
    """
    errors = {which: _errors(records, which) for which in records.fits}
    outputs = records.fits["prior"].model.outputs
    return {
        output: FreeRunError(
            **{name: float(e[i]) for name, e in errors.items()}, tells=bool(tells[i])
        )
        for i, output in enumerate(outputs)
    }


def _errors(records: DiagnosisRecords, which: str) -> np.ndarray:
    y = records.windows.y
    simulated = np.concatenate([run.y for run in free_runs(records, which)])
    with np.errstate(over="ignore", invalid="ignore"):
        squares = np.where(np.isfinite(y), (simulated - y) ** 2, 0.0).sum(axis=0)
    return np.nan_to_num(np.sqrt(squares / np.isfinite(y).sum(axis=0)), nan=np.inf)
