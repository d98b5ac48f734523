"""Validate the diagnosis on what is hidden at joints, stores and terminals of coupled machines.

Every outcome goes to a file of JSON lines as soon as it is there, and a run that was stopped goes
on from it. Run ``python benchmarks/validation/places [--jobs 2]`` for the 120 cases that count,
``--development`` for others to work with, and ``--machine crane gear``, ``--count 4`` and
``--catalogue coulomb_friction quadratic_drag`` for a quick look.
"""

import argparse
import json
import random
from collections import Counter
from pathlib import Path

from cases import DEVELOPMENT, FROZEN, all_cases
from joblib import Parallel, delayed
from outcome import OUTCOMES, Outcome, run
from plants import PLANTS


def chosen(said):
    """Return the cases that were asked for, in an order drawn at random."""
    cases = all_cases(DEVELOPMENT if said.development else FROZEN)
    cases = [case for case in cases if case.machine in said.machine]
    random.Random(0).shuffle(cases)
    return cases[: said.count]


def known(path) -> list[Outcome]:
    """Read what an earlier run found."""
    lines = path.read_text().splitlines() if path.exists() else []
    return [Outcome(**json.loads(line)) for line in lines]


def summary(outcomes) -> str:
    """Return the shares that are right, and what is said wrongly and for sure."""
    hidden = [o for o in outcomes if o.number >= 0]
    right = sum(o.outcome in ("right", "group") for o in hidden)
    nothing = [o for o in outcomes if o.number < 0]
    adequate = sum(o.outcome == "adequate" for o in nothing)
    sure = [f"{o.machine}: {o.hidden}, said {o.said}" for o in outcomes if o.sure]
    return "\n".join(
        [
            f"right port and effect: {right} of {len(hidden)}",
            f"right models adequate: {adequate} of {len(nothing)}",
            f"wrong ports with p > 0.9: {len(sure)}",
            *sure,
        ]
    )


def main():
    """Diagnose and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--development", action="store_true")
    parser.add_argument("--machine", nargs="+", choices=PLANTS, default=list(PLANTS))
    parser.add_argument("--count", type=int)
    parser.add_argument("--catalogue", nargs="+", help="few effects, for a quick look")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--results", type=Path, default=Path("places.jsonl"))
    said = parser.parse_args()
    cases = chosen(said)
    outcomes = [outcome for outcome in known(said.results) if outcome.case in cases]
    options = {"catalogue": said.catalogue} if said.catalogue else {}
    left = [case for case in cases if case not in {outcome.case for outcome in outcomes}]
    with said.results.open("a") as file:
        for outcome in Parallel(n_jobs=said.jobs, return_as="generator_unordered")(
            delayed(run)(case, **options) for case in left
        ):
            outcomes.append(outcome)
            file.write(json.dumps(outcome.to_dict()) + "\n")
            file.flush()
            print(f"{len(outcomes)}/{len(cases)}", *outcome.to_dict().values(), flush=True)
    for machine in said.machine:
        counts = Counter(o.outcome for o in outcomes if o.machine == machine)
        print(machine, {name: counts[name] for name in OUTCOMES if counts[name]})
    print(summary(outcomes))


if __name__ == "__main__":
    main()
