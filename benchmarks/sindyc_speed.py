"""How long SINDYcRegressor takes to fit, beside pysindy on the same samples.

A cart on a hardening spring, position and speed measured at 100 Hz with noise, is identified from
polynomials of degree 2 and 3: by `SINDYcRegressor` without a model, and by ``pysindy.SINDy`` with
smoothed finite differences, the same library and STLSQ. Printed is the median of the processor
times [s] of a few fits that take turns, and the ratio. Run:
``python benchmarks/sindyc_speed.py [--repeats 5] [--samples 2000 20000 100000]``.
"""

import argparse
import time
import warnings

import numpy as np
import pandas as pd
import pysindy

import sklearn_pgnn
from sklearn_pgnn import PhysicsModel, SINDYcRegressor

CART = PhysicsModel(
    states={"x": "m", "v": "m/s"},
    equations={"x": "v", "v": "force - 9*x - 0.5*v - 4*x**3"},
    inputs={"force": "N"},
    outputs={"x": "x", "v": "v"},
)
INTERVAL, NOISE = 0.01, 0.002


def make_records(n_samples, n_records):
    """Make records of the cart, each of its own swept force."""
    random = np.random.default_rng(0)
    t = INTERVAL * np.arange(n_samples // n_records)
    records = []
    for _ in range(n_records):
        rates, phases = random.uniform(0.3, 4.0, 5), random.uniform(0, 2 * np.pi, 5)
        force = 2 * np.sin(np.outer(t, rates) + phases).sum(axis=1)
        y = CART.simulate(t, force, substeps=2).y
        records.append((t, force, y + NOISE * random.standard_normal(y.shape)))
    return records


def fit_ours(records, degree):
    """Prepare the fit by SINDYcRegressor."""
    frames = [
        pd.DataFrame({"trajectory": i, "t": t, "force": force, "x": y[:, 0], "v": y[:, 1]})
        for i, (t, force, y) in enumerate(records)
    ]
    table = pd.concat(frames, ignore_index=True)
    regressor = SINDYcRegressor(degree=degree)
    return lambda: regressor.fit(table[["trajectory", "t", "force"]], table[["x", "v"]])


def fit_pysindy(records, degree):
    """Prepare the fit by pysindy."""
    t, force, y = (list(part) for part in zip(*records, strict=True))
    force = [each[:, None] for each in force]

    def fit():
        model = pysindy.SINDy(
            optimizer=pysindy.STLSQ(threshold=0.05),
            feature_library=pysindy.PolynomialLibrary(degree),
            differentiation_method=pysindy.SmoothedFiniteDifference(),
        )
        return model.fit(y, t=t, u=force)

    return fit


def seconds(fit):
    """Measure the processor time of a fit [s]."""
    start = time.process_time()
    fit()
    return time.process_time() - start


def main():
    """Measure and print every size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--samples", type=int, nargs="*", default=[2_000, 20_000, 100_000])
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    print(f"sklearn_pgnn {sklearn_pgnn.__version__}, pysindy {pysindy.__version__}")
    print(f"{'samples':>8} {'records':>8} {'degree':>7} {'SINDYc':>9} {'pysindy':>9} {'ratio':>6}")
    for n_samples in arguments.samples:
        for n_records in (1, 6):
            records = make_records(n_samples, n_records)
            for degree in (2, 3):
                fits = fit_ours(records, degree), fit_pysindy(records, degree)
                for fit in fits:
                    fit()
                times = [[seconds(fit) for fit in fits] for _ in range(arguments.repeats)]
                ours, theirs = np.median(times, axis=0)
                print(
                    f"{n_samples:8d} {n_records:8d} {degree:7d} {ours:9.4f} {theirs:9.4f} "
                    f"{ours / theirs:6.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
