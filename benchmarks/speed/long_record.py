"""Diagnose an hour at 1 kHz: the time it takes, and the memory.

A cart on a spring with dry friction, 3.6 million samples in one record, which comes as a table, as
arrays that are memory maps of files, or as a Parquet file. Run:
``python benchmarks/speed/long_record.py [--samples 3600000] [--jobs 2] [--source table]``.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from measure import Row
from scipy.signal import lfilter

from sklearn_pgnn import ModelDiagnosis, effects, systems
from sklearn_pgnn.trajectories import read_files

STEP, FADES, FORCE, NOISE = 1e-3, 0.3, 10.0, 1e-3
#: an hour, the time [s] and the memory [GB] that it may take, and two lengths to compare
HOUR, LONGEST, MOST, GROWTH = 3_600_000, 120.0, 4.0, (50_000, 500_000)


def record(samples):
    """Return X and y of one record."""
    rng, keeps = np.random.default_rng(0), np.exp(-STEP / FADES)
    t = STEP * np.arange(samples)
    force = lfilter([FORCE * np.sqrt(1 - keeps**2)], [1, -keeps], rng.normal(size=samples))
    rig = systems.cart_on_spring() + effects.CoulombFriction("v", level=1.0)
    y = rig.simulate(t, force).y[:, 0] + NOISE * rng.normal(size=samples)
    return pd.DataFrame({"t": t, "force": force}), pd.DataFrame({"position": y})


def mapped(X, y, folder):
    """Write them to files; return what gives them as memory maps."""
    for name, table in (("X", X), ("y", y)):
        np.save(folder / f"{name}.npy", table.to_numpy())
    return lambda: [np.load(folder / f"{name}.npy", mmap_mode="r") for name in ("X", "y")]


def parquet(X, y, folder):
    """Write them to a Parquet file; return what reads it."""
    pd.concat([X, y], axis=1).to_parquet(folder / "record.parquet")
    return lambda: read_files([folder / "record.parquet"], systems.cart_on_spring())


def table(X, y, folder):
    """Return what gives them as they are."""
    return lambda: (X, y)


SOURCES = {"table": table, "memory-map": mapped, "parquet": parquet}


def measure(samples, jobs, source) -> tuple[float, float, ModelDiagnosis]:
    """Return the time of reading and diagnosing [s], the memory of it all [GB], and the result."""
    with tempfile.TemporaryDirectory() as folder:
        read = SOURCES[source](*record(samples), Path(folder))
        start = time.perf_counter()
        X, y = read()
        diagnosis = ModelDiagnosis(systems.cart_on_spring(), n_jobs=jobs).fit(X, y)
        seconds = time.perf_counter() - start
    return seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, diagnosis


def measured_apart(samples, source="table") -> tuple[float, float]:
    """Return time [s] and memory [GB] of a process of its own."""
    command = [sys.executable, __file__, "--samples", str(samples), "--source", source, "--plain"]
    said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    seconds, gigabytes = map(float, said.split())
    return seconds, gigabytes


def rows():
    """Yield the rows of the table of all that is meant to be fast."""
    for source in SOURCES:
        seconds, gigabytes = measured_apart(HOUR, source)
        work = f"an hour at 1 kHz, {source}, 2 cores"
        yield Row(work, seconds, f"{LONGEST:g} s", seconds / LONGEST, 1.0)
        work = f"its memory, {gigabytes:.1f} GB"
        yield Row(work, seconds, f"{MOST:g} GB", gigabytes / MOST, 1.0)
    few, many = (measured_apart(n)[0] / n for n in GROWTH)
    work = f"a long record, per sample of {GROWTH[1]}"
    yield Row(work, many * GROWTH[1], f"per sample of {GROWTH[0]}", many / few, 1.0)


def main():
    """Diagnose and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=HOUR)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--source", choices=SOURCES, default="table")
    parser.add_argument("--plain", action="store_true", help=argparse.SUPPRESS)
    said = parser.parse_args()
    seconds, gigabytes, diagnosis = measure(said.samples, said.jobs, said.source)
    if said.plain:
        print(seconds, gigabytes)
        return
    names = ", ".join(f"{cause.effect} ({cause.target})" for cause in diagnosis.causes_)
    found = f"{diagnosis.verdict_}: {names}"
    print(f"{said.samples} samples: {seconds:.0f} s, {gigabytes:.1f} GB; {found}")


if __name__ == "__main__":
    main()
