"""Validate what differs between records, and since when: hidden, and required to be found.

Sixty cases hide a group (one record of eight, two or three of six), thirty a trend from record to
record, sixty an onset within one record or in all, thirty a growth from an onset on, thirty a
parameter that depends on a condition, and sixty nothing. Run
``python benchmarks/validation/between_records.py [--jobs 2]`` for these, ``--development`` for
others to work with, and ``--only group onset`` and ``--count 20`` for some of them, drawn at
random. A run that was stopped goes on from its file of JSON lines.
"""

import argparse
import random
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from cases import DEVELOPMENT, FROZEN, course, seed_of
from machines import MACHINES
from resumed import resumed

from sklearn_pgnn import ModelDiagnosis, datasets
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.physics.effects import ParameterSlope
from sklearn_pgnn.physics.effects.differences import (
    DIFFERENCES,
    IN,
    TREND,
    ParameterDifference,
    mark_at,
    parsed,
)
from sklearn_pgnn.physics.effects.targets import pair, parts

#: number of cases of every kind
COUNTS = {"group": 60, "trend": 30, "onset": 60, "condition": 30, "nothing": 60, "growth": 30}
#: records of a group, and of all
GROUPS = ((2, 6), (3, 6), (1, 8))
#: smallest and largest difference as a share of the quantity, and least change of an output that
#: it causes, in units of the noise
SMALLEST, LARGEST, SHOWN = 0.05, 0.5, 3.0
#: what the column is called while the truth is simulated, and the condition
HIDDEN, CONDITION = f"{IN}truth", "load"
#: error of a sudden onset as a share of the record's length; that of growth is in its interval
ONSET = 0.03


class Case(NamedTuple):
    """A case: what is hidden, in which machine, and its number."""

    kind: str
    machine: str
    number: int
    root: int

    @property
    def seed(self) -> int:
        """The seed of everything that is drawn."""
        return seed_of(self.root, ("between records", *self[:3]))


@dataclass(frozen=True)
class Made:
    """Records, the model that is given, and what is hidden: a quantity and where it differs."""

    X: pd.DataFrame
    y: pd.DataFrame
    prior: object
    quantity: str = ""
    records: tuple[str, ...] = ()
    onset: float | None = None


@dataclass(frozen=True)
class Outcome:
    """What was hidden and said, and whether it, and nothing else, is right."""

    kind: str
    machine: str
    number: int
    root: int
    hidden: str
    said: str
    right: bool
    verdict: str
    seconds: float

    @property
    def case(self) -> Case:
        """The case that it is of."""
        return Case(self.kind, self.machine, self.number, self.root)


def all_cases(root: int) -> list[Case]:
    """List all cases, the machines in turn."""
    names = list(MACHINES)
    return [Case(k, names[i % len(names)], i, root) for k, n in COUNTS.items() for i in range(n)]


def make(case: Case) -> Made:
    """Draw a difference that the outputs show, and simulate the records with it."""
    rng = np.random.default_rng(case.seed)
    picked, n_records = GROUPS[rng.integers(len(GROUPS))] if case.kind == "group" else (0, 6)
    machine = MACHINES[case.machine]
    options = {**machine.options, "n_records": n_records, "noise": 0.0}
    hidden = datasets.make_hidden_effect(machine.model, None, **options, random_state=case.seed)
    if case.kind == "nothing":
        return Made(
            hidden.X, hidden.y + machine.noise * rng.normal(size=hidden.y.shape), hidden.prior
        )
    t, u, x0 = course(machine.model, hidden)
    while True:
        column, of, onset = _column(case.kind, t, n_records, picked, rng)
        effect, truth = _truth(case.kind, machine.model, hidden, rng)
        with np.errstate(all="ignore"):
            _, y = integrate(truth, t, np.concatenate([u, column[..., None]], axis=2), x0)
        change = y.reshape(hidden.y.shape) - hidden.y.to_numpy()
        if np.isfinite(y).all() and np.std(change, axis=0).max() > SHOWN * machine.noise:
            break
    names = [str(name) for name in dict.fromkeys(hidden.X["trajectory"])]
    quantity = f"{effect.id} of {parts(effect.target)[0]}"
    X, prior = hidden.X, hidden.prior
    if case.kind == "condition":
        X = X.assign(**{CONDITION: column.ravel()})
        prior = prior.replace(inputs={**prior.inputs, CONDITION: ""})
    noise = machine.noise * rng.normal(size=hidden.y.shape)
    return Made(X, hidden.y + change + noise, prior, quantity, tuple(names[r] for r in of), onset)


