"""Measure everything that is meant to be fast, side by side in one run, and write the tables.

Run ``python benchmarks/speed``; with ``--only simulations networks ...`` some of it is printed and
nothing written. The peers need the extras ``control``, ``export``, ``network`` and ``sindy``, and
gcc.
"""

import argparse
import cProfile
import datetime
import os
import platform
import warnings
from pathlib import Path

import diagnoses
import long_record
import machines
import networks
import regressions
import simulations
from sklearn.model_selection import GridSearchCV

import sklearn_pgnn
from sklearn_pgnn import PGNNLRegressor, datasets, systems
from sklearn_pgnn.model_selection import TrajectoryKFold

TABLES = Path(__file__).parents[2] / "docs" / "tables"
PARTS = {
    part.__name__: part
    for part in (simulations, regressions, networks, diagnoses, machines, long_record)
}
HEAD = ["work", "takes [ms]", "against", "ratio", "bar", ""]


def main():
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", choices=PARTS)
    only = parser.parse_args().only
    rows = []
    for name in only or PARTS:
        for row in PARTS[name].rows():
            rows.append(row.cells)
            print(*row.cells, sep=" | ", flush=True)
    if not only:
        date, cores = datetime.date.today().isoformat(), os.cpu_count()
        said = (
            f"Written on {date} by sklearn-pgnn {sklearn_pgnn.__version__} on {cores} cores "
            f"({platform.machine()}) that other programs used, too; ratios are of the shortest "
            f"times of runs in turn."
        )
        if missing := machines.left_out():
            said += f" Left out: {', '.join(missing)}."
        write("speed.rst", [said, "", *table(HEAD, rows)])
        write("speed_profile.rst", table(["job", "function", "share of its time"], profiles()))


def profiles():
    """Return where the three main jobs spend their time."""
    warnings.simplefilter("ignore")
    X, y = datasets.make_golf_robot()
    network = PGNNLRegressor(systems.golf_robot(), max_epochs=20, rollout_epochs=5)
    search = GridSearchCV(network, {"lr": [0.01, 0.003]}, cv=TrajectoryKFold(2))
    jobs = {"training": lambda: network.fit(X, y), "tuning": lambda: search.fit(X, y)}
    found = {"diagnosis": diagnoses.profile(8)}
    for name, job in jobs.items():
        profiler = cProfile.Profile()
        profiler.runcall(job)
        found[name] = diagnoses.shares(profiler, 8)
    return [
        [job, f"``{function}``", f"{100 * share:.0f} %"]
        for job, functions in found.items()
        for function, share in functions
    ]


def table(head, rows) -> list[str]:
    """Return a table as lines of the documentation."""
    lines = [".. list-table::", "   :header-rows: 1", ""]
    for row in [head, *rows]:
        cells = [f"- {cell}".rstrip() for cell in row]
        lines += [f"   * {cells[0]}", *(f"     {cell}" for cell in cells[1:])]
    return lines


def write(name, lines) -> None:
    """Write a file of the documentation."""
    (TABLES / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
