"""How often `identifiability` is right about what records can tell.

Random machines, of random values, are driven well or hardly, sampled fast or too slowly, with
little noise or much; some of their parameters are collinear. The model has values that are off by
some 30 %. The verdicts on one set of records are compared with the intervals that a fit gets from
another set, with new noise; and the truth with the intervals. In a second set of records all
outputs come late, or early. Run: ``python benchmarks/identifiability.py [--cases 200]``; it prints
a line per case and, at the end, the table.
"""

import argparse
import time
import warnings
from dataclasses import dataclass

import numpy as np
import pandas as pd

from sklearn_pgnn import Parameter, PhysicsModel, PhysicsModelRegressor
from sklearn_pgnn.inspection import identifiability
from sklearn_pgnn.record_quality.identifiability import TOLD, WEAK

#: integration steps per sample, and the samples before a record over which its start settles
STEPS, BEFORE = 20, 200
#: factor from the usual value of a parameter to its bounds
WIDE = 100.0


@dataclass(frozen=True)
class Machine:
    """A machine, its time scale [s], and the input about which, and by which, it is driven."""

    model: PhysicsModel
    time: float
    offset: float = 0.0
    amplitude: float = 1.0


def _model(states, equations, parameters, outputs, unit="V"):
    return PhysicsModel(
        states, equations, parameters, {"u": unit}, outputs=dict(zip("yz", outputs, strict=False))
    )


