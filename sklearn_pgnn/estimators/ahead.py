"""Predict trajectories ahead of their known outputs; where that diverges, simulate."""

from dataclasses import replace
from functools import partial

import numpy as np

from sklearn_pgnn.estimators.one_warning import one_simulation_warning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.ahead import Machine, model_machine, predict_ahead
from sklearn_pgnn.simulation.finite_run import FreeRuns


def predict_records_ahead(
    runs: FreeRuns, model: PhysicsModel, records, steps: int, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Predict states and outputs some samples ahead of the known outputs.

    Return states and outputs of shapes (n_samples, n_states) and (n_samples, n_outputs), finite and
    in the order of the table's rows: those of `FreeRuns.simulate` where a prediction diverges. One
    `SimulationWarning` tells of all simulations that fail. For `steps` and `noise` see
    `sklearn_pgnn.simulation.ahead.predict_ahead`.
    """
    machines = [model_machine(model, each, **runs.options(each)) for each in records]
    with one_simulation_warning() as failed:
        machines = [replace(each, run=partial(_noted, each, failed)) for each in machines]
        found = np.hstack(predict_ahead(machines, steps, noise))
        n_states = len(model.states)
        with np.errstate(invalid="ignore"):
            within = (np.abs(found[:, n_states:]) <= runs.limits).all(axis=1)
        lost = ~(within & np.isfinite(found).all(axis=1))
        if lost.any():
            found[lost] = runs.simulate(model, records, [*model.states, *model.outputs])[lost]
    return found[:, :n_states], found[:, n_states:]


def _noted(machine: Machine, failed: list[str], a: int, b: int, x):
    """Run a machine, and note the name of the trajectory if the run fails."""
    states, outputs = machine.run(a, b, x)
    if not np.isfinite(states[-1]).all():
        failed.append(machine.record.name)
    return states, outputs
