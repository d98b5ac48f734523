"""Public benchmarks: the usual prior, extended by the effects that cross-validation chooses.

The same pipeline for all three machines, built on their training records alone:

1. The prior's parameters and the initial states are fitted to whole trajectories in free run by
   ``PhysicsModelRegressor(window_length="trajectory")``.
2. Of the effects that one would suspect in such a machine, the one is added that lowers the
   cross-validated free-run error most, as long as it lowers it by 1 %. In each of three folds
   another quarter of every training trajectory, but never the first, is hidden from the fit; the
   error is the geometric mean over folds and trajectories, so that none of them decides alone.
3. The chosen model is fitted to the whole training records. Every extension starts from the values
   that the smaller model was fitted to, in the folds from those of the same fold.

The test records are then simulated once, in free run, and the initial windows do not count. EMPS
starts from the state that fits its initial window, in training too; the tanks start from the state
in which the training record did (the benchmark says it is the same); the drives go on from the end
of training.

The tables are written to ``docs/tables/public.rst``. Run:
``python benchmarks/public.py [--data FOLDER] [--machines EMPS ...]``.
"""

import argparse
import datetime
import warnings
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import sympy

import sklearn_pgnn
from sklearn_pgnn import Effect, PhysicsModel, PhysicsModelRegressor, datasets
from sklearn_pgnn.physics.effect import quantity
from sklearn_pgnn.physics.effects import (
    ActuatorLag,
    CoulombFriction,
    Formula,
    InputBias,
    InputDelay,
    SensorRectification,
    StateLimit,
    StribeckFriction,
)
from sklearn_pgnn.physics.expressions import symbol

TABLE = Path(__file__).parents[1] / "docs" / "tables" / "public.rst"
QUARTERS, LEAST_GAIN, SUBSTEPS = 4, 0.01, 2


@dataclass(frozen=True)
class Spill(Effect):
    """An upper tank that spills above a limit, of which a share falls into the lower tank."""

    limit: float = quantity("Ls", "V", default=1e9, low=1.0, role="end")
    share: float = quantity("ss", "", default=0.0, low=0.0, high=5.0, role="shape")
    id = "spill"

    @classmethod
    def targets(cls, model):
        """Name the upper tank."""
        return ("x1",)

    def rewrite(self, model, p):
        """Let what is above the limit go, half of it in a second."""
        spilt = sympy.Max(symbol(self.target) - p["limit"], 0) / 2
        rates = dict(model.equations)
        rates[self.target] -= spilt
        rates["x2"] += p["share"] * spilt
        return {"equations": rates}

    @classmethod
    def starts(cls, target, model, scales):
        """Return no start: the formula is not a candidate of a diagnosis."""
        return ()


@dataclass(frozen=True)
class Machine:
    """A benchmark: its loader, suspects in the order in which they apply, and how a test starts.

    It is trained on every so many-th sample, to save time.
    """

    load: object
    unit: str
    factor: float
    suspects: dict
    start: str
    published: tuple
    every: int = 1


MACHINES = {
    "EMPS": Machine(
        datasets.load_emps,
        "mm",
        1e3,
        {
            "viscous friction by direction": (Formula("force", ("abs(v)",), (0.0,)),),
            "input lag": (ActuatorLag("force", 0.002),),
            "input bias": (InputBias("force"),),
            "dry friction": (CoulombFriction("v", 20.0),),
            "Stribeck friction": (StribeckFriction("v", 10.0, 10.0, 0.02),),
            "curved friction": (Formula("v", ("v*abs(v)", "v**3"), (0.0, 0.0)),),
        },
        "window",
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
        {
            "pump lag": (ActuatorLag("pump", 4.0),),
            "pump bias": (InputBias("pump"),),
            "outflows not by the root": (
                Formula("x1", ("x1",), (0.0,)),
                Formula("x2", ("x2",), (0.0,)),
            ),
            "upper tank spills": (Spill("x1", 9.5, 0.5),),
            "lower tank spills": (StateLimit("x2", 10.0, 0.25),),
        },
        "training",
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
        {
            "sensor sees the magnitude": (SensorRectification("pulses"),),
            "sensor is curved": (Formula("pulses", ("speed**2", "abs(speed)**3"), (0.0, 0.0)),),
            "input lag": (ActuatorLag("voltage", 0.02),),
            "input delay": (InputDelay("voltage", 0.02),),
            "input bias": (InputBias("voltage"),),
            "dry friction": (CoulombFriction("drive", 1.0),),
        },
        "goes on",
        (
            ("CT SUBNET [2]_", (0.115, 0.074)),
            ("pNARX [3]_", (0.100, 0.141)),
            ("linear state space [3]_", (0.224, 0.384)),
        ),
    ),
}
#: rates that only have to be fast: the records do not show them
HELD = ("cL_x2",)


