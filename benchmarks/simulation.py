"""Time the compiled simulation against a NumPy loop and SciPy, side by side in one run.

Run with ``python benchmarks/simulation.py``; prints the best time of each way and how many times
the compiled simulation is faster.
"""

import time

import numpy as np
from scipy.integrate import solve_ivp

from sklearn_pgnn import systems

SAMPLES, STEP, REPEATS = 10_000, 1e-3, 3
GOLF = systems.golf_robot()
P = {name: parameter.value for name, parameter in GOLF.parameters.items()}


def right_hand_side(x, torque):
    """Write the golf robot's equations by hand."""
    phi, omega = x
    m, a, g = P["m"], P["a"], P["g"]
    load = max(m * a * omega**2 + m * g * np.cos(phi), 0.0)
    friction = P["r"] * P["mu"] * np.sign(omega) * load
    turning = -m * g * a * np.sin(phi) - P["d"] * omega - friction + 4 * torque
    return np.array([omega, turning / P["J"]])


def numpy_loop(t, torque):
    """Step RK4 in Python; the input is held."""
    x, states = np.zeros(2), np.empty((t.size, 2))
    for k in range(t.size):
        states[k] = x
        k1 = right_hand_side(x, torque[k])
        k2 = right_hand_side(x + STEP / 2 * k1, torque[k])
        k3 = right_hand_side(x + STEP / 2 * k2, torque[k])
        k4 = right_hand_side(x + STEP * k3, torque[k])
        x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return states


def scipy_solver(t, torque):
    """Let SciPy choose the steps, none longer than a sample, so that no input is stepped over."""

    def held(now, x):
        return right_hand_side(x, torque[min(int(now / STEP + 1e-9), t.size - 1)])

    return solve_ivp(held, (t[0], t[-1]), np.zeros(2), t_eval=t, max_step=STEP).y.T


def compiled(t, torque):
    """Simulate by the package."""
    return GOLF.simulate(t, torque, np.zeros(2)).x


def compiled_with_gradients(t, torque):
    """Simulate by the package, with the sensitivities to all parameters."""
    return GOLF.simulate(t, torque, np.zeros(2), wrt=GOLF.free_parameters).x


def best_time(way, *arguments):
    """Return the shortest of some runs [s] and what came out."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        states = way(*arguments)
        times.append(time.perf_counter() - start)
    return min(times), states


def main():
    """Print a table."""
    t = np.arange(SAMPLES) * STEP
    torque = 0.4 * np.sin(2 * t) + 0.3 * np.sin(7 * t)
    start = time.perf_counter()
    compiled(t, torque)
    print(f"first call, compiled or loaded from the cache: {time.perf_counter() - start:.2f} s")
    compiled_with_gradients(t, torque)
    base, reference = best_time(compiled, t, torque)
    print(f"{SAMPLES} samples of the golf robot, best of {REPEATS}")
    for way in (compiled, compiled_with_gradients, numpy_loop, scipy_solver):
        seconds, states = best_time(way, t, torque)
        off = np.abs(states[:, 0] - reference[:, 0]).max()
        print(
            f"{way.__name__:24s} {1e3 * seconds:9.2f} ms  {seconds / base:7.1f} times as long"
            f"   differs by {off:.1e} rad"
        )


if __name__ == "__main__":
    main()
