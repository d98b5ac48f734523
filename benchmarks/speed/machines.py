"""Whole diagnoses of measured and simulated machines, and the demo, against the clock.

Files of measured records are looked for where the tests look for them; a row without its files is
left out, and `left_out` says so.
"""

import os
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from measure import Row
from scipy.signal import lfilter

from sklearn_pgnn import ModelDiagnosis, PhysicsModel
from sklearn_pgnn.trajectories import read_files

#: samples of the oscillator's record, and samples in a period of its free motion
SAMPLES, IN_A_PERIOD = 87_000, 8.5
#: longest that a search may take [s]: a bar that is missed by far is missed all the same
LIMIT = 300.0
#: a mass on a spring of 10 Hz, in the units of a bench
OSCILLATOR = PhysicsModel(
    name="oscillator",
    states={"x": "mm", "v": "mm/s"},
    equations={"x": "v", "v": "(F - d*v - k*x)/m"},
    parameters={"m": 1.0, "d": 6.0, "k": (20.0 * np.pi) ** 2},
    inputs={"F": "N"},
    outputs={"x": "x"},
    inertia={"v": "m"},
)
EMPS = PhysicsModel(
    name="EMPS",
    states={"q": "m", "v": "m/s"},
    inputs={"tau": "N"},
    outputs={"q_m": "q"},
    parameters={"M": {"value": 95, "unit": "kg"}, "Fv": {"value": 203, "unit": "N s/m"}},
    equations={"q": "v", "v": "(tau - Fv*v)/M"},
    inertia={"v": "M"},
    columns={"tau": "u_force_N"},
)


def emps_files() -> list[Path]:
    """Return the files of EMPS; none where one of them is not here."""
    beside = Path(__file__).resolve().parents[2] / "../shared/data"
    folder = Path(os.environ.get("SKLEARN_PGNN_DATA") or beside).resolve() / "emps"
    files = [folder / f"emps_{name}.csv" for name in ("train", "test")]
    return files if all(map(Path.is_file, files)) else []


def left_out() -> list[str]:
    """Return what cannot be measured here."""
    return [] if emps_files() else ["EMPS, whose files are not here"]


def hardening_record(samples=SAMPLES):
    """Return X and y of an oscillator whose spring hardens, driven by noise."""
    rng, step = np.random.default_rng(0), 0.1 / IN_A_PERIOD
    t = step * np.arange(samples)
    force = lfilter([0.5], [1.0, -0.5], 4e3 * rng.normal(size=samples))
    rig = OSCILLATOR.replace(equations={"x": "v", "v": "(F - d*v - k*x - 60*x**3)/m"})
    x = rig.simulate(t, force, substeps=8).y[:, 0]
    return np.column_stack([t, force]), x + 1e-3 * np.std(x) * rng.normal(size=samples)


def clock(work) -> float:
    """Return how long something takes [s]."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def diagnose(model, X, y):
    """Diagnose on as many threads as there are cores."""
    return ModelDiagnosis(model, n_jobs=-1, time_limit=LIMIT).fit(X, y)


def demo(kept: str) -> None:
    """Run the demo in a process of its own that keeps what it compiles in a folder."""
    told = {**os.environ, "NUMBA_CACHE_DIR": kept}
    told.pop("SKLEARN_PGNN_CACHE_DIR", None)
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-m",
            "sklearn_pgnn",
            "demo",
            "--output",
            folder,
            "--quiet",
            "--force",
        ]
        subprocess.run(command, env=told, check=True, stdout=subprocess.DEVNULL, timeout=600)


def rows():
    """Yield the rows."""
    warnings.simplefilter("ignore")
    if files := emps_files():
        X, y = read_files(files, EMPS)
        yield _row("diagnosis of both files of EMPS", clock(lambda: diagnose(EMPS, X, y)), 12)
    X, y = hardening_record()
    took = clock(lambda: diagnose(OSCILLATOR, X, y))
    work = f"diagnosis of {SAMPLES} samples of a hardening spring, {IN_A_PERIOD:g} a period"
    yield _row(work, took, 60)
    with tempfile.TemporaryDirectory() as kept:
        yield _row("demo with nothing compiled", clock(lambda: demo(kept)), 20)
        yield _row("the demo again", clock(lambda: demo(kept)), 8)


def _row(work: str, took: float, bar: float) -> Row:
    return Row(work, took, f"{bar:g} s", took / bar, 1.0)
