"""Public benchmarks by the recipe: `GreyBoxRegressor`, with its defaults, on every machine.

Only the training records and the usual prior go in. The recipe diagnoses the prior, fits what was
named in free run over whole trajectories, trains networks on the rest, and chooses its depth by
cross-validation over blocks of time and ranges of operation of the training records. Every test
record starts from the state that fits its official initial window, which does not count. Two more
lines compare: the fitted prior, and the recipe with an ensemble of networks in the place of one.

The tables are written to ``docs/tables/public.rst``. Run:
``python benchmarks/public.py [--data FOLDER] [--machines EMPS ...] [--jobs 2]``.
"""

import argparse
import datetime
import warnings
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import sklearn_pgnn
from sklearn_pgnn import EnsembleRegressor, GreyBoxRegressor, PGNNLRegressor, datasets

TABLE = Path(__file__).parents[1] / "docs" / "tables" / "public.rst"


@dataclass(frozen=True)
class Machine:
    """A benchmark: its loader, what others published, and how it is shown.

    It is trained on every so many-th sample of the first `most` ones, to save time.
    """

    load: object
    unit: str
    factor: float
    published: tuple
    every: int = 1
    most: int | None = None


MACHINES = {
    "EMPS": Machine(
        datasets.load_emps,
        "mm",
        1e3,
        (
            ("dynoNet [1]_", (2.64,)),
            ("CT SUBNET [2]_", (4.61,)),
            ("linear state space [3]_", (5.53,)),
            ("LSTM [3]_", (74.0,)),
            ("GRU [3]_", (220.0,)),
        ),
        every=5,
    ),
    "cascaded tanks": Machine(
        datasets.load_cascaded_tanks,
        "V",
        1.0,
        (
            ("grey box with overflow [4]_", (0.191,)),
            ("CT SUBNET [2]_", (0.306,)),
            ("GRU [3]_", (0.396,)),
            ("linear state space [3]_", (0.588,)),
        ),
    ),
    "coupled drives": Machine(
        datasets.load_coupled_drives,
        "1/s",
        1.0,
        (
            ("CT SUBNET [2]_", (0.115, 0.074)),
            ("pNARX [3]_", (0.100, 0.141)),
            ("linear state space [3]_", (0.224, 0.384)),
        ),
    ),
    "silverbox": Machine(
        datasets.load_silverbox,
        "mV",
        1e3,
        (
            ("GP NARX [3]_", (0.301, 0.60, 0.259)),
            ("polynomial state space [5]_", (None, 0.26, None)),
            ("pNARX [3]_", (0.640, 2.25, 0.571)),
            ("GRU [3]_", (1.49, 2.80, 0.947)),
            ("linear state space [3]_", (6.96, 14.4, 6.58)),
        ),
        most=20_000,
    ),
}


def thinned(data, every, most=None):
    """Return every so many-th training sample; what the inputs give in between is averaged."""
    X, y, inputs = data.X_train[:most], data.y_train[:most], list(data.prior.inputs)
    kept = X.groupby("trajectory", sort=False).cumcount() % every == 0
    mean = X[inputs].groupby(kept.cumsum()).transform("mean")
    return X.assign(**mean)[kept].reset_index(drop=True), y[kept].to_numpy()


def errors_by_trajectory(data, found) -> list[float]:
    """Return the error of every test trajectory, the initial window left out."""
    rest = found.reshape(-1) - data.y_test.to_numpy()[:, 0]
    names = data.X_test["trajectory"]
    counts = data.X_test.groupby("trajectory", sort=False).cumcount() >= data.initial_window
    return [float(np.sqrt(np.mean(rest[(names == n) & counts] ** 2))) for n in names.unique()]


def measure(machine, folder, jobs) -> list[list[str]]:
    """Return the lines of the table: the prior alone, the recipe, and the recipe with an ensemble.

    The last two share the diagnosis and the physical depths.
    """
    data = machine.load(data_home=folder)
    X, y = thinned(data, machine.every, machine.most)
    lines = []
    with TemporaryDirectory() as memory:
        common = {"initial_window": data.initial_window, "n_jobs": jobs, "verbose": 1}
        several = EnsembleRegressor(PGNNLRegressor(data.prior))
        for label, grey_box in {
            "prior, fitted": GreyBoxRegressor(data.prior, depths=("fitted",), **common),
            "recipe": GreyBoxRegressor(data.prior, memory=memory, **common),
            "recipe, ensemble of five": GreyBoxRegressor(
                data.prior, network=several, memory=memory, **common
            ),
        }.items():
            grey_box.fit(X, y)
            test = errors_by_trajectory(data, grey_box.predict_from(data.X_test, data.y_test))
            said = label if grey_box.depths else f"{label}, {described(grey_box)}"
            hidden = machine.factor * grey_box.errors_[grey_box.depth_] * float(np.std(y))
            lines.append([f"sklearn_pgnn: {said}", numbers(machine.factor, test), f"{hidden:.3g}"])
            print(" ", *lines[-1], grey_box.errors_, grey_box.parameters_, flush=True)
    return lines + [[who, numbers(1.0, errors), ""] for who, errors in machine.published]


def described(grey_box) -> str:
    """Return the depth that was chosen, and the causes that were named."""
    named = ", ".join(f"{c.effect} of {c.target}" for c in grey_box.diagnosis_.causes_)
    return f"depth {grey_box.depth_} (named: {named or 'nothing'})"


def numbers(factor, errors) -> str:
    """Write the errors of the trajectories."""
    return " / ".join("–" if error is None else f"{factor * error:.3g}" for error in errors)


def write(name, lines):
    """Write a machine's table into the documentation, beside those of the others."""
    modules = ("numpy", "scipy", "numba", "scikit-learn")
    versions = ", ".join(f"{module} {version(module)}" for module in modules)
    start = f".. list-table:: {name} [{MACHINES[name].unit}], "
    table = (
        f"{start}free-run RMSE. Written by ``python benchmarks/public.py`` on "
        f"{datetime.date.today()} with sklearn_pgnn {sklearn_pgnn.__version__}, {versions}.\n"
        f"   :header-rows: 1\n   :widths: 60 20 20\n\n"
    )
    for line in [["model", "test", "hidden parts of training"], *lines]:
        table += "   * - " + "\n     - ".join(line).rstrip() + "\n"
    old = TABLE.read_text(encoding="utf-8").split("\n\n.. ") if TABLE.exists() else []
    tables = {
        name: ".. " + text.removeprefix(".. ").strip()
        for text in old
        for name in MACHINES
        if f"list-table:: {name} " in text
    }
    tables[name] = table.strip()
    text = "\n\n".join(tables[name] for name in MACHINES if name in tables)
    TABLE.write_text(text + "\n", encoding="utf-8")


def main():
    """Measure the machines that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", help="folder of the benchmarks' own files; else downloaded")
    parser.add_argument("--machines", nargs="*", default=list(MACHINES), choices=list(MACHINES))
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    for name in arguments.machines:
        print(name, flush=True)
        write(name, measure(MACHINES[name], arguments.data, arguments.jobs))


if __name__ == "__main__":
    main()