MOTOR = {"i": "(u - R*i - K*w)/L", "w": "(K*i - d*w)/J"}, {
    "L": 2e-3, "R": 1.0, "K": 0.05, "J": 1e-4, "d": 2e-5
}  # fmt: skip
MACHINES = {
    "mass": Machine(
        _model(
            {"x": "m", "v": "m/s"}, {"x": "v", "v": "(u - d*v - k*x)/m"},
            {"m": 1.0, "d": 0.6, "k": 4.0}, ["x"], "N",
        ),
        0.5, 0.0, 6.0,
    ),
    "bodies": Machine(
        _model(
            {"A": "K", "B": "K"}, {"A": "(u - G*(A - B))/C1", "B": "(G*(A - B) - G2*B)/C2"},
            {"C1": 400.0, "C2": 900.0, "G": 6.0, "G2": 2.0}, ["A", "B"], "W",
        ),
        60.0, 300.0, 300.0,
    ),
    "motor": Machine(_model({"i": "A", "w": "rad/s"}, *MOTOR, ["w"]), 0.02, 0.0, 6.0),
    "motor with current": Machine(
        _model({"i": "A", "w": "rad/s"}, *MOTOR, ["w", "i"]), 0.02, 0.0, 6.0
    ),
    "gains": Machine(
        _model({"x": "V"}, {"x": "(K*L*u - x)/T"}, {"K": 2.0, "L": 3.0, "T": 0.4}, ["x"]), 0.4
    ),
    "tank": Machine(
        _model(
            {"h": "m"}, {"h": "(u - c*sqrt(max(h, 1e-4)))/A"}, {"A": 0.5, "c": 0.2}, ["h"], "m^3/s"
        ),
        2.0, 0.2, 0.08,
    ),
    "pendulum": Machine(
        _model(
            {"p": "rad", "w": "rad/s"}, {"p": "w", "w": "(u - 9.81*m*a*sin(p) - d*w)/J"},
            {"m": 1.0, "a": 0.3, "d": 0.15, "J": 0.12}, ["p"], "N m",
        ),
        0.2, 0.0, 1.5,
    ),
    "two lags": Machine(
        _model(
            {"a": "V", "b": "V"}, {"a": "(K*u - a)/T1", "b": "(a - b)/T2"},
            {"K": 2.0, "T1": 0.1, "T2": 1.0}, ["b"],
        ),
        0.5,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A machine with its true values, the model that is had of it, and how it is recorded."""

    name: str
    truth: PhysicsModel
    model: PhysicsModel
    step: float
    inputs: np.ndarray
    noise: float

    def records(self, seed: int, lag: float = 0.0):
        """Return X and y; the outputs come late by so many samples."""
        random, X, y = np.random.default_rng(seed), [], []
        for number, u in enumerate(self.inputs):
            t = self.step * np.arange(len(u))
            commanded = np.repeat(np.concatenate([np.full(BEFORE, u[0]), u]), STEPS)
            fine = self.step / STEPS * (np.arange(len(commanded)) - BEFORE * STEPS)
            run = self.truth.simulate(fine, commanded).y
            seen = np.column_stack([np.interp(t - lag * self.step, fine, c) for c in run.T])
            X.append(pd.DataFrame({"trajectory": number, "t": t, "u": u}))
            y.append(seen)
        clean = np.concatenate(y)
        noisy = clean + self.noise * clean.std(axis=0) * random.normal(size=clean.shape)
        table = pd.DataFrame(noisy, columns=list(self.truth.outputs))
        return pd.concat(X, ignore_index=True), table


def wave(kind: str, count: int, random) -> np.ndarray:
    """Return an excitation within -1 and 1."""
    share = np.arange(count) / count
    if kind == "levels":
        hold = int(random.integers(5, 40))
        return np.repeat(random.uniform(-1, 1, count // hold + 1), hold)[:count]
    if kind == "sine":
        return np.sin(2 * np.pi * random.uniform(1, count / 30) * share)
    if kind == "slow":
        return np.sin(np.pi * random.uniform(0.3, 2) * share)
    cycles = np.geomspace(1, count / 10, 12)[:, None]
    sines = np.sin(2 * np.pi * (cycles * share + random.uniform(size=(12, 1)))).sum(axis=0)
    return sines / np.abs(sines).max()


def draw(number: int) -> Case:
    """Draw a case."""
    random = np.random.default_rng([61, number])
    name = list(MACHINES)[number % len(MACHINES)]
    machine = MACHINES[name]
    given = {key: p.value for key, p in machine.model.parameters.items()}
    true = {key: value * np.exp(0.2 * random.normal()) for key, value in given.items()}
    bounds = {key: (value / WIDE, value * WIDE) for key, value in given.items()}
    off = {key: value * np.exp(0.3 * random.uniform(-1, 1)) for key, value in true.items()}
    count = int(10 ** random.uniform(2.2, 2.9))
    kinds = random.choice(["levels", "sine", "slow", "sines"], size=random.integers(1, 4))
    size = machine.amplitude * 10 ** random.uniform(-1, 0)
    inputs = np.array([machine.offset + size * wave(kind, count, random) for kind in kinds])
    return Case(
        name,
        machine.model.with_parameters(**true),
        machine.model.replace(
            parameters=[Parameter(k, v, bounds=bounds[k]) for k, v in off.items()]
        ),
        machine.time * 10 ** random.uniform(-1.7, 0.3),
        inputs,
        10 ** random.uniform(-3, -0.7),
    )


def obtained(case: Case, seed: int, *, quick: bool) -> dict:
    """Return the estimates from new records, by a fit or by a check, which is quicker."""
    X, y = case.records(seed)
    if quick:
        return {each.name: each.estimate for each in identifiability(case.model, X, y).parameters}
    return PhysicsModelRegressor(case.model, search="local").fit(X, y).parameters_


def measure(number: int, *, quick: bool = False) -> tuple[list[dict], list[dict]]:
    """Return a row for every parameter of a case, and one for every output's lag."""
    case = draw(number)
    begin = time.process_time()
    found = identifiability(case.model, *case.records(2 * number))
    seconds = time.process_time() - begin
    fitted = obtained(case, 2 * number + 1, quick=quick)
    rows = []
    for told in found.parameters:
        true = case.truth.parameters[told.name].value
        expected, got = told.estimate, fitted[told.name]
        size = abs(got.value) or abs(case.model.parameters[told.name].value)
        rows.append(
            {
                "case": number, "machine": case.name, "parameter": told.name,
                "verdict": told.verdict, "reason": told.reason, "expected": told.half_width,
                "obtained": (got.high - got.low) / 2 / size, "noise": found.times_noise,
                "holds": expected.low <= true <= expected.high,
                "fit_holds": got.low <= true <= got.high,
                "error": abs(expected.value / true - 1), "seconds": seconds,
            }
        )  # fmt: skip
    lag = float(np.random.default_rng([62, number]).uniform(-5, 5))
    late = {each.output: each for each in identifiability(
        case.model, *case.records(2 * number, lag)
    ).lags}  # fmt: skip
    false = {each.output for each in found.lags}
    lags = [
        {
            "case": number, "machine": case.name, "lag": lag, "false": output in false,
            "found": late[output].samples if output in late else np.nan,
            "reach": (late[output].high - late[output].low) / 2 / case.step
            if output in late else np.nan,
        }
        for output in case.truth.outputs
    ]  # fmt: skip
    return rows, lags


def summary(rows: pd.DataFrame, lags: pd.DataFrame) -> str:
    """Return the table."""
    said = []
    for verdict, mine in rows.groupby("verdict"):
        obtained = mine["obtained"]
        said.append(
            f"{verdict}: {len(mine)} parameters; obtained interval below 20 % in "
            f"{np.mean(obtained < TOLD):.1%}, from 20 to 100 % in "
            f"{np.mean((obtained >= TOLD) & (obtained <= WEAK)):.1%}, wider in "
            f"{np.mean(obtained > WEAK):.1%}; the truth lies in the expected interval in "
            f"{mine['holds'].mean():.1%}, in the fit's in {mine['fit_holds'].mean():.1%}; estimate "
            f"within 20 % of the truth in {np.mean(mine['error'] < TOLD):.1%}"
        )
    got = lags.dropna(subset="found")
    near = np.abs(got["found"] - got["lag"])
    said.append(
        f"lags: {len(got)} of {len(lags)} outputs told; within 0.2 samples "
        f"{np.mean(near < 0.2):.1%}, within the interval {np.mean(near <= got['reach']):.1%}; "
        f"told where there is none {lags['false'].mean():.1%}; seconds of a check: median "
        f"{rows['seconds'].median():.2g}, 95 % below {rows['seconds'].quantile(0.95):.2g}"
    )
    return "\n".join(said)


def main():
    """Go through the cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="take a check's intervals for a fit's")
    parser.add_argument("--table", help="a CSV file for the rows")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rows, lags = [], []
    for number in range(arguments.first, arguments.first + arguments.cases):
        more, late = measure(number, quick=arguments.quick)
        rows, lags = rows + more, lags + late
        told = ", ".join(f"{r['parameter']} {r['verdict']} {r['obtained']:.2g}" for r in more)
        print(number, more[0]["machine"], told, flush=True)
        if arguments.table:
            pd.DataFrame(rows).to_csv(arguments.table, index=False)
            pd.DataFrame(lags).to_csv(f"{arguments.table}.lags", index=False)
    print(summary(pd.DataFrame(rows), pd.DataFrame(lags)))


if __name__ == "__main__":
    main()
