"""Validate the diagnosis on hidden causes drawn once: what is named, missed and wrong.

Every outcome goes to a file of JSON lines as soon as it is there, and a run that was stopped goes
on from it. Run ``python benchmarks/validation [--jobs 2]`` for the cases that the documentation
reports (about a thousand, hours), ``--development`` for others to work with, and ``--only single
pair ...`` and ``--count 50`` for some of them, drawn at random.
"""

import argparse
import random
from collections import Counter
from pathlib import Path

from cases import DEVELOPMENT, FROZEN, all_cases
from outcome import Outcome, run
from resumed import resumed
from tables import ROWS, write


def chosen(said):
    """Return the cases that were asked for, in an order drawn at random."""
    cases = all_cases(DEVELOPMENT if said.development else FROZEN)
    cases = [case for case in cases if case.kind in said.only]
    random.Random(0).shuffle(cases)
    return cases


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
    outcomes = resumed(said.results, Outcome, cases, run, said.jobs)
    for kind in said.only:
        print(kind, dict(Counter(o.outcome for o in outcomes if o.kind == kind)))
    if not said.development:
        write(outcomes, len(drawn))


if __name__ == "__main__":
    main()
