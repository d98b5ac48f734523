"""Beyond which magnitude a simulation has diverged, as told by the targets of a transformer's fit.

The targets may be in another unit than the model's outputs
(`sklearn.compose.TransformedTargetRegressor` standardises them), so that an output has diverged
only if it is too large both for the unit of y as it is, and for the one in which the medians of y
and of the simulation are the same.
"""

import numpy as np

from sklearn_pgnn.annotations import Table
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.divergence import limits_of
from sklearn_pgnn.trajectories.outputs import read_outputs


def limits_by_targets(model: PhysicsModel, simulated: np.ndarray, y: Table) -> np.ndarray:
    """Return the magnitudes of the outputs beyond which a simulation has diverged.

    y are measured outputs, perhaps in another unit, or something else. The limits are those of the
    measured outputs, in the larger one of two units; of the simulated ones where y are no outputs
    of the model.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> volt = np.array([[1.0], [2.0], [1e9]])  # one of three rows has diverged
    >>> y = np.array([1.0, 2.0, 3.0])
    >>> [limits_by_targets(lag, volt, each)[0].item() for each in (y, y / 1000, None)]
    [3000.0, 3000.0, 1000000000000.0]
    """
    measured = _as_outputs(model, y, len(simulated))
    if measured is None:
        return limits_of(simulated)
    ours, theirs = _median(simulated), _median(measured)
    unit = np.divide(ours, theirs, out=np.ones_like(ours), where=theirs > 0)
    return limits_of(measured) * np.maximum(unit, 1.0)


def _as_outputs(model: PhysicsModel, y: Table, n_samples: int) -> np.ndarray | None:
    """Return the targets of a fit if they can be the model's outputs, else None."""
    try:
        return None if y is None else read_outputs(model, y, n_samples)
    except (TypeError, ValueError):
        return None


def _median(values: np.ndarray) -> np.ndarray:
    """Return the median magnitudes; 0 where there is none."""
    columns = (np.abs(column[np.isfinite(column)]) for column in values.T)
    return np.array([np.median(column) if column.size else 0.0 for column in columns])