def extended(machine, data, chosen) -> PhysicsModel:
    """Add suspects to the prior, in the order in which they apply."""
    model = data.prior
    for name, parts in machine.suspects.items():
        for effect in parts if name in chosen else ():
            model = model + effect
    return model


def thinned(data, every):
    """Train on all samples of the initial windows, then on every so many-th.

    What the inputs give from one of them to the next is kept by averaging.
    """
    X, inputs = data.X_train, list(data.prior.inputs)
    place = X.groupby("trajectory", sort=False).cumcount()
    kept = (place < data.initial_window) | (place % every == 0)
    mean = X[inputs].groupby(kept.cumsum()).transform("mean")
    X, y = X.assign(**mean)[kept], data.y_train[kept]
    return replace(data, X_train=X.reset_index(drop=True), y_train=y.reset_index(drop=True))


def with_states(X, model, starts=None):
    """Return X with a column for every state, known in the first row of a trajectory at most."""
    X = X.assign(**dict.fromkeys(model.states, np.nan))
    if starts is not None:
        X.loc[~X["trajectory"].duplicated(), list(model.states)] = starts
    return X


def fit(model, X, y, starts=None, free=None):
    """Fit a model to whole trajectories, from given states if they are known."""
    free = [name for name in model.free_parameters if name not in HELD] if free is None else free
    regressor = PhysicsModelRegressor(
        model, free=free, search="local", window_length="trajectory", substeps=SUBSTEPS
    )
    return regressor.fit(with_states(X, model, starts), y)


def starts_in_window(model, X, y, samples):
    """Fit states, but no parameters, to the first samples; actuators start settled."""
    window = (X.groupby("trajectory").cumcount() < samples).to_numpy()
    followed = [model.settled.get(state) for state in model.states]
    known = [np.nan if name is None else X[name].iloc[0] for name in followed]
    return fit(model, X[window], y[window], [known], free=()).initial_states_


def learn(machine, data, model, y):
    """Fit a model to the training records; where the benchmark has it, from their windows."""
    if machine.start != "window":
        return fit(model, data.X_train, y)
    for _ in range(2):  # the states that fit the window depend on the parameters, a little
        starts = starts_in_window(model, data.X_train, y, data.initial_window)
        regressor = fit(model, data.X_train, y, starts)
        model = regressor.model_
    return regressor


def simulated(regressor, X, starts):
    """Simulate in free run from given states."""
    return np.ravel(regressor.predict(with_states(X, regressor.model_, starts)))


def rms(values):
    """Return the root mean square; infinite where a simulation failed."""
    return np.nan_to_num(np.sqrt(np.mean(values**2)), nan=np.inf)


def warm(model, parent) -> PhysicsModel:
    """Start from the values that a smaller model was fitted to."""
    known = parent.parameters.items() if parent is not None else ()
    return model.with_parameters(**{n: p.value for n, p in known if n in model.parameters})


