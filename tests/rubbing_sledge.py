"""Fits of a sledge whose model misses its dry friction, shared by tests of the search's parts."""

from functools import lru_cache

from sledge import SLEDGE, drive

from sklearn_pgnn import effects
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records

LEVEL = 0.4
KINDS = (
    effects.ConstantLoad,
    effects.CoulombFriction,
    effects.QuadraticDrag,
    effects.InputDeadZone,
    effects.WrongParameter,
)
CRITERION = SelectionCriterion(alpha=0.01, smallest_share=0.05, n_candidates=len(KINDS) + 1)


@lru_cache(maxsize=1)
def rubbing():
    """Return X and y of the sledge."""
    return drive(SLEDGE + effects.CoulombFriction("v", level=LEVEL), n_records=3)


def fresh_fitter():
    """Return a fitter of these records that has fitted nothing yet."""
    return HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, *rubbing())))


def fitted(fitter, *kinds):
    """Return a hypothesis on all windows, its causes added one by one."""
    current = fitter.base()
    for kind in kinds:
        ground = fitter.subsample(current)
        found = fitter.converge(fitter.first_fit(ground, kind(kind.targets(SLEDGE)[0])))
        current = fitter.fit_all(found, current)
    return current
