"""What a diagnosis says beyond the plain case of one effect and plenty of records.

On the four machines of ``diagnosis.py``, records and priors made in the same way, these are hidden:

two or three effects
    drawn from the catalogue, no one a special case of another;
one effect in half the records
    drawn likewise;
one or two wrong parameters
    off by a fifth or more, and no effect;
a law that no effect of the catalogue is
    a product or power subtracted from a state's rate, 0.3 times as large as the rate itself;
a disturbance from outside
    noise added to a state's rate, 0.1 times as large and changing within a fiftieth of a record: no
    effect is hidden.

The table counts what was *named* (every hidden cause and no other, or groups said to be inseparable
that hold them), *absorbed* (no wrong cause, some hidden ones not named, but what is named and the
re-tuning leave only noise), *missed* (no wrong cause, and something is left), *wrong* (a cause that
is not there). For laws beyond the catalogue *named* means: ``unexplained``, in the right equation;
*missed*: ``unexplained``, elsewhere; *wrong*: a name and no doubt. For a disturbance *named* means:
no cause, ``unexplained`` or, where re-tuning or the noise hides it, ``model_adequate``. Run:
``python benchmarks/diagnosis_studies.py [--draws 3] [--jobs 2] [--systems golf ...]``.
"""

import argparse
import datetime
import itertools
import warnings
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from diagnosis import OUTCOMES, SYSTEMS, as_named, named_groups, table, write_lines
from joblib import Parallel, delayed
from scipy.signal import lfilter
from sklearn_pgnn.diagnosis.judge import Rules

import sklearn_pgnn
from sklearn_pgnn import ModelDiagnosis, datasets, effects
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.physics.expressions import parse_expression, symbol
from sklearn_pgnn.simulation.pointwise import numpy_function

STUDIES = {
    "two effects": 2,
    "three effects": 3,
    "one effect, half the records": 1,
    "one wrong parameter": 1,
    "two wrong parameters": 2,
    "a law beyond the catalogue": 1,
    "a disturbance from outside": 0,
}
#: laws by machine: the state whose rate they change, and the term
LAWS = {
    "golf": (("omega", "phi*omega"), ("omega", "torque*phi"), ("omega", "omega**2*phi")),
    "cart": (("v", "x**2*v"), ("v", "force*x"), ("v", "v**2")),
    "tanks": (("x1", "pump*x1"), ("x2", "x1*x2"), ("x2", "x2**2")),
    "motor": (("w", "i*w"), ("i", "i**3"), ("i", "w**2")),
}
#: size of a law and of a disturbance over the rate's, and how fast the latter changes
LAW, DISTURBANCE, FADES = 0.3, 0.1, 1 / 50


@dataclass(frozen=True)
class Result:
    """What came of one diagnosis."""

    study: str
    system: str
    hidden: str
    outcome: str
    said: str


def run(study, system, seed):
    """Hide what a study hides, and say what came of it."""
    warnings.simplefilter("ignore")
    make, noise, options = SYSTEMS[system]
    model, rng = make(), np.random.default_rng([seed, *map(ord, study + system)])
    options = {**options, "noise": noise, "random_state": seed}
    if "half" in study:
        options["n_records"] //= 2
    if "law" in study:
        hidden, judge = hide_law(model, LAWS[system][seed % len(LAWS[system])], options), judge_law
    elif "disturbance" in study:
        hidden, judge = disturb(model, LAWS[system][0][0], options, rng), judge_disturbance
    else:
        draw = draw_parameters if "parameter" in study else draw_effects
        drawn = draw(model, STUDIES[study], rng)
        hidden, judge = datasets.make_hidden_effect(model, drawn, **options), judge_causes
    diagnosis = ModelDiagnosis(hidden.prior, n_jobs=1).fit(hidden.X, hidden.y)
    truth = [f"{effect.id} ({effect.target})" for effect in hidden.effects]
    named = [f"{cause.effect} ({cause.target})" for cause in diagnosis.causes_]
    said = f"{', '.join(named) or 'nothing'}; {diagnosis.verdict_}"
    return Result(study, system, ", ".join(truth), judge(diagnosis, hidden), said)


def draw_effects(model, count, rng):
    """Draw kinds of effects, none of them a special case of another."""
    kinds = [kind for kind in effects.CATALOGUE if kind.targets(model)]
    while True:
        drawn = [kinds[place] for place in rng.choice(len(kinds), count, replace=False)]
        if not any(a.id in b.generalises for a, b in itertools.permutations(drawn, 2)):
            return [kind.id for kind in drawn]


def draw_parameters(model, count, rng):
    """Draw parameters that are off by a fifth to a half."""
    names = rng.choice(model.free_parameters, count, replace=False)
    factors = 1 + rng.choice([-1, 1], count) * rng.uniform(0.2, 0.5, count)
    return [
        effects.WrongParameter(str(name), value=float(model.parameters[name].value * factor))
        for name, factor in zip(names, factors, strict=True)
    ]


def inputs_and_starts(model, hidden):
    """Return the time, and inputs and initial states of all records."""
    records = [rows for _, rows in hidden.X.groupby("trajectory")]
    t, u = records[0]["t"].to_numpy(), np.stack([r[list(model.inputs)] for r in records])
    return t - t[0], u, np.stack([rows[list(model.states)].iloc[0] for rows in records])


