"""What a diagnosis names where one effect is hidden, and where nothing is.

Every effect of the catalogue is hidden, one at a time, in the records of four machines of different
kinds, made by the integrator of `datasets`; the prior's parameters are up to 7 % off. An effect
counts as named if it alone is named, or is in the group that is said to be inseparable; as absorbed
if re-tuning the parameters within their spread already leaves only noise, so that nothing is left
to name; else as missed or, where another cause is named, as wrong. Hidden effects change the
outputs on short windows by 10 to 40 times the noise, or by a fifth of that at five times the noise.
Two tables are written: the counts to ``docs/tables/diagnosis.rst``, and what was said instead to
``docs/tables/diagnosis_confusion.rst``. Run:
``python benchmarks/diagnosis.py [--seeds 1] [--noise 1 5] [--jobs 2] [--systems golf ...]``.
"""

import argparse
import datetime
import warnings
from collections import Counter, defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed

import sklearn_pgnn
from sklearn_pgnn import ModelDiagnosis, PhysicsModel, datasets, effects, systems
from sklearn_pgnn.estimation.hypothesis import same_parameter

TABLES = Path(__file__).parent.parent / "docs" / "tables"
#: diagnoses of records in which nothing is hidden, for every system, noise and seed
NOTHING = 5
OUTCOMES = ("named", "absorbed", "missed", "wrong")


def motor() -> PhysicsModel:
    """Return a DC motor whose speed and current are measured."""
    return PhysicsModel(
        name="DC motor",
        states={"w": "rad/s", "i": "A"},
        inputs={"U": "V"},
        outputs={"speed": "w", "current": "i"},
        parameters={
            "J": {"value": 0.02, "unit": "kg m^2", "bounds": [1e-4, 1]},
            "d": {"value": 0.01, "unit": "N m s/rad", "bounds": [0, 1]},
            "K": {"value": 0.5, "unit": "N m/A", "bounds": [0.01, 10]},
            "R": {"value": 2.0, "unit": "Ohm", "bounds": [0.01, 100]},
            "L": {"value": 0.1, "unit": "H", "bounds": [1e-4, 10]},
        },
        equations={"w": "(K*i - d*w)/J", "i": "(U - R*i - K*w)/L"},
        inertia={"w": "J"},
    )


#: model, noise of the outputs and what else makes the records
SYSTEMS = {
    "golf": (systems.golf_robot, 1e-3, {"n_records": 6, "sample_rate": 125.0}),
    "cart": (systems.cart_on_spring, 1e-3, {"n_records": 6, "sample_rate": 200.0}),
    "tanks": (
        systems.two_tanks,
        1e-2,
        {
            "n_records": 4,
            "duration": 600.0,
            "sample_rate": 1.0,
            "excitation": ("multisine", "chirp"),
            "amplitude": 2.7,
        },
    ),
    "motor": (
        motor,
        1e-2,
        {"n_records": 6, "sample_rate": 200.0, "duration": 6.0, "amplitude": 10.0},
    ),
}


class Result(NamedTuple):
    """What came of one diagnosis; of how many of the effect's intervals the truth was inside."""

    system: str
    effect: str | None
    noise: float
    outcome: str
    said: str
    covered: int = 0
    intervals: int = 0


def diagnose(system, effect, noise, seed):
    """Hide an effect (or None) and say what came of it."""
    warnings.simplefilter("ignore")
    make, level, options = SYSTEMS[system]
    hidden = datasets.make_hidden_effect(make(), effect, noise=level, random_state=seed, **options)
    rng = np.random.default_rng(seed)
    y = hidden.y + level * np.sqrt(noise**2 - 1) * rng.standard_normal(hidden.y.shape)
    diagnosis = ModelDiagnosis(hidden.prior, n_jobs=1).fit(hidden.X, y)
    groups = named_groups(diagnosis)
    names = [f"{cause.effect} ({cause.target})" for cause in diagnosis.causes_]
    said = ", ".join(names) or diagnosis.verdict_
    inside = _inside(diagnosis, hidden.effect)
    outcome = _outcome(diagnosis, hidden, groups)
    return Result(system, effect, noise, outcome, said, sum(inside), len(inside))


def named_groups(diagnosis) -> list[set]:
    """Return every named cause with those that it is inseparable from."""
    causes = diagnosis.causes_
    return [{(c.effect, c.target), *map(tuple, c.confused_with)} for c in causes]


