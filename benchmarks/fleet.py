"""Diagnose a fleet of simulated machines that is killed three times, and see what it took.

Run with ``python benchmarks/fleet.py``, which takes some ten minutes on two cores, or with
``--machines 30`` for a smaller fleet, ``--samples 600`` for shorter records, ``--catalogue`` for
some effects only. Every machine is a golf robot of its own, with parameters up to 3 % off and, half
of them, with something that the model lacks, on two records of 2 500 samples at 250 Hz. The run is
killed with all its processes (SIGKILL) when a quarter, a half and three quarters of the machines
are finished. It says whether all machines are finished in the end, how many were computed twice,
and how long 1 000 machines would take.
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from sklearn_pgnn import FleetDiagnosis, datasets, systems
from sklearn_pgnn.datasets.hidden_effect import perturb

KILLS = (0.25, 0.5, 0.75)
#: samples a second
RATE = 250.0
HIDDEN = (
    None,
    "coulomb_friction",
    None,
    "input_bias",
    None,
    "stribeck_friction",
    None,
    "viscous_friction",
)


def write_records(folder: Path, machines: int, samples: int) -> None:
    """Write the two records of every machine as a CSV file."""
    folder.mkdir()
    for k in range(machines):
        rng = np.random.RandomState(k)
        robot = perturb(systems.golf_robot(), 0.03, rng)
        made = datasets.make_hidden_effect(
            robot,
            HIDDEN[k % len(HIDDEN)],
            n_records=2,
            duration=samples / 2 / RATE,
            sample_rate=RATE,
            random_state=rng,
        )
        known = made.X[["trajectory", "t", *robot.inputs]]
        known.join(made.y).to_csv(folder / f"robot_{k:04d}.csv", index=False)


def diagnose(records: Path, folder: Path, effects: list[str]) -> FleetDiagnosis:
    """Diagnose the fleet, or go on with it."""
    files = {path.stem: path for path in sorted(records.glob("*.csv"))}
    options = {"catalogue": effects} if effects else {}
    fleet = FleetDiagnosis(systems.golf_robot(), options=options, folder=folder, n_jobs=-1)
    return fleet.fit(files)


def finished(folder: Path) -> dict[str, int]:
    """Return when every finished machine was written [ns]."""
    return {
        path.parent.name: path.stat().st_mtime_ns
        for path in folder.glob("machines/*/finished.json")
    }


def run_and_kill(records: Path, folder: Path, effects: list[str], count: int | None) -> float:
    """Run in a process of its own until some machines are finished, or all; return the time [s]."""
    began = time.monotonic()
    command = [sys.executable, __file__, "--child", str(records), str(folder)]
    command += ["--catalogue", *effects]
    child = subprocess.Popen(command, start_new_session=True)
    while child.poll() is None:
        time.sleep(0.2)
        if count is not None and len(finished(folder)) >= count:
            os.killpg(child.pid, signal.SIGKILL)
            child.wait()
    return time.monotonic() - began


def main(machines: int, samples: int, effects: list[str]) -> None:
    """Write the records, run and kill, and print what it took."""
    with TemporaryDirectory() as place:
        records, folder = Path(place, "records"), Path(place, "fleet")
        write_records(records, machines, samples)
        seconds, twice, before = 0.0, 0, {}
        for share in (*KILLS, None):
            seconds += run_and_kill(records, folder, effects, share and round(share * machines))
            now = finished(folder)
            twice += sum(now[name] != written for name, written in before.items())
            print(f"finished {len(now)} of {machines}, after {seconds:.0f} s", flush=True)
            before = now
        whole = diagnose(records, folder, effects)
    spent = [machine.seconds for machine in whole.machines_.values()]
    each = sum(spent) / len(spent)
    print(f"computed twice: {twice}; left to compute: {len(whole.computed_)}")
    print(f"processor time a machine: {each:.1f} s, at most {max(spent):.1f} s")
    print(f"1 000 machines on two cores: {1000 * each / 2 / 60:.0f} min of computing (goal 60)")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=200)
    parser.add_argument("--samples", type=int, default=5000, help="of a machine, in both records")
    parser.add_argument("--child", nargs=2, type=Path)
    parser.add_argument("--catalogue", nargs="*", default=[], help="the only effects looked for")
    given = parser.parse_args()
    if given.child:
        diagnose(*given.child, given.catalogue)
    else:
        main(given.machines, given.samples, given.catalogue)
