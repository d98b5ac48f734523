"""How many explicit steps exported code makes: it has no others."""

import math

import numpy as np

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.fastest import fastest
from sklearn_pgnn.simulation.inputs import delayed_inputs
from sklearn_pgnn.simulation.simulate import settled_start, substeps_of
from sklearn_pgnn.simulation.substeps import MAX_SUBSTEPS, STABLE


def explicit_substeps(model: PhysicsModel, substeps: int | None, interval: float | None) -> int:
    """Return the steps as given, else as in the model, else enough to be stable at its start.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 0.01}, {"u": "V"})
    >>> explicit_substeps(lag, None, 0.001), explicit_substeps(lag, None, 0.05)
    (1, 3)
    """
    implicit = "method" in model.simulation
    if (
        substeps is not None
        or interval is None
        or ("substeps" in model.simulation and not implicit)
    ):
        return substeps_of(model, substeps)
    t, u = np.array([0.0, interval]), np.zeros((2, len(model.inputs)))
    x = np.tile(list(settled_start(model, u[0]).values()), (2, 1)).astype(float)
    fast = fastest(model, t, delayed_inputs(model, t, u, False), x, math.inf)
    if fast > STABLE * MAX_SUBSTEPS:
        raise OptionError(
            f"substeps: expected a number, since {model.name!r} is stiff and exported code makes "
            f"explicit steps: about {math.ceil(fast / STABLE)} from sample to sample are stable at "
            f"its initial state. Remedy: give substeps, a shorter interval, or replace the fastest "
            f"states by their steady-state values."
        )
    return max(1, math.ceil(fast / STABLE))
