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
    """Print both times and their ratio."""
    one, other = (
        from_function(
            function,
            {"phi": "rad", "omega": "rad/s"},
            inputs={"torque": "N m"},
            parameters={"J": 0.1, "d": 0.02},
            trace=trace,
        )
        for function, trace in ((called, False), (followed, True))
    )
    for what, wrt in (("simulation", None), ("with sensitivities", ("J", "d"))):
        slow, fast = seconds(one, wrt, 2), seconds(other, wrt, 100)
        print(f"{what}: called {1e3 * slow:.3g} ms, written {1e3 * fast:.3g} ms,", end=" ")
        print(f"{slow / fast:.0f} times as long")


if __name__ == "__main__":
    main()
