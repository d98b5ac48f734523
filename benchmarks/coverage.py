"""How often measurements lie in the intervals that `predict_interval` gives.

Every estimator learns from six training records of a plant and gives intervals of 90 % for the free
runs of four others; taken is the share of their measurements inside, for each seed, which draws
the records. The table is written to ``docs/tables/coverage.rst`` after every seed. Run:
``python benchmarks/coverage.py [--seeds 5] [--estimators SINDYc ...] [--plants mass ...]``; what is
left out keeps no line.
"""

import argparse
import datetime
import warnings
from pathlib import Path

import numpy as np
from plants import PLANTS

import sklearn_pgnn
from sklearn_pgnn import (
    ConformalRegressor,
    GreyBoxRegressor,
    PGNNLRegressor,
    PhysicsModelRegressor,
    SINDYcRegressor,
)

TABLE = Path(__file__).parents[1] / "docs" / "tables" / "coverage.rst"
COVERAGE = 0.9


def fitted(model):
    """Return a regressor that fits a model in free run."""
    return PhysicsModelRegressor(model, search="local", window_length="trajectory")


ESTIMATORS = {
    "right model, fitted": lambda plant: fitted(plant.truth),
    "wrong model, fitted": lambda plant: fitted(plant.model),
    "SINDYc": lambda plant: ConformalRegressor(SINDYcRegressor(plant.model, degree=3)),
    "PGNN": lambda plant: ConformalRegressor(PGNNLRegressor(plant.model), cv=3),
    "recipe": lambda plant: GreyBoxRegressor(plant.model),
}


def measure(estimator, plant, seed) -> tuple[float, float]:
    """Return the coverage, and the intervals' mean width in standard deviations of the outputs."""
    X, y = plant.make(random_state=seed)
    X_test, y_test = plant.make(reference=True, random_state=seed)
    low, high = ESTIMATORS[estimator](plant).fit(X, y).predict_interval(X_test, COVERAGE)
    y_test = y_test.to_numpy()
    inside = (low.reshape(y_test.shape) <= y_test) & (y_test <= high.reshape(y_test.shape))
    width = (high - low).reshape(y_test.shape) / y_test.std(axis=0)
    return float(np.mean(inside)), float(np.mean(width))


def cell(found) -> str:
    """Write the coverage of all seeds and the median width."""
    shares = 100 * np.array([share for share, _ in found])
    width = np.median([width for _, width in found])
    return f"{shares.mean():.0f} ({shares.min():.0f} to {shares.max():.0f}); {width:.2g}"


def write(found, estimators, plants):
    """Write the lines that are there."""
    seeds = min(map(len, found.values()))
    means = {e: [np.mean([s for s, _ in found[e, p]]) for p in plants] for e in estimators}
    lines = [
        [e, *(cell(found[e, p]) for p in plants), f"{100 * np.mean(means[e]):.0f}"]
        for e in estimators
    ]
    text = (
        f".. list-table:: Measurements of unseen records in intervals of {100 * COVERAGE:.0f} %: "
        "share in per cent, mean and range of the seeds; median width in standard deviations of "
        f"the outputs. Written by ``python benchmarks/coverage.py`` on {datetime.date.today()} "
        f"with sklearn_pgnn {sklearn_pgnn.__version__}; seeds 0 to {seeds - 1}.\n"
        "   :header-rows: 1\n\n"
    )
    for line in [["estimator", *plants, "mean share"], *lines]:
        text += "   * - " + "\n     - ".join(line) + "\n"
    TABLE.write_text(text, encoding="utf-8")


def main():
    """Go through all plants and estimators, seed by seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--estimators", nargs="*", default=list(ESTIMATORS), choices=ESTIMATORS)
    parser.add_argument("--plants", nargs="*", default=list(PLANTS), choices=PLANTS)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    pairs = [(e, p) for e in arguments.estimators for p in arguments.plants]
    found = {pair: [] for pair in pairs}
    for seed in range(arguments.seeds):
        for estimator, plant in pairs:
            result = measure(estimator, PLANTS[plant], seed)
            found[estimator, plant].append(result)
            print(seed, estimator, plant, *(f"{number:.3g}" for number in result), flush=True)
        write(found, arguments.estimators, arguments.plants)


if __name__ == "__main__":
    main()
