"""Diagnose an hour at 1 kHz: the time it takes, and the memory.

A cart on a spring with dry friction, 3.6 million samples in one record. Run:
``python benchmarks/speed/long_record.py [--samples 3600000] [--jobs 2]``.
"""

import argparse
import resource
import time

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from sklearn_pgnn import ModelDiagnosis, effects, systems

STEP, FADES, FORCE, NOISE = 1e-3, 0.3, 10.0, 1e-3


def record(samples):
    """Return X and y of one record."""
    rng, keeps = np.random.default_rng(0), np.exp(-STEP / FADES)
    t = STEP * np.arange(samples)
    force = lfilter([FORCE * np.sqrt(1 - keeps**2)], [1, -keeps], rng.normal(size=samples))
    rig = systems.cart_on_spring() + effects.CoulombFriction("v", level=1.0)
    y = rig.simulate(t, force).y[:, 0] + NOISE * rng.normal(size=samples)
    return pd.DataFrame({"t": t, "force": force}), pd.DataFrame({"position": y})


def main():
    """Diagnose and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=3_600_000)
    parser.add_argument("--jobs", type=int, default=2)
    said = parser.parse_args()
    X, y = record(said.samples)
    start = time.perf_counter()
    diagnosis = ModelDiagnosis(systems.cart_on_spring(), n_jobs=said.jobs).fit(X, y)
    seconds = time.perf_counter() - start
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    names = ", ".join(f"{cause.effect} ({cause.target})" for cause in diagnosis.causes_)
    print(f"{said.samples} samples: {seconds:.0f} s, {most:.1f} GB; {diagnosis.verdict_}: {names}")


if __name__ == "__main__":
    main()
