"""How much slower a model is that calls a function than the one with its equations.

Run as ``python benchmarks/speed/called_function.py``; times are of the processor.
"""

import math
import time

import numpy as np

from sklearn_pgnn.priors import from_function

T = np.arange(0, 10, 0.01)
U = np.sin(T)


def called(t, x, u, p):
    """Return a pendulum's rates by what has no equation."""
    phi, omega = x
    return [omega, (u[0] - p["d"] * omega) / p["J"] - 9.81 * math.sin(phi)]


def in_python(t, x, u, p):
    """Return the same by what numba cannot compile."""
    torque, p = u[0], dict(zip(p.names, p, strict=True))
    return [x[1], (torque - p["d"] * x[1]) / p["J"] - 9.81 * math.sin(x[0])]


def followed(t, x, u, p):
    """Return the same by what has one."""
    phi, omega = x
    return [omega, (u[0] - p["d"] * omega) / p["J"] - 9.81 * np.sin(phi)]


def seconds(model, wrt, times: int) -> float:
    """Return how long a simulation takes."""
    model.simulate(T, U, wrt=wrt)
    before = time.process_time()
    for _ in range(times):
        model.simulate(T, U, wrt=wrt)
    return (time.process_time() - before) / times


def main() -> None:
    """Print the times and their ratios."""
    models = {
        function.__name__: from_function(
            function,
            {"phi": "rad", "omega": "rad/s"},
            inputs={"torque": "N m"},
            parameters={"J": 0.1, "d": 0.02},
            trace=function is followed,
        )
        for function in (followed, called, in_python)
    }
    for what, wrt in (("simulation", None), ("with sensitivities", ("J", "d"))):
        least = seconds(models["followed"], wrt, 100)
        print(f"{what}: written {1e3 * least:.2g} ms", end="")
        for name, times in (("called", 20), ("in_python", 2)):
            took = seconds(models[name], wrt, times)
            print(f", {name} {1e3 * took:.2g} ms, {took / least:.0f} times as long", end="")
        print()


if __name__ == "__main__":
    main()
