"""Free runs stay finite: what diverges is told once, and steps of a slow table are divided."""

import warnings

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.simulation.finite_run import FreeRuns, limits_of, simulate_quantities
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

GROWTH = PhysicsModel({"y": "V"}, {"y": "y/T"}, {"T": 0.1}, initial_state={"y": 1.0}, name="growth")


def records_of(*durations):
    """Return a record of each duration."""
    return read_records(GROWTH, np.concatenate([np.arange(n)[:, None] * 0.01 for n in durations]))


def simulated(runs, records):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return runs(records)[:, 0], [str(each.message) for each in caught]


def test_several_that_become_non_finite_are_one_warning():
    x, told = simulated(
        lambda records: simulate_quantities(GROWTH, records, ["y"]), records_of(50, 9000, 60, 9000)
    )
    assert x[:50] == pytest.approx(np.exp(np.arange(50) / 10), rel=1e-4)
    assert np.isfinite(x).all()
    (told,) = told
    assert told.startswith("trajectory '1': the simulation of 'growth' became non-finite")
    assert told.endswith("Its rows get the values of its first row. So do those of 1 more: 3.")


def test_what_exceeds_the_limits_is_told_where_it_does_first():
    runs = FreeRuns(0.01, 1, limits_of(np.array([[0.5], [1.0], [np.nan]])), "zoh", remedy="wait")
    x, (told,) = simulated(lambda records: runs.simulate(GROWTH, records, ["y"]), records_of(100))
    assert (x == 1.0).all()
    assert "'y' is 1.1e+03 at t = 0.7 s, more than 1000 times" in told  # exp(6.9) = 992
    assert "the largest value in fit. Remedy: wait. Its rows" in told


@pytest.mark.parametrize("every", [2, 5])
def test_a_slower_record_is_integrated_in_the_same_steps(every):
    runs, (fast,) = FreeRuns(0.01, 3, np.array([np.inf]), "zoh"), records_of(51)
    (slow,) = read_records(GROWTH, fast.t[::every, None])
    whole, few = runs.run(GROWTH, fast), runs.run(GROWTH, slow)
    assert few.y == pytest.approx(whole.y[::every], rel=1e-12)
    assert runs.model_along(GROWTH, slow).simulation["substeps"] == 3 * every
    assert runs.model_along(GROWTH, fast) is GROWTH
