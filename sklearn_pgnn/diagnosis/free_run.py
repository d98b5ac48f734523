"""Free-run simulation of the records: the models simulated without restarts."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sklearn_pgnn.estimation.fitted_records import DiagnosisRecords
from sklearn_pgnn.simulation.simulate import Simulation
from sklearn_pgnn.simulation.state_estimate import free_run
from sklearn_pgnn.simulation.uncertainty import Rounded


@dataclass(frozen=True, repr=False)
class FreeRunError(Rounded):
    """The free-run error of an output over whole records, without restarts.

    Parameters
    ----------
    prior, refitted, extended : float
        Root mean square error of the prior, the re-tuned prior and the extended model; infinite
        where a simulation becomes non-finite.
    formula : float, default=nan
        That of the model with the causes and the formula; not a number where there is none.
    tells : bool, default=True
        Whether any re-tuned model is nearer to the records than their mean is. Where none is, as
        for a chaotic or unstable motion, the free run is not informative.

    Examples
    --------
    >>> error = FreeRunError(prior=2.4, refitted=1.9, extended=0.2)
    >>> error.tells and error.extended < error.refitted
    True
    """

    prior: float
    refitted: float
    extended: float
    formula: float = math.nan
    tells: bool = True


def free_runs(records: DiagnosisRecords, which: str) -> list[Simulation]:
    """Simulate every record in free run by one of the models, from its own initial states."""
    windows, model = records.windows, records.fits[which].model
    return [
        free_run(model, windows, a, b, start)
        for (a, b), start in zip(pairwise(windows.bounds), records.starts[which], strict=True)
    ]


def free_run_errors(records: DiagnosisRecords, tells: np.ndarray) -> dict[str, FreeRunError]:
    """Return the free-run errors of all models over all records, by output."""
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