def cross_validated(machine, model, data, parents):
    """Return the geometric mean of the errors on held-out quarters, and every fold's model."""
    X, y = data.X_train, data.y_train
    place = X.groupby("trajectory", sort=False).cumcount()
    size = X.groupby("trajectory", sort=False)["t"].transform("size")
    errors, models = [], []
    for quarter, parent in zip(range(1, QUARTERS), parents, strict=True):
        hidden = (place * QUARTERS // size == quarter).to_numpy()
        regressor = learn(machine, data, warm(model, parent), y.mask(hidden[:, None]))
        rest = simulated(regressor, X, regressor.initial_states_) - y.to_numpy()[:, 0]
        errors += [rms(rest[hidden & (X["trajectory"] == n)]) for n in X["trajectory"].unique()]
        models.append(regressor.model_)
    return float(np.exp(np.mean(np.log(errors)))), models


def choose(machine, data):
    """Add suspects one by one as long as the cross-validated error falls."""
    chosen, parents = (), (None,) * (QUARTERS - 1)
    best, parents = cross_validated(machine, data.prior, data, parents)
    print(f"  {best * machine.factor:.3f} prior", flush=True)
    while len(chosen) < len(machine.suspects):
        tried = {
            name: cross_validated(machine, extended(machine, data, (*chosen, name)), data, parents)
            for name in machine.suspects
            if name not in chosen
        }
        name = min(tried, key=lambda each: tried[each][0])
        print(" ", *(f"{v * machine.factor:.3f} {n};" for n, (v, _) in tried.items()), flush=True)
        if not tried[name][0] < (1 - LEAST_GAIN) * best:
            break
        chosen, (best, parents) = (*chosen, name), tried[name]
    return chosen


def learn_along(machine, data, chosen):
    """Fit the prior and, suspect by suspect, its extensions to the training records."""
    parent = None
    for count in range(len(chosen) + 1):
        model = warm(extended(machine, data, chosen[:count]), parent)
        regressor = learn(machine, data, model, data.y_train)
        parent = regressor.model_
    return regressor


def predict_test(machine, data, regressor):
    """Simulate the test records from their start, as the benchmark has it."""
    X, starts = data.X_test, regressor.initial_states_
    if machine.start == "goes on":
        whole = pd.concat([data.X_train, X], ignore_index=True)
        return simulated(regressor, whole, starts)[-len(X) :]
    if machine.start == "window":
        starts = starts_in_window(regressor.model_, X, data.y_test, data.initial_window)
    return simulated(regressor, X, starts)


def errors_by_trajectory(data, found) -> list[float]:
    """Return the error of every test trajectory, the initial window left out."""
    rest = found - data.y_test.to_numpy()[:, 0]
    counts = data.X_test.groupby("trajectory", sort=False).cumcount() >= data.initial_window
    names = data.X_test["trajectory"]
    return [float(rms(rest[(names == name) & counts])) for name in names.unique()]


def measure(machine, folder) -> list[list[str]]:
    """Run the pipeline on a machine; give the lines of its table."""
    data = thinned(machine.load(data_home=folder), machine.every)
    chosen = choose(machine, data)
    lines = []
    for label, names in (("prior", ()), ("prior + " + ", ".join(chosen), chosen)):
        regressor = learn_along(machine, data, names)
        train = simulated(regressor, data.X_train, regressor.initial_states_)
        train = rms(train - data.y_train.to_numpy()[:, 0]) * machine.factor
        test = errors_by_trajectory(data, predict_test(machine, data, regressor))
        lines.append([f"sklearn_pgnn: {label}", numbers(machine.factor, test), f"{train:.3g}"])
        values = {name: f"{found.value:.4g}" for name, found in regressor.parameters_.items()}
        print(" ", *lines[-1], values, flush=True)
    return lines + [[who, numbers(1.0, errors), ""] for who, errors in machine.published]


def numbers(factor, errors) -> str:
    """Write the errors of the trajectories."""
    return " / ".join(f"{factor * error:.3g}" for error in errors)


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
    for line in [["model", "test", "training"], *lines]:
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
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    for name in arguments.machines:
        print(name, flush=True)
        write(name, measure(MACHINES[name], arguments.data))


if __name__ == "__main__":
    main()
