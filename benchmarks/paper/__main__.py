"""What the paper found, on simulated plants: its main table, its studies and its open questions.

Every finished result is kept at once under ``benchmarks/paper/results``; a run that was broken off
goes on where it stopped (``--again`` begins anew), and tables and pictures of the documentation
are written from what is there. Run: ``python benchmarks/paper [--studies main_table energy ...]
[--seeds 5] [--jobs 2]``.
"""

import argparse
import importlib
import warnings

from joblib import Parallel, delayed
from results import Results

STUDIES = (
    "main_table",
    "diagnosed",
    "energy",
    "loss_terms",
    "dissipation",
    "depth",
)


def perform(study, task):
    """Do a task of a study; give what was found."""
    warnings.simplefilter("ignore")
    return study, task, importlib.import_module(study).run(**task)


def main():
    """Do what is not done yet, and write tables and pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", nargs="*", default=STUDIES, choices=STUDIES)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--again", action="store_true", help="forget earlier results")
    parser.add_argument("--write", action="store_true", help="only write what there is")
    arguments = parser.parse_args()
    results = {study: Results(study) for study in arguments.studies}
    try:
        if not arguments.write:
            do(results, arguments)
    finally:
        for study, each in results.items():
            if each.lines:
                importlib.import_module(study).write(each)


def do(results, arguments):
    """Go through all tasks of all studies."""
    if arguments.again:
        for each in results.values():
            each.clear()
    todo = [
        (study, task)
        for study, each in results.items()
        for task in importlib.import_module(study).tasks(arguments.seeds)
        if task not in each
    ]
    done = Parallel(arguments.jobs, return_as="generator_unordered", batch_size=1)(
        delayed(perform)(*each) for each in todo
    )
    for i, (study, task, found) in enumerate(done, 1):
        results[study].add(task, found)
        print(f"{i}/{len(todo)}", study, *task.values(), flush=True)


if __name__ == "__main__":
    main()
