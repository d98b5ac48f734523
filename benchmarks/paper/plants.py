"""The paper's plants: the prior, records to learn from, records to be judged by.

The rigs' records are not public. `sklearn_pgnn.datasets` simulates the machines by an integrator
of its own with finer steps, and with effects that the prior lacks.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np
import pandas as pd

from sklearn_pgnn import PhysicsModel, PhysicsModelTransformer, datasets, systems
from sklearn_pgnn.model_selection import train_validation_test_split

#: beginning of a record that counts as its transient [s]
TRANSIENT = 1.5


@dataclass(frozen=True)
class Plant:
    """A machine and what is known of it.

    Parameters
    ----------
    prior : PhysicsModel
        The physical model.
    make : callable
        Makes records; takes ``reference``, ``noise`` and ``random_state``.
    library : str or list
        The paper's library for SINDYc.
    references : tuple of int, default=(0,)
        Seeds of the reference records.
    end : float, default=inf
        Length that is kept of every record to learn from [s].
    paper : dict of str to float
        The paper's RMSE by method.
    """

    prior: PhysicsModel
    make: Callable
    library: str | list
    references: tuple = (0,)
    end: float = np.inf
    paper: dict = field(default_factory=dict)


GOLF_ERRORS = {
    "physical model": 6.6563e-4,
    "plain network": 8.9736e-4,
    "SINDYc, paper's library": 3.4516e-4,
    "PGNN-L": 3.7982e-4,
}
VALVE_ERRORS = {
    "physical model": 5.0501e-4,
    "plain network": 2.1382e-4,
    "SINDYc, paper's library": 2.8619e-4,
    "PGNN-L": 1.1982e-4,
}
LIMITS_ERRORS = {**VALVE_ERRORS, "physical model": 3.9959e-4, "PGNN-L": 7.3835e-5}

_golf_robot = partial(Plant, library=["polynomial", "fourier"], references=(0, 1))
_golf = systems.golf_robot()
PLANTS = {
    "golf robot": _golf_robot(
        _golf, partial(datasets.make_golf_robot, sample_rate=500), paper=GOLF_ERRORS
    ),
    "golf robot, transient": _golf_robot(
        _golf, partial(datasets.make_golf_robot, sample_rate=500), end=TRANSIENT
    ),
    "golf robot, 250 Hz": _golf_robot(_golf, partial(datasets.make_golf_robot, sample_rate=250)),
    "golf robot, 250 Hz, transient": _golf_robot(
        _golf, partial(datasets.make_golf_robot, sample_rate=250), end=TRANSIENT
    ),
    "valve": Plant(
        systems.servo_valve(), datasets.make_servo_valve, "polynomial", paper=VALVE_ERRORS
    ),
    "valve, limits": Plant(
        systems.servo_valve(limits=True),
        datasets.make_servo_valve,
        "polynomial",
        paper=LIMITS_ERRORS,
    ),
}


@lru_cache(maxsize=4)
def records(name):
    """Make the records of a plant: X and y."""
    X, y = PLANTS[name].make()
    kept = (X["t"] < PLANTS[name].end).to_numpy()
    return X[kept].reset_index(drop=True), y[kept].reset_index(drop=True)


def split(name):
    """Cut the records 60-20-20; give X and y of the first 80 %, and of the rest to test on."""
    X_train, X_validation, X_test, *y = train_validation_test_split(*records(name))
    return pd.concat([X_train, X_validation]), pd.concat(y[:2]), X_test, y[2]


@lru_cache(maxsize=8)
def references(name, *, noise=None):
    """Make the records that nothing has learnt from: a list of X and y."""
    options = {} if noise is None else {"noise": noise}
    make = PLANTS[name].make
    return [make(reference=True, random_state=i, **options) for i in PLANTS[name].references]


def simulated(model):
    """Return a function that predicts by a model alone, from each record's first row."""

    def predict(X):
        simulation = PhysicsModelTransformer(model, outputs=list(model.outputs), append=False)
        return simulation.fit(X).transform(X)

    return predict


def rmse(predict, tables):
    """Return the free-run RMSE over all records."""
    squares = [(np.ravel(predict(X)) - np.ravel(y)) ** 2 for X, y in tables]
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def judge(name, predict, test=()):
    """Return the errors of a prediction, on records and truth, relative to the prior's.

    Parameters
    ----------
    name : str
        The plant.
    predict : callable
        Gives the outputs for X.
    test : list of (X, y), optional
        Further records to judge by.

    Returns
    -------
    dict of str to float
        ``ratio`` on the reference records as measured, ``truth`` on the same without noise, and
        ``test``, where there is one.
    """
    sets = {"ratio": references(name), "truth": references(name, noise=0.0), "test": test}
    prior = simulated(PLANTS[name].prior)
    return {key: rmse(predict, each) / rmse(prior, each) for key, each in sets.items() if each}