def as_named(model, effect) -> tuple[str, str]:
    """Return an effect's name, or the name of a free parameter that already is the effect."""
    parameter = same_parameter(model, effect)
    return (effect.id, effect.target) if parameter is None else ("wrong_parameter", parameter)


def _inside(diagnosis, effect) -> list[bool]:
    """Return whether the interval of each parameter is right, if the effect is the one named."""
    for cause in diagnosis.causes_:
        if effect is not None and (cause.effect, cause.target) == (effect.id, effect.target):
            found = cause.parameters.items()
            return [bool(e.low <= getattr(effect, name) <= e.high) for name, e in found]
    return []


def _outcome(diagnosis, hidden, groups) -> str:
    if hidden.effect is None:
        return "wrong" if groups or diagnosis.verdict_ == "unexplained" else "named"
    if len(groups) == 1 and as_named(hidden.prior, hidden.effect) in groups[0]:
        return "named"
    if groups:
        return "wrong"
    return "absorbed" if diagnosis.verdict_ == "model_adequate" else "missed"


def write_counts(results, seeds):
    """Write how often every effect was named, of how many, by system and noise."""
    columns = sorted({(result.system, result.noise) for result in results})
    counts = defaultdict(Counter)
    for result in results:
        for row in {result.effect, "all effects" if result.effect else None}:
            counts[row, result.system, result.noise][result.outcome] += 1
    rows = []
    for effect in [*(kind.id for kind in effects.CATALOGUE), "all effects", None]:
        cells = [counts.get((effect, *column)) for column in columns]
        if any(cells):
            hidden = effect or "nothing (quiet / - / - / false alarm)"
            rows.append([hidden, *map(_cell, cells)])
    rows.append(["intervals with the truth inside", *(_coverage(results, c) for c in columns)])
    head = ["hidden", *(f"{system}, {noise:g} x noise" for system, noise in columns)]
    first = (
        f"Written on {datetime.date.today().isoformat()} by sklearn-pgnn "
        f"{sklearn_pgnn.__version__}, {seeds} seed(s); named / absorbed / missed / wrong."
    )
    write_lines("diagnosis.rst", [first, "", *table(head, rows)])


def write_confusion(results):
    """Write what was said where the hidden effect was neither named nor absorbed."""
    bad = sorted((r for r in results if r.outcome in ("missed", "wrong")), key=str)
    rows = [[r.effect or "nothing", r.system, f"{r.noise:g}", r.said] for r in bad]
    write_lines("diagnosis_confusion.rst", table(["hidden", "system", "noise", "said"], rows))


def table(head, rows) -> list[str]:
    """Write a table of the documentation; a sentence where it has no rows."""
    if not rows:
        return ["There was no such case."]
    lines = [".. list-table::", "   :header-rows: 1", ""]
    for row in [head, *rows]:
        cells = [f"- {cell}".rstrip() for cell in row]
        lines += [f"   * {cells[0]}", *(f"     {cell}" for cell in cells[1:])]
    return lines


def write_lines(name, lines):
    """Write a file of the documentation."""
    TABLES.mkdir(exist_ok=True)
    (TABLES / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _cell(counter) -> str:
    return " / ".join(str(counter[outcome]) for outcome in OUTCOMES) if counter else ""


def _coverage(results, column) -> str:
    found = [result for result in results if (result.system, result.noise) == column]
    total = sum(result.intervals for result in found)
    return f"{sum(result.covered for result in found)} of {total}"


def main():
    """Hide, diagnose and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--noise", type=float, nargs="+", default=[1.0, 5.0])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--systems", nargs="+", choices=SYSTEMS, default=list(SYSTEMS))
    said = parser.parse_args()
    tasks = [
        (system, kind.id, noise, seed)
        for noise in said.noise
        for system in said.systems
        for kind in effects.CATALOGUE
        if kind.targets(SYSTEMS[system][0]())
        for seed in range(said.seeds)
    ]
    tasks += [
        (system, None, noise, 1000 + seed)
        for noise in said.noise
        for system in said.systems
        for seed in range(NOTHING * said.seeds)
    ]
    results = []
    run = Parallel(n_jobs=said.jobs, return_as="generator_unordered")
    for result in run(delayed(diagnose)(*task) for task in tasks):
        results.append(result)
        print(*result, flush=True)
        write_counts(results, said.seeds)
        write_confusion(results)
    print(Counter(result.outcome for result in results if result.effect))
    print("nothing hidden:", Counter(result.outcome for result in results if not result.effect))


if __name__ == "__main__":
    main()
