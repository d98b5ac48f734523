"""Tables of what was measured over several seeds: medians and ranges, in the documentation."""

import argparse
import datetime
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

import sklearn_pgnn

TABLES = Path(__file__).parents[1] / "docs" / "tables"


def cell(numbers) -> str:
    """Write median and range."""
    return f"{np.median(numbers):.3g} ({min(numbers):.3g} to {max(numbers):.3g})"


def write_table(name: str, lines, seeds: int) -> None:
    """Write the table of a benchmark into the documentation, its heading first."""
    text = (
        f".. list-table:: Written by ``python benchmarks/{name}.py`` on "
        f"{datetime.date.today()} with sklearn_pgnn {sklearn_pgnn.__version__}; seeds 0 to "
        f"{seeds - 1}: median and range.\n   :header-rows: 1\n\n"
    )
    for line in lines:
        text += "   * - " + "\n     - ".join(line) + "\n"
    (TABLES / f"{name}.rst").write_text(text, encoding="utf-8")


def command_line(about: str, seeds: int) -> argparse.ArgumentParser:
    """Return the parser of a benchmark that is run over several seeds, so many by default."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seeds", type=int, default=seeds)
    parser.add_argument("--jobs", type=int, default=1)
    return parser


def run_seeds(asked, cases: Sequence[tuple], measure: Callable, write: Callable):
    """Measure all cases seed by seed, as the command line says, and write after every seed.

    Parameters
    ----------
    asked : argparse.Namespace
        What the command line asks for, see `command_line`.
    cases : sequence of tuple
        First arguments of `measure`.
    measure : callable
        ``measure(*case, seed)``.
    write : callable
        ``write(found, seeds)`` of the results by case, and the number of seeds so far.
    """
    found: dict[tuple, list] = {case: [] for case in cases}
    for seed in range(asked.seeds):
        results = Parallel(asked.jobs, return_as="generator")(
            delayed(measure)(*case, seed) for case in cases
        )
        for case, result in zip(cases, results, strict=True):
            found[case].append(result)
            print(seed, *case, result, flush=True)
        write(found, seed + 1)
