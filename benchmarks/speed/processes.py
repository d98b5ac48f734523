"""Independent diagnoses side by side, in one to four processes: the table of ``scaling``.

Every number of processes is measured by a command of its own, which is ended with all that it has
started where it takes longer than it may: a worker that waits for memory or for another one must
not hold up the table.
Run: ``python benchmarks/speed/processes.py [--cases 8] [--most 4] [--limit 100]``.
"""

import argparse
import datetime
import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import joblib

#: few candidates: with the whole catalogue a case would take several times as long
CATALOGUE = ("coulomb_friction", "cubic_stiffness", "input_bias", "quadratic_drag")
TABLE = Path(__file__).parents[2] / "docs" / "tables" / "processes.rst"


def diagnose(seed: int) -> str:
    """Diagnose a short record of a cart with dry friction."""
    from sklearn_pgnn import ModelDiagnosis, datasets, systems

    warnings.simplefilter("ignore")
    hidden = datasets.make_hidden_effect(
        systems.cart_on_spring(),
        "coulomb_friction",
        n_records=2,
        duration=4.0,
        sample_rate=100.0,
        random_state=seed,
    )
    return ModelDiagnosis(hidden.prior, catalogue=CATALOGUE).fit(hidden.X, hidden.y).verdict_


def measure(workers: int, cases: int) -> float:
    """Return how long the cases take [s], every process having diagnosed the first one before."""
    with joblib.Parallel(n_jobs=workers) as parallel:
        parallel(joblib.delayed(diagnose)(0) for _ in range(workers))
        start = time.perf_counter()
        parallel(joblib.delayed(diagnose)(seed) for seed in range(cases))
        return time.perf_counter() - start


def measured_apart(workers: int, cases: int, limit: float) -> float | None:
    """Return what `measure` does, in a process of its own; None where that takes too long.

    The limit counts from the command's start, so it is for importing and compiling, too.
    """
    command = [sys.executable, __file__, "--cases", str(cases), "--workers", str(workers)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        said, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        return None
    finally:
        if process.poll() is None:  # the workers are of its session
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    if process.returncode:
        raise SystemExit(f"{workers} processes: the command has failed, see above.")
    return float(said)


def main():
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--most", type=int, default=4)
    parser.add_argument("--limit", type=float, default=100.0, help="seconds for one number")
    parser.add_argument("--table", type=Path, default=TABLE)
    parser.add_argument("--workers", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.workers:
        print(measure(options.workers, options.cases))
        return
    rows = [["processes", "takes [s]", "times as fast as one"]]
    alone = None
    for workers in range(1, options.most + 1):
        took = measured_apart(workers, options.cases, options.limit)
        alone = took if workers == 1 else alone
        faster = f"{alone / took:.2f}" if alone and took else ""
        rows.append([str(workers), f"{took:.1f}" if took else "did not end", faster])
        print(*rows[-1], sep=" | ", flush=True)
    write(options, rows)


def write(options, rows) -> None:
    """Write the table."""
    said = (
        f"{options.cases} diagnoses of a cart, 800 samples and {len(CATALOGUE)} kinds of "
        f"effect each. Written on "
        f"{datetime.date.today().isoformat()} on {os.cpu_count()} cores that other programs used, "
        f"too; what takes longer than {options.limit:g} s is ended."
    )
    lines = [said, "", ".. list-table::", "   :header-rows: 1", ""]
    for row in rows:
        first, *others = (f"- {cell}".rstrip() for cell in row)
        lines += [f"   * {first}", *(f"     {cell}" for cell in others)]
    options.table.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
