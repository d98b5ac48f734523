"""The methods that are compared, what is searched in each, and how."""

import warnings

import numpy as np
from plants import PLANTS
from sklearn.ensemble import HistGradientBoostingRegressor
from skopt import BayesSearchCV
from skopt.space import Categorical, Real

from sklearn_pgnn import PGNNLRegressor, ResidualRegressor, SINDYcRegressor, systems
from sklearn_pgnn.model_selection import TrajectoryKFold, search_space

#: candidates of a search, those of them that are spread evenly, and its folds
CANDIDATES, SPREAD, FOLDS = 8, 5, 2
#: neurons in each of the two layers of a network
NEURONS = (2, 9)
#: a quicker training for the studies that is as good; see `benchmarks/network_parameters.py`
QUICK = {"module__neurons": 4, "max_epochs": 20}
NETWORKS = ("plain network", "PGNN", "PGNN-L")


def make_methods(name):
    """Return every method of a plant as an estimator with its search space, None for none."""
    plant = PLANTS[name]
    names = systems.servo_valve() if "valve" in name else plant.prior
    residual = ResidualRegressor(plant.prior, HistGradientBoostingRegressor())
    return {
        "plain network": _network(PGNNLRegressor(states=list(plant.prior.states))),
        "SINDYc, paper's library": _sparse(names, plant.library),
        "SINDYc, prior's terms": _sparse(plant.prior, "model"),
        "residual modelling": (
            residual,
            {
                "regressor__learning_rate": Real(0.01, 0.3, prior="log-uniform"),
                "regressor__max_leaf_nodes": (3, 63),
                "regressor__l2_regularization": Real(1e-3, 10, prior="log-uniform"),
            },
        ),
        "PGNN": _network(PGNNLRegressor(plant.prior), lambda_phy=None),
        "PGNN-L": _network(PGNNLRegressor(plant.prior)),
    }


def _network(network, **changes):
    if network.model is None:
        changes["structure"] = Categorical(["output", "increment"])
    return network, search_space(network, neurons=NEURONS, layers=None, horizon=None, **changes)


def _sparse(model, library):
    sindyc = SINDYcRegressor(model, library=library, degree=1)
    alpha, discrete = Real(1e-6, 0.1, prior="log-uniform"), Categorical([False, True])
    return sindyc, search_space(sindyc, library=None, alpha=alpha, discrete=discrete)


def minus_log_rmse(estimator, X, y):
    """Score a free run; a logarithm, so that one that diverges does not drown the others."""
    return -float(np.log(np.sqrt(np.mean((np.ravel(estimator.predict(X)) - np.ravel(y)) ** 2))))


def tune(estimator, space, X, y):
    """Search by Bayesian optimisation over folds of whole trajectories; give the parameters."""
    search = BayesSearchCV(
        estimator,
        space,
        n_iter=CANDIDATES,
        cv=TrajectoryKFold(FOLDS),
        scoring=minus_log_rmse,
        refit=False,
        random_state=0,
        optimizer_kwargs={
            "n_initial_points": SPREAD,
            "initial_point_generator": "lhs",
        },
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        search.fit(X, y)
    return {key: _plain(value) for key, value in search.best_params_.items()}


def best_structure(model, X, y, **parameters):
    """Train increments and a correction; keep what held-out training records say is better."""
    nets = [
        PGNNLRegressor(model, structure=structure, **parameters).fit(X, y)
        for structure in ("increment", "correction")
    ]
    return min(nets, key=lambda net: net.free_run_error_)


def seeded(estimator, seed):
    """Set every random state in an estimator."""
    states = [key for key in estimator.get_params() if key.endswith("random_state")]
    return estimator.set_params(**dict.fromkeys(states, seed))


def _plain(value):
    """Turn a number of NumPy into Python's."""
    return value.item() if hasattr(value, "item") else value
