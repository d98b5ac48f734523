"""Diagnose chains of masses, the middle one with dry friction: processor time and peak memory.

Run ``python benchmarks/chain.py``, or with ``--masses 2 4`` some of them; with ``--own`` every mass
has parameters of its own. Every mass hangs on the one before by a spring and a damper, the first
one on a wall, and a force drives it; every position is measured. The records come from an
integrator of this file (Runge-Kutta at fine steps; friction changes its sign smoothly within a
narrow band of speeds). Each chain is diagnosed with the whole catalogue, in a process of its own on
one core.
"""

import argparse
import resource
import subprocess
import sys
import time
import warnings

import numpy as np
import pandas as pd

from sklearn_pgnn import ModelDiagnosis, PhysicsModel

#: records, samples of each, time between two [s] and integration steps in between
RECORDS, SAMPLES, STEP, FINE = 4, 1000, 0.01, 50
#: mass [kg], stiffness [N/m], damping [N s/m], friction [N], and the half width of the band [m/s]
MASS, STIFFNESS, DAMPING, FRICTION, BAND = 1.0, 200.0, 1.0, 1.0, 2e-4
#: standard deviation of the force [N] and of the sensors' noise [m]
FORCE, NOISE = 20.0, 1e-4


def make_model(masses: int, own: bool = False):
    """Return the chain without friction."""
    places = range(1, masses + 1)
    constants = {"m": (MASS, "kg"), "k": (STIFFNESS, "N/m"), "d": (DAMPING, "N s/m")}
    index = {i: str(i) if own else "" for i in places}
    force = {1: f"k{index[1]}*q1 + d{index[1]}*v1", masses + 1: "0"}
    for i in places[1:]:
        force[i] = f"k{index[i]}*(q{i} - q{i - 1}) + d{index[i]}*(v{i} - v{i - 1})"
    drive = {i: "F - " if i == 1 else "-" for i in places}
    rate = {i: f"({drive[i]}({force[i]}) + {force[i + 1]})/m{index[i]}" for i in places}
    return PhysicsModel(
        name=f"chain of {masses} masses",
        states={f"q{i}": "m" for i in places} | {f"v{i}": "m/s" for i in places},
        equations={f"q{i}": f"v{i}" for i in places} | {f"v{i}": rate[i] for i in places},
        parameters={
            f"{name}{i}": {"value": value, "unit": unit, "bounds": [0, np.inf]}
            for name, (value, unit) in constants.items()
            for i in sorted(set(index.values()))
        },
        inputs={"F": "N"},
        outputs={f"y{i}": f"q{i}" for i in places},
        inertia={f"v{i}": f"m{index[i]}" for i in places},
    )


def make_records(masses: int, seed: int = 0):
    """Return X and y of a chain whose middle mass has dry friction."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(SAMPLES)
    force = FORCE * np.array([_multisine(rng, t) for _ in range(RECORDS)])
    matrix, rubs = _linear_part(masses), masses + masses // 2
    x = np.zeros((RECORDS, 2 * masses))
    y = np.empty((RECORDS, SAMPLES, masses))
    for k in range(SAMPLES):
        y[:, k] = x[:, :masses]
        driven = np.zeros_like(x)
        driven[:, masses] = force[:, k] / MASS
        for _ in range(FINE):
            x = _step(x, matrix, driven, rubs, STEP / FINE)
    y = y + NOISE * rng.normal(size=y.shape)
    record = np.repeat(np.arange(RECORDS), SAMPLES)
    X = pd.DataFrame({"trajectory": record, "t": np.tile(t, RECORDS), "F": force.ravel()})
    return X, y.reshape(-1, masses)


def _multisine(rng, t):
    """Return a random signal of standard deviation one, with frequencies up to 5 Hz."""
    period = t[-1] + STEP
    n = np.arange(1, int(5 * period))
    phase = 2 * np.pi * (n * t[:, None] / period + rng.random(n.size))
    return np.sqrt(2 / n.size) * np.sin(phase).sum(axis=1)


def _linear_part(masses):
    """Return the transposed system matrix of the chain without friction."""
    tie = np.eye(masses) - np.eye(masses, k=-1)
    along = tie.T @ tie / MASS
    zero, one = np.zeros_like(tie), np.eye(masses)
    return np.block([[zero, one], [-STIFFNESS * along, -DAMPING * along]]).T


def _step(x, matrix, driven, rubs, h):
    """Return the states one step later."""

    def rate(x):
        slope = x @ matrix + driven
        slope[:, rubs] -= FRICTION / MASS * np.tanh(x[:, rubs] / BAND)
        return slope

    a = rate(x)
    b = rate(x + h / 2 * a)
    c = rate(x + h / 2 * b)
    d = rate(x + h * c)
    return x + h / 6 * (a + 2 * b + 2 * c + d)


def measure(masses: int, own: bool) -> None:
    """Diagnose one chain in this process, and print what it took."""
    warnings.simplefilter("ignore")
    model = make_model(masses, own)
    X, y = make_records(masses)
    begun = time.process_time()
    found = ModelDiagnosis(model).fit(X, y)
    took = time.process_time() - begun
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    causes = [f"{cause.effect} at {cause.target}" for cause in found.causes_]
    print(
        f"{masses:2d} masses, {2 * masses:2d} states: {took:6.1f} s, {memory:.2f} GB; "
        f"{found.verdict_}: {', '.join(causes) or 'none'}",
        flush=True,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--masses", nargs="+", type=int, default=[2, 4, 8, 16])
    parser.add_argument("--own", action="store_true", help="parameters of every mass")
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        measure(given.child, given.own)
    for masses in () if given.child else given.masses:
        command = [sys.executable, __file__, "--child", str(masses)]
        subprocess.run([*command, "--own"] if given.own else command, check=True)
