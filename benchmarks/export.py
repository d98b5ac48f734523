"""Compare exported C with the simulation: how far apart after many steps, and the time of a step.

Run with ``python benchmarks/export.py``, which needs gcc and torch; it prints the table of the
page on exports.
"""

import ctypes
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from sklearn_pgnn import PGNNLRegressor, effects, systems
from sklearn_pgnn.export import to_c

STEPS = 100_000
FLAGS = ("-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-std=c99")
#: the machine, its sample interval [s], and size and mean of its input; the robot does not go over
#: the top, and the intervals are binary fractions, which clocks of either language count alike
MACHINES = {
    "golf robot with Stribeck friction": (
        systems.golf_robot() + effects.StribeckFriction("omega", 0.1, 0.1, 0.3),
        1 / 128,
        (0.2, 0.0),
    ),
    "two tanks with overflow": (
        systems.two_tanks() + effects.Overflow("x1", limit=7.0, steepness=1.0, share=0.6),
        1.0,
        (1.0, 3.0),
    ),
}
TITLES = (
    '"Machine"',
    '"double: error"',
    '"float: error, of the range"',
    '"C, double [ns]"',
    '"C, float [ns]"',
    '"Python, in a long run [ns]"',
    '"Python, a call [ns]"',
)
LOOP = """
int run(long n, const REAL *u, REAL *y);

int run(long n, const REAL *u, REAL *y)
{
    model_machine machine;
    long k;
    model_start(&machine, u);
    for (k = 0; k < n; k++) {
        model_output(&machine, u + k, y + k);
        model_step(&machine, u + k);
    }
    return 0;
}
"""


def wave(interval, size, mean):
    """Return time and input, two sines with some hundred samples a period."""
    k = np.arange(STEPS)
    return k * interval, mean + size * (np.sin(0.0055 * k) + 0.5 * np.sin(0.024 * k))


def best_time(run, repeats=5):
    """Return the shortest time of some runs [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def compiled(text, real):
    """Return the exported file as a function of inputs and outputs."""
    with TemporaryDirectory() as folder:
        source, library = Path(folder, "run.c"), Path(folder, "run.so")
        source.write_text(text + LOOP.replace("REAL", real), encoding="utf-8")
        subprocess.run(
            ["gcc", *FLAGS, "-shared", "-fPIC", source, "-o", library, "-lm"], check=True
        )
        run = ctypes.CDLL(str(library)).run
    arrays = [ctypes.c_void_p, ctypes.c_void_p]
    run.argtypes = [ctypes.c_long, *arrays]
    return lambda u, y: run(len(u), u.ctypes.data, y.ctypes.data)


def compare(u, write, simulate, step):
    """Return difference, range and time of either precision, and Python's times."""
    found = {}
    reference = simulate()
    for precision, kind in (("double", np.float64), ("single", np.float32)):
        given, y = u.astype(kind), np.zeros(STEPS, kind)
        run = compiled(write(precision), {"double": "double", "single": "float"}[precision])
        seconds = best_time(lambda run=run, given=given, y=y: run(given, y))
        found[precision] = (np.abs(y - reference).max(), np.ptp(reference), seconds / STEPS)
    return found, best_time(simulate) / STEPS, best_time(step, 200)


def row(name, found, python, single_call):
    """Write a row of the table."""
    (off, width, fast), (off_single, _, fast_single) = found["double"], found["single"]
    return (
        f'   "{name}", {off:.1g}, {off_single / width:.1g}, {1e9 * fast:.0f}, '
        f"{1e9 * fast_single:.0f}, {1e9 * python:.0f}, {1e9 * single_call:.0f}"
    )


def machine_row(name):
    """Compare one machine."""
    model, interval, (size, mean) = MACHINES[name]
    t, u = wave(interval, size, mean)
    return row(
        name,
        *compare(
            u,
            lambda precision: to_c(model, interval, precision=precision, name="model"),
            lambda: model.simulate(t, u).y[:, 0],
            lambda: model.simulate(t[:2], u[:2]),
        ),
    )


def network_row():
    """Compare a network that is trained on a robot with more friction than its model knows."""
    robot = systems.golf_robot()
    t, u = wave(1 / 64, 0.2, 0.0)
    run = (robot + effects.ViscousFriction("omega", 0.05)).simulate(t, u)
    table = pd.DataFrame({"t": t, "torque": u, "phi": run.x[:, 0], "omega": run.x[:, 1]})
    network = PGNNLRegressor(robot, random_state=0).fit(table[:3000], run.y[:3000])
    stepper = network.stepper()
    return row(
        "PGNN-L of the robot",
        *compare(
            u,
            lambda precision: to_c(network, precision=precision, name="model"),
            lambda: network.predict(table).ravel(),
            lambda: stepper.step(u[:1]),
        ),
    )


def main():
    """Print the table."""
    print(".. csv-table::")
    print(f"   :header: {', '.join(TITLES)}\n")
    for name in MACHINES:
        print(machine_row(name))
    print(network_row())


if __name__ == "__main__":
    main()
