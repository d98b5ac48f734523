"""Time a search over regressors behind a simulation: with and without the pipeline's memory.

Run with ``python benchmarks/pipeline_memory.py``. The same search (Ridge after
`PhysicsModelTransformer`, by trajectories) runs in three ways, taken in turn: a plain pipeline,
one with ``memory``, which simulates every training fold once, and on a table that was simulated
before the search. Prints the best time of each, how many tables were simulated, and whether all
three found the same.
"""

import tempfile
import time
from unittest.mock import patch

import numpy as np
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import Pipeline

from sklearn_pgnn import PhysicsModelTransformer, datasets, systems
from sklearn_pgnn.model_selection import TrajectoryKFold
from sklearn_pgnn.preprocessing import physics_model_transformer

CANDIDATES, FOLDS, REPEATS = 10, 3, 2
#: integration steps a sample: none to speak of, and as a stiff model needs them
SUBSTEPS = (1, 16)
SIMULATE = physics_model_transformer.simulate_quantities


def search(steps, memory=None):
    """Prepare a search over Ridge's penalty."""
    pipeline = Pipeline([*steps, ("ridge", Ridge())], memory=memory)
    grid = {"ridge__alpha": np.logspace(-6, 3, CANDIDATES)}
    return GridSearchCV(pipeline, grid, cv=TrajectoryKFold(FOLDS))


def plain(physics, X, y):
    """Simulate for every candidate."""
    return search([("physics", physics)]).fit(X, y)


def with_memory(physics, X, y):
    """Simulate once a training fold, beginning with an empty memory."""
    with tempfile.TemporaryDirectory() as folder:
        return search([("physics", physics)], folder).fit(X, y)


def simulated_before(physics, X, y):
    """Simulate once; the transformer learns nothing from y, so that nothing leaks."""
    simulated = physics.set_output(transform="pandas").fit_transform(X)
    return search([]).fit(simulated, y, groups=X["trajectory"])


def timed(way, *arguments):
    """Return the time [s], the number of simulated tables, and the best score."""
    with patch.object(physics_model_transformer, "simulate_quantities", wraps=SIMULATE) as count:
        start = time.perf_counter()
        found = way(*arguments)
        return time.perf_counter() - start, count.call_count, found.best_score_


def compare(substeps, X, y):
    """Run the three ways in turn, and print their best times."""
    ways = (plain, with_memory, simulated_before)
    physics = PhysicsModelTransformer(systems.golf_robot(), substeps=substeps)
    physics.fit_transform(X)  # compiled before the clock starts
    rounds = [[timed(way, physics, X, y) for way in ways] for _ in range(REPEATS)]
    best = [min(results) for results in zip(*rounds, strict=True)]
    print(f"{substeps} integration steps a sample")
    for way, (seconds, tables, score) in zip(ways, best, strict=True):
        ratio = best[0][0] / seconds
        print(
            f"  {way.__name__:17s} {seconds:6.2f} s  {tables:3d} tables simulated"
            f"  {ratio:5.2f} times as fast as plain  R2 {score:.6f}"
        )


def main():
    """Print a table for a model that is cheap to simulate, and one that is not."""
    X, y = datasets.make_golf_robot()
    print(f"{len(X)} samples, {CANDIDATES} candidates, {FOLDS} folds, best of {REPEATS}")
    for substeps in SUBSTEPS:
        compare(substeps, X, y)


if __name__ == "__main__":
    main()
