"""Free runs stay finite, and their error is not that of their initial state."""

import warnings
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.inspection.first_look import first_look
from sklearn_pgnn.simulation.finite_run import FreeRuns, limits_of, simulate_quantities
from sklearn_pgnn.simulation.free_starts import fit_starts
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.simulation.state_estimate import free_run
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


G, STEP, NOISE = 9.81, 0.02, 3e-3
PENDULUM = PhysicsModel(
    {"theta": "rad", "omega": "rad/s"},
    {"theta": "omega", "omega": "-(g/l)*sin(theta) - d*omega"},
    {"l": {"value": 0.3, "unit": "m"}, "d": 0.02, "g": {"value": G, "fixed": True}},
    outputs={"theta": "theta"},
    initial_state={"theta": 0.5},
)


def swings(seed, d=0.02, n=3, duration=15.0):
    """Return free swings from unknown starts, integrated by scipy, with noise."""
    rng, tables, outputs, starts = np.random.default_rng(seed), [], [], []
    t = np.arange(0.0, duration, STEP)
    for k in range(n):
        begin = [rng.uniform(0.5, 1.2), rng.uniform(-3.0, 3.0)]
        run = solve_ivp(
            lambda _, x: [x[1], -G / 0.3 * np.sin(x[0]) - d * x[1]],
            (0.0, t[-1]),
            begin,
            t_eval=t,
            rtol=1e-9,
            atol=1e-10,
        )
        tables.append(pd.DataFrame({"trajectory": k, "t": t}))
        outputs.append(run.y[0] + NOISE * rng.normal(size=t.size))
        starts.append(begin)
    y = pd.DataFrame({"theta": np.concatenate(outputs)})
    return pd.concat(tables, ignore_index=True), y, np.array(starts)


def errors(model, windowed, starts):
    """Return the free-run error of every record."""
    windows = windowed.windows
    spans = zip(pairwise(windows.bounds), starts, strict=True)
    runs = [free_run(model, windows, a, b, start) for (a, b), start in spans]
    cuts = windows.bounds[1:-1]
    return [
        float(np.sqrt(np.mean((run.y - y) ** 2)))
        for run, y in zip(runs, np.split(windows.y, cuts), strict=True)
    ]


@pytest.mark.parametrize("seed", range(3))
def test_the_free_run_of_the_true_model_leaves_the_noise(seed):
    X, y, _ = swings(seed)
    look = first_look(PENDULUM, X, y)
    assert look.outputs[0].error < 1.1 * NOISE


def test_the_first_reading_of_a_sensor_is_no_known_start():
    X, y, starts = swings(3)
    X = X.assign(theta=y["theta"])  # as in a file whose column of the output has the state's name
    windowed = window_records(PENDULUM, read_records(PENDULUM, X, y))
    found = fit_starts(PENDULUM, windowed.windows, windowed.states)
    assert np.abs(found - starts)[:, 0].max() < NOISE
    assert max(errors(PENDULUM, windowed, found)) < 1.1 * NOISE


def test_a_start_that_is_given_is_kept():
    X, y, starts = swings(4)
    first = ~X["trajectory"].duplicated()
    X.loc[first, ["theta", "omega"]] = starts + 0.01
    windowed = window_records(PENDULUM, read_records(PENDULUM, X, y))
    found = fit_starts(PENDULUM, windowed.windows, windowed.states)
    np.testing.assert_allclose(found, starts + 0.01, atol=1e-12)


def test_a_start_does_not_make_up_for_a_wrong_model():
    X, y, starts = swings(5, d=0.3)
    windowed = window_records(PENDULUM, read_records(PENDULUM, X, y))
    found = fit_starts(PENDULUM, windowed.windows, windowed.states)
    assert np.abs(found - starts)[:, 0].max() < 0.05
    assert min(errors(PENDULUM, windowed, found)) > 20 * NOISE