def _column(kind, t, n_records, picked, rng):
    """Return the hidden column of every record, the records of a group, and the onset."""
    column = np.zeros((n_records, t.size))
    if kind == "group":
        of = np.sort(rng.choice(n_records, picked, replace=False))
        column[of] = 1.0
        return column, of, None
    if kind == "trend":
        return column + np.arange(n_records)[:, None] / (n_records - 1), range(n_records), None
    if kind == "condition":
        return column + rng.permutation(np.linspace(0.0, 2.0, n_records))[:, None], (), None
    of = range(n_records) if rng.uniform() < 0.3 else [int(rng.integers(n_records))]
    onset = float(t[0] + rng.uniform(0.1, 0.5) * (t[-1] - t[0]))
    column[of] = mark_at(t, onset, t[-1] if kind == "growth" else None)
    return column, of, onset


def _truth(kind, model, hidden, rng):
    """Draw what differs and by how much; return the effect and the machine with it."""
    size = rng.choice([-1.0, 1.0]) * rng.uniform(SMALLEST, LARGEST)
    if kind == "condition":
        wider = model.replace(inputs={**model.inputs, CONDITION: ""})
        effect = ParameterSlope(pair(rng.choice(model.free_parameters), CONDITION), slope=size / 2)
        return effect, wider + effect
    wanted = [(each, name) for each in DIFFERENCES for name in each.quantities_of(model)]
    each, name = wanted[rng.integers(len(wanted))]
    scale = 1.0
    if each is ParameterDifference:
        scale = model.parameters[name].value
    elif name in model.outputs and each.id == "sensor_bias_difference":
        scale = float(np.std(hidden.y[name]))
    (field,) = each(pair(name, HIDDEN)).names()
    effect = each(pair(name, HIDDEN), **{field: size * scale})
    return effect, model.replace(inputs={**model.inputs, HIDDEN: ""}) + effect


def run(case: Case) -> Outcome:
    """Diagnose a case."""
    made, begun = make(case), time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        diagnosis = ModelDiagnosis(made.prior).fit(made.X, made.y)
    causes = diagnosis.causes_
    right = not causes and diagnosis.verdict_ == "model_adequate"
    if made.quantity:
        right = len(causes) == 1 and _is_it(case, made, diagnosis, causes[0])
    where = " ".join(made.records) + (f" since {made.onset:.4g}" if made.onset else "")
    said = "; ".join(f"{cause.effect} of {cause.target}" for cause in causes)
    seconds = time.perf_counter() - begun
    hidden = f"{made.quantity} {where}".strip()
    return Outcome(*case, hidden, said, bool(right), diagnosis.verdict_, seconds)


def _is_it(case, made, diagnosis, cause) -> bool:
    """Return whether a cause, or one that it may be confused with, is what was hidden."""
    near = [(cause.effect, cause.target), *((o.effect, o.target) for o in cause.confused_with)]
    named = next((t for e, t in near if f"{e} of {parts(t)[0]}" == made.quantity), None)
    if named is None:
        return False
    column = parts(named)[1]
    if case.kind in ("condition", "trend"):
        return column == {"condition": CONDITION, "trend": TREND}[case.kind]
    _, since, until = parsed(column)
    if sorted(map(str, diagnosis.groups_.get(column, ()))) != sorted(made.records):
        return False
    if made.onset is None:
        return since is None
    if case.kind == "growth":
        return until is not None and cause.onset.low <= made.onset <= cause.onset.high
    record = made.X["trajectory"].astype(str) == made.records[0]
    length = float(np.ptp(made.X["t"][record]))
    is_sudden = since is not None and until is None
    return is_sudden and abs(cause.onset.value - made.onset) < ONSET * length


def main():
    """Diagnose and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--development", action="store_true")
    parser.add_argument("--root", type=int, default=FROZEN, help="of the seeds of the cases")
    parser.add_argument("--only", nargs="+", choices=COUNTS, default=list(COUNTS))
    parser.add_argument("--count", type=int)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--results", type=Path, default=Path("between_records.jsonl"))
    said = parser.parse_args()
    cases = [
        c for c in all_cases(DEVELOPMENT if said.development else said.root) if c.kind in said.only
    ]
    random.Random(0).shuffle(cases)
    cases = cases[: said.count]
    outcomes = resumed(said.results, Outcome, cases, run, said.jobs)
    for kind in said.only:
        of = [outcome for outcome in outcomes if outcome.kind == kind]
        print(kind, f"right: {sum(o.right for o in of)} of {len(of)}")


if __name__ == "__main__":
    main()
