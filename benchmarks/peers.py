"""The package's networks and its sparse regression against peers, all tuned with the same budget.

Machines are the paper's golf robot and servo valve and the three plants of `plants`, whose models
lack an effect. Every method is tuned by the same search over folds of whole trajectories of the
training records, with as many candidates, and judged by its free run on reference records that it
has not seen: as a share of the physical model's error on golf robot and valve (of the valve against
its record without noise), in the unit of the outputs on the others. A peer that is not installed is
left out.

Run ``python benchmarks/peers.py --seeds 5 --candidates 8``; the table in the documentation is
written anew after every seed, and says with how many candidates.
"""

import importlib.util
import warnings
from functools import partial

import numpy as np
from peer_models import FrolsNarx, NetworkNarx, PysindyModel, Subnet
from plants import PLANTS
from seed_table import cell, command_line, run_seeds, write_table
from skopt.space import Categorical, Real

from sklearn_pgnn import EnsembleRegressor, PGNNLRegressor, SINDYcRegressor, datasets, systems
from sklearn_pgnn.model_selection import HalvingBayesSearchCV, TrajectoryKFold, search_space

FOLDS = 3


def rms(error):
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(error))))


def golf(seed):
    """Return prior, training records, reference record, and what an error is measured by."""
    prior = systems.golf_robot()
    make = partial(datasets.make_golf_robot, sample_rate=100, random_state=seed)
    return _against_prior(prior, make(), make(reference=True))


def valve(seed, *, limits):
    """Return the same of the servo valve, whose reference is the record without noise."""
    prior = systems.servo_valve(limits=limits)
    make = partial(datasets.make_servo_valve, random_state=seed)
    return _against_prior(prior, make(), make(reference=True, noise=0.0))


def _against_prior(prior, records, reference):
    X, y = reference
    start = X[list(prior.states)].iloc[0].to_numpy(dtype=float)
    alone = prior.simulate(X["t"], X[list(prior.inputs)], start).y
    return prior, records, reference, rms(alone - np.asarray(y).reshape(alone.shape))


def plant(name, seed):
    """Return the same of a plant, in the unit of its outputs."""
    make = PLANTS[name].make
    return PLANTS[name].model, make(random_state=seed), make(reference=True, random_state=seed), 1.0


MACHINES = {
    "golf robot": golf,
    "valve": partial(valve, limits=False),
    "valve, limits": partial(valve, limits=True),
    **{name: partial(plant, name) for name in PLANTS},
}


def methods(prior, seed):
    """Return every method as an estimator and what is searched in it."""
    guided = PGNNLRegressor(prior, random_state=seed)
    several = EnsembleRegressor(PGNNLRegressor(prior), random_state=seed)
    sparse = SINDYcRegressor(prior, degree=2)
    found = {
        "PGNN-L": (guided, search_space(guided, layers=None, horizon=None)),
        "PGNN-L, median of 5": (several, search_space(several, layers=None, horizon=None)),
        "SINDYcRegressor": (sparse, search_space(sparse, library=None)),
        "NARX, scikit-learn": (
            NetworkNarx(prior, random_state=seed),
            {"lags": (1, 8), "neurons": (4, 32), "alpha": Real(1e-6, 1.0, prior="log-uniform")},
        ),
        "pysindy": (
            PysindyModel(prior),
            {
                "degree": (1, 4),
                "threshold": Real(1e-4, 0.3, prior="log-uniform"),
                "width": Categorical([5, 7, 11, 17, 25]),
            },
        ),
    }
    if importlib.util.find_spec("deepSI"):
        found["deepSI, SUBNET"] = (
            Subnet(prior, random_state=seed),
            {
                "states": (2, 6),
                "lags": (2, 12),
                "horizon": (20, 80),
                "learning_rate": Real(5e-4, 1e-2, prior="log-uniform"),
            },
        )
    if importlib.util.find_spec("sysidentpy"):
        space = {"lags": (1, 6), "degree": (1, 3), "n_terms": (3, 15)}
        found["SysIdentPy, FROLS"] = FrolsNarx(prior), space
    return found


def score(estimator, X, y):
    """Score a free run by the logarithm of its error, so that one that diverges drowns none."""
    apart = np.asarray(estimator.predict(X)).reshape(len(X), -1) - np.asarray(y).reshape(len(X), -1)
    return -float(np.log(max(rms(apart), np.finfo(float).tiny)))


def measure(candidates, machine, method, seed):
    """Tune a method on a machine, and return its error."""
    warnings.simplefilter("ignore")
    prior, (X, y), (X_new, y_new), unit = MACHINES[machine](seed)
    estimator, space = methods(prior, seed)[method]
    folds = TrajectoryKFold(FOLDS)
    search = HalvingBayesSearchCV(
        estimator, space, n_iter=candidates, cv=folds, scoring=score, random_state=seed
    )
    search.fit(X, y)
    return float(np.exp(-score(search, X_new, y_new)) / unit)


def write(candidates, found, seeds):
    """Write the table into the documentation."""
    names = list(dict.fromkeys(method for _, method in found))
    lines = [[f"machine ({candidates} candidates each)", *names]]
    for machine in dict.fromkeys(machine for machine, _ in found):
        lines.append([machine, *(cell(found[machine, name]) for name in names)])
    write_table("peers", lines, seeds)


def main():
    """Measure all machines and methods, seed by seed."""
    parser = command_line(__doc__, 5)
    parser.add_argument("--candidates", type=int, default=8)
    parser.add_argument("--machines", nargs="*", default=list(MACHINES), choices=MACHINES)
    asked = parser.parse_args()
    names = list(methods(systems.golf_robot(), 0))
    run_seeds(
        asked,
        [(machine, name) for machine in asked.machines for name in names],
        partial(measure, asked.candidates),
        partial(write, asked.candidates),
    )


if __name__ == "__main__":
    main()
