"""A run over many cases that goes on from where it was stopped."""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path

from joblib import Parallel, delayed


def resumed(path: Path, kind: type, cases: Iterable, run: Callable, jobs: int) -> list:
    """Return the outcome of every case: those of a file of JSON lines, and the others, run now.

    An outcome is a dataclass of a `kind`, and says of which `case` it is. Each goes to the file as
    soon as it is there.
    """
    lines = path.read_text().splitlines() if path.exists() else []
    cases, known = list(cases), [kind(**json.loads(line)) for line in lines]
    outcomes = [outcome for outcome in known if outcome.case in cases]
    done = {outcome.case for outcome in outcomes}
    left = (delayed(run)(case) for case in cases if case not in done)
    with path.open("a") as file:
        for outcome in Parallel(n_jobs=jobs, return_as="generator_unordered")(left):
            outcomes.append(outcome)
            file.write(json.dumps(asdict(outcome)) + "\n")
            file.flush()
            print(f"{len(outcomes)}/{len(cases)}", *asdict(outcome).values(), flush=True)
    return outcomes
