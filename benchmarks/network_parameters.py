"""What the parameters of `PGNNLRegressor` are worth on three simulated plants.

Every line changes one parameter against the defaults. Printed is the free-run RMSE on reference
records that the network has not seen, over that of the physical model: median and range over
seeds, and the time of a fit. Run: ``python benchmarks/network_parameters.py [--seeds 3]``.
"""

import argparse
import time
import warnings

import numpy as np

from sklearn_pgnn import PGNNLRegressor, datasets, network, systems

PLANTS = {
    "golf robot": (systems.golf_robot(), datasets.make_golf_robot),
    "valve": (systems.servo_valve(), datasets.make_servo_valve),
    "valve, limits": (systems.servo_valve(limits=True), datasets.make_servo_valve),
}
CHANGES = [
    {},
    {"lambda_phy": 0.01},
    {"lambda_phy": 0.1},
    {"lambda_phy": 0.5},
    {"lambda_phy": "adaptive"},
    {"lambda_phy": 0.5, "physics_loss": network.Passivity()},
    {"structure": "output"},
    {"structure": "increment"},
    {"structure": "correction"},
    {"guide": None},
    {"guide": "step"},
    {"guide": "terms"},
    {"refine": None},
    {"refine": None, "horizon": 20},
    {"refine": "lbfgs"},
    {"module__neurons": 4},
    {"module__neurons": 13},
    {"module__layers": 1},
    {"module__activation": "silu"},
    {"lr": 0.003},
    {"lr": 0.03},
    {"max_epochs": 20},
    {"max_epochs": 150},
]


def records(make):
    """Give the records to learn from, and two references."""
    return make(), [make(reference=True, random_state=seed) for seed in (0, 1)]


def error(predict, references):
    """Give the free-run RMSE over all references."""
    squares = [(np.ravel(predict(X)) - np.ravel(y)) ** 2 for X, y in references]
    return np.sqrt(np.mean(np.concatenate(squares)))


def simulated(model):
    """Predict by the physical model alone."""

    def predict(X):
        x0 = X[list(model.states)].iloc[0].to_numpy(dtype=float)
        inputs = X[list(model.inputs)].to_numpy()
        return model.simulate(X["t"].to_numpy(), inputs, x0, substeps=4).y

    return predict


def main():
    """Print a line for every plant and change."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--plants", nargs="*", default=list(PLANTS))
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    for plant in arguments.plants:
        model, make = PLANTS[plant]
        (X, y), references = records(make)
        prior = error(simulated(model), references)
        print(f"{plant}: physical model {prior:.4g}", flush=True)
        for change in CHANGES:
            start = time.perf_counter()
            nets = [
                PGNNLRegressor(model, random_state=seed, **change).fit(X, y)
                for seed in range(arguments.seeds)
            ]
            seconds = (time.perf_counter() - start) / arguments.seeds
            ratios = [error(net.predict, references) / prior for net in nets]
            text = ", ".join(f"{name}={value!r}" for name, value in change.items()) or "defaults"
            print(
                f"  {text:45} {np.median(ratios):6.3f}  [{min(ratios):.3f}, {max(ratios):.3f}]"
                f"  {seconds:6.1f} s  {nets[0].structure_}",
                flush=True,
            )


if __name__ == "__main__":
    main()
