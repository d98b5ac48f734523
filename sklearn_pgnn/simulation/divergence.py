"""Whether a free run has diverged: it became non-finite, or an output is larger than it can be.

A simulated output `RUNAWAY` times larger than any in the fit tells nothing of the machine, finite
as it may be.
"""

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.simulate import Simulation

#: a simulation this many times larger than any output in the fit has diverged
RUNAWAY = 1e3
#: trees and most networks hold numbers in single precision, whose largest is 3.4e38
LARGEST = float(np.finfo(np.float32).max)
#: what may help
REMEDY = (
    "check the parameters' values and units; simulate an unstable machine over shorter "
    "trajectories, or with its controller in the model"
)


def limits_of(y: np.ndarray) -> np.ndarray:
    """Return the magnitudes of outputs beyond which a simulation has diverged."""
    sizes = [np.max(np.abs(column[np.isfinite(column)]), initial=0.0) for column in y.T]
    largest = np.array(sizes)
    return np.where(largest > 0, RUNAWAY * largest, np.inf)


def what_is_beyond(model: PhysicsModel, run: Simulation, limits, remedy: str = REMEDY) -> str:
    """Return where the outputs of a free run leave their limits; empty if they do not.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": -0.01}, {"u": "V"}, name="lag")
    >>> run = lag.simulate([0.0, 0.1], [1.0, 1.0], substeps=100)
    >>> print(what_is_beyond(lag, run, limits_of(np.ones((1, 1)))).split(". ")[0])
    the simulation of 'lag' diverges: 'y' is -2.2e+04 at t = 0.1 s, more than 1000 times ...
    """
    beyond = np.argwhere(np.abs(run.y) > limits)
    if not beyond.size:
        return ""
    k, column = beyond[0]
    return (
        f"the simulation of {model.name!r} diverges: {list(model.outputs)[column]!r} is "
        f"{run.y[k, column]:.3g} at t = {run.t[k]:g} s, more than {RUNAWAY:g} times the largest "
        f"value in fit. Remedy: {remedy}."
    )


def what_is_wrong(run: Simulation, values: np.ndarray, names) -> str:
    """Return why a free run (n_samples, n_names) cannot be trained on; empty if it can.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": -0.01}, {"u": "V"})
    >>> run = lag.simulate([0.0, 1.0, 2.0], [1.0, 1.0, 1.0], [1e-9], substeps=100)
    >>> print(what_is_wrong(run, run.y, ["y"]).split(",")[0])
    'y' diverges: it is -1.86e+43 at t = 1 s
    """
    if run.message:
        return run.message
    bad = np.argwhere(~(np.abs(values) <= LARGEST))
    if not bad.size:
        return ""
    k, column = bad[0]
    if not np.isfinite(values[k, column]):
        return "an output is not finite. Remedy: check the output's expression."
    return (
        f"{names[column]!r} diverges: it is {values[k, column]:.3g} at t = {run.t[k]:g} s, beyond "
        f"single precision. Remedy: {REMEDY}."
    )
