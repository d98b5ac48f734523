"""What the parameters of `PGNNLRegressor` are worth on five simulated plants.

Every line changes one parameter against the defaults. Taken is the free-run RMSE on reference
records that the network has not seen, over that of the physical model: median and range over
seeds, which draw the records and the weights, and the processor time of a fit, the mean over
plants. The golf robot is sampled at 250 Hz, which makes a fit four times as fast as at the usual
1 kHz. The column before the last compares with the defaults: median and range, over plants, of the
line's median over the defaults'. The table is written to ``docs/tables/network_parameters.rst``
after every seed, and when the run is broken off; three seeds take half an hour in two processes.
Run:
``python benchmarks/network_parameters.py [--seeds 3] [--jobs 2] [--plants valve ...]``.
"""

import argparse
import datetime
import time
import warnings
from pathlib import Path

import numpy as np
import torch
from joblib import Parallel, delayed
from plants import PLANTS as SMALL_PLANTS

import sklearn_pgnn
from sklearn_pgnn import PGNNLRegressor, datasets, network, systems


def make_golf_robot(**options):
    """Make the golf robot's records at 250 Hz."""
    return datasets.make_golf_robot(sample_rate=250, **options)


PLANTS = {
    "golf robot": (systems.golf_robot(), make_golf_robot),
    "valve": (systems.servo_valve(), datasets.make_servo_valve),
    **{name: (plant.model, plant.make) for name, plant in SMALL_PLANTS.items()},
}
CHANGES = {
    "defaults": {},
    "lambda_phy=0.01": {"lambda_phy": 0.01},
    "lambda_phy=0.1": {"lambda_phy": 0.1},
    'lambda_phy="adaptive"': {"lambda_phy": "adaptive"},
    "lambda_phy=0.1, Passivity()": {"lambda_phy": 0.1, "physics_loss": network.Passivity()},
    'structure="output"': {"structure": "output"},
    'structure="increment"': {"structure": "increment"},
    'structure="correction"': {"structure": "correction"},
    "guide=None": {"guide": None},
    'guide="step"': {"guide": "step"},
    'guide="terms"': {"guide": "terms"},
    "refine=None": {"refine": None},
    "refine=None, horizon=20": {"refine": None, "horizon": 20},
    'refine="lbfgs"': {"refine": "lbfgs"},
    "refine_max_iter=30": {"refine_max_iter": 30},
    "module__neurons=4": {"module__neurons": 4},
    "module__neurons=13": {"module__neurons": 13},
    "module__layers=1": {"module__layers": 1},
    'module__activation="silu"': {"module__activation": "silu"},
    "lr=0.003": {"lr": 0.003},
    "lr=0.03": {"lr": 0.03},
    "max_epochs=20": {"max_epochs": 20},
    "max_epochs=100": {"max_epochs": 100},
}
TABLE = Path(__file__).parents[1] / "docs" / "tables" / "network_parameters.rst"


def error(predict, references):
    """Return the free-run RMSE over all references."""
    squares = [(np.ravel(predict(X)) - np.ravel(y)) ** 2 for X, y in references]
    return np.sqrt(np.mean(np.concatenate(squares)))


def simulated(model):
    """Predict by the physical model alone."""

    def predict(X):
        parts = X.groupby("trajectory", sort=False) if "trajectory" in X else [(0, X)]
        return np.concatenate([run(part) for _, part in parts])

    def run(X):
        x0 = X[list(model.states)].iloc[0].to_numpy(dtype=float)
        inputs = X[list(model.inputs)].to_numpy()
        return model.simulate(X["t"].to_numpy(), inputs, x0, substeps=4).y

    return predict


def measure(plant, change, seed):
    """Fit once; give the error over the physical model's, and the processor time [s]."""
    warnings.simplefilter("ignore")
    model, make = PLANTS[plant]
    references = [make(random_state=reference, reference=True) for reference in (0, 1)]
    X, y = make(random_state=seed)
    start = time.process_time()
    net = PGNNLRegressor(model, random_state=seed, **CHANGES[change]).fit(X, y)
    seconds = time.process_time() - start
    return error(net.predict, references) / error(simulated(model), references), seconds


def cell(found):
    """Write the results of one plant and change."""
    ratios = [ratio for ratio, _ in found]
    return f"{np.median(ratios):.3g} ({min(ratios):.3g} to {max(ratios):.3g})"


def compared(found, change, plants):
    """Compare with the defaults: median and range over plants."""

    def median(plant, change):
        return np.median([ratio for ratio, _ in found[plant, change]])

    ratios = [median(plant, change) / median(plant, "defaults") for plant in plants]
    return f"{np.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"


def write(found, plants):
    """Write the lines that are finished into the documentation."""
    done = [change for change in CHANGES if all(found[plant, change] for plant in plants)]
    seeds = min(len(found[plant, change]) for plant in plants for change in done)
    seconds = {c: np.mean([s for p in plants for _, s in found[p, c]]) for c in done}
    lines = [
        [f"``{change}``" if CHANGES[change] else change]
        + [cell(found[plant, change]) for plant in plants]
        + [compared(found, change, plants), f"{seconds[change]:.1f}"]
        for change in done
    ]
    head = ["changed", *plants, "to the defaults", "fit [s]"]
    modules = (sklearn_pgnn, torch, np)
    versions = ", ".join(f"{module.__name__} {module.__version__}" for module in modules)
    text = (
        f".. list-table:: Written by ``python benchmarks/network_parameters.py`` on "
        f"{datetime.date.today()} with {versions}; seeds 0 to {seeds - 1}: median and range.\n"
        "   :header-rows: 1\n\n"
    )
    for line in [head, *lines]:
        text += "   * - " + "\n     - ".join(line) + "\n"
    TABLE.parent.mkdir(exist_ok=True)
    TABLE.write_text(text, encoding="utf-8")


def main():
    """Go through all changes, seed by seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--plants", nargs="*", default=list(PLANTS), choices=list(PLANTS))
    arguments = parser.parse_args()
    pairs = [(plant, change) for change in CHANGES for plant in arguments.plants]
    found = {pair: [] for pair in pairs}
    try:
        for seed in range(arguments.seeds):
            results = Parallel(arguments.jobs, return_as="generator")(
                delayed(measure)(*pair, seed) for pair in pairs
            )
            for pair, result in zip(pairs, results, strict=True):
                found[pair].append(result)
                print(seed, *pair, *(f"{number:.4g}" for number in result), flush=True)
            write(found, arguments.plants)
    except KeyboardInterrupt:
        write(found, arguments.plants)


if __name__ == "__main__":
    main()
