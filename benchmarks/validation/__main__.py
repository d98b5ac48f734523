"""Validate the diagnosis on hidden causes drawn once: what is named, missed and wrong.

Every outcome goes to a file of JSON lines as soon as it is there, and a run that was stopped goes
on from it. Run ``python benchmarks/validation [--jobs 2]`` for the cases that the documentation
reports (about a thousand, hours), ``--development`` for others to work with, and ``--only single
pair ...`` and ``--count 50`` for some of them, drawn at random.
"""

import argparse
import json
import random
from collections import Counter
from pathlib import Path

from cases import DEVELOPMENT, FROZEN, all_cases
from joblib import Parallel, delayed
from outcome import Outcome, run
from tables import ROWS, write


def chosen(said):
    """Return the cases that were asked for, in an order drawn at random."""
    cases = all_cases(DEVELOPMENT if said.development else FROZEN)
    cases = [case for case in cases if case.kind in said.only]
    random.Random(0).shuffle(cases)
    return cases


def known(path) -> list[Outcome]:
    """Read what an earlier run found."""
    if not path.exists():
        return []
    return [Outcome(**json.loads(line)) for line in path.read_text().splitlines()]


def main():
    """Diagnose, count and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--development", action="store_true")
    parser.add_argument("--only", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--count", type=int)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--results", type=Path, default=Path("validation.jsonl"))
    said = parser.parse_args()
    drawn = chosen(said)
    cases = drawn[: said.count]
    outcomes = [outcome for outcome in known(said.results) if outcome.case in cases]
    left = [case for case in cases if case not in {outcome.case for outcome in outcomes}]
    with said.results.open("a") as file:
        for outcome in Parallel(n_jobs=said.jobs, return_as="generator_unordered")(
            delayed(run)(case) for case in left
        ):
            outcomes.append(outcome)
            file.write(json.dumps(outcome.to_dict()) + "\n")
            file.flush()
            print(f"{len(outcomes)}/{len(cases)}", *outcome.to_dict().values(), flush=True)
    for kind in said.only:
        print(kind, dict(Counter(o.outcome for o in outcomes if o.kind == kind)))
    if not said.development:
        write(outcomes, len(drawn))


if __name__ == "__main__":
    main()