def hide_law(model, law, options):
    """Subtract a term from a rate, its spread a share of the rate's without it."""
    state, term = law
    t, u, x0 = inputs_and_starts(model, datasets.make_hidden_effect(model, None, **options))
    x, _ = integrate(model, t, u, x0)
    signals = dict(zip(model.inputs, np.moveaxis(u, -1, 0), strict=True))
    signals |= dict(zip(model.states, np.moveaxis(x, -1, 0), strict=True))
    added = parse_expression(term, signals)
    spread = np.std(numpy_function(tuple(signals), added)(*signals.values()))
    effect = Formula(state, (term,), (float(-LAW * spread_of_rate(t, signals[state]) / spread),))
    return datasets.make_hidden_effect(model, effect, **options)


def spread_of_rate(t, x):
    """Return the standard deviation of a state's rate."""
    return np.std(np.gradient(x, t, axis=1))


def disturb(model, state, options, rng):
    """Add slow noise to a rate; the model knows nothing of it."""
    hidden = datasets.make_hidden_effect(model, None, **options)
    t, u, x0 = inputs_and_starts(model, hidden)
    x, calm = integrate(model, t, u, x0)
    keeps = np.exp(-1.0 / (FADES * t.size))
    slow = lfilter([np.sqrt(1 - keeps**2)], [1, -keeps], rng.standard_normal(u.shape[:2]))
    slow *= DISTURBANCE * spread_of_rate(t, x[..., list(model.states).index(state)])
    rates = {**model.equations, state: model.equations[state] + symbol("outside")}
    rig = model.replace(equations=rates, inputs={**model.inputs, "outside": ""})
    _, y = integrate(rig, t, np.concatenate([u, slow[..., None]], axis=2), x0)
    return replace(hidden, y=hidden.y + (y - calm).reshape(hidden.y.shape))


def judge_causes(diagnosis, hidden):
    """Return the outcome for hidden causes of the catalogue."""
    left = {as_named(hidden.prior, effect) for effect in hidden.effects}
    groups = named_groups(diagnosis)
    matched = _matched(groups, left)
    if matched < len(groups):
        return "wrong"
    if matched == len(left):
        return "named"
    return "absorbed" if leaves_noise(diagnosis) else "missed"


def _matched(groups, truth):
    """Count the hidden causes that can be told, each in a group of its own."""
    orders = itertools.permutations(truth, min(len(groups), len(truth)))
    return max(sum(c in g for c, g in zip(order, groups, strict=False)) for order in orders)


def leaves_noise(diagnosis):
    """Return whether the extended model leaves hardly more than noise."""
    gains = diagnosis.gain_.values()
    return all(g.extended**2 - g.noise**2 < Rules().whole * g.extended**2 for g in gains)


def judge_law(diagnosis, hidden):
    """Return the outcome for a hidden law outside of the catalogue."""
    if diagnosis.verdict_ == "unexplained":
        part = diagnosis.discrepancy_
        return "named" if part and part.target == hidden.effect.target else "missed"
    if diagnosis.causes_:
        return "wrong"
    return "absorbed"


def judge_disturbance(diagnosis, hidden):
    """Return whether a cause was named where there is only a disturbance."""
    return "wrong" if diagnosis.causes_ else "named"


def write(results, draws):
    """Write the counts by study and machine, and what was said where it was wrong or missed."""
    systems = [name for name in SYSTEMS if any(r.system == name for r in results)]
    first = (
        f"Written on {datetime.date.today().isoformat()} by sklearn-pgnn "
        f"{sklearn_pgnn.__version__}, {draws} draws a cell; {' / '.join(OUTCOMES)}."
    )
    counts = table(["hidden", *systems, "all"], list(_counts(results, systems)))
    write_lines("diagnosis_studies.rst", [first, "", *counts])
    bad = sorted((r for r in results if r.outcome in ("missed", "wrong")), key=str)
    rows = [[r.study, r.system, r.hidden, f"{r.outcome}: {r.said}"] for r in bad]
    head = ["study", "machine", "hidden", "said"]
    write_lines("diagnosis_studies_missed.rst", table(head, rows))


def _counts(results, systems):
    """Return a row for every study."""
    for study in STUDIES:
        of = [result for result in results if result.study == study]
        if not of:
            continue
        cells = [Counter(r.outcome for r in of if r.system == name) for name in systems]
        cells.append(Counter(r.outcome for r in of))
        yield [study, *(" / ".join(str(cell[o]) for o in OUTCOMES) for cell in cells)]


def main():
    """Hide, diagnose and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--systems", nargs="+", choices=SYSTEMS, default=list(SYSTEMS))
    parser.add_argument("--studies", nargs="+", choices=STUDIES, default=list(STUDIES))
    said = parser.parse_args()
    tasks = itertools.product(said.studies, said.systems, range(said.draws))
    results = []
    for result in Parallel(n_jobs=said.jobs, return_as="generator_unordered")(
        delayed(run)(*task) for task in tasks
    ):
        results.append(result)
        print(result, flush=True)
    write(results, said.draws)


if __name__ == "__main__":
    main()
